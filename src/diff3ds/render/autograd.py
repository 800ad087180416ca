"""Drawing by kernels as one operation of autograd and torch.func; what the kernels cannot differentiate is refused.

Torch takes a derivative that nobody computes for zero. Kernels know first derivatives in reverse mode alone, so second
ones and forward mode end in an error here.
"""

from typing import Any, NoReturn, Protocol, cast, runtime_checkable

import torch

from diff3ds._modes import recorded, transformed
from diff3ds._shapes import Tensor
from diff3ds.chains import Chains
from diff3ds.render.kernel_inputs import Appearance, Batch, Curves, Images, KernelInputs, Options, PlainCameras

# The gradient of each image, None where it is not used; then those of the appearance, and of the curves.
Upstream = tuple[Tensor | None, Tensor | None, Tensor | None]
Gradients = tuple[Tensor | None, ...]

TWICE = (
    "gradients by kernels cannot be differentiated a second time (hessian, hvp, a penalty on a gradient): draw with "
    'backend="reference" and antialiasing="analytic"'
)
TWICE_SAMPLED = (
    "gradients of Monte Carlo antialiasing are estimates that cannot be differentiated a second time: draw with "
    'antialiasing="analytic" and backend="reference"'
)
FORWARD_MODE = (
    "kernels have no derivatives in forward mode (jvp, jacfwd): use reverse mode (grad, vjp, jacrev), or draw with "
    'backend="reference" and antialiasing="analytic"'
)
FORWARD_MODE_SAMPLED = (
    "Monte Carlo antialiasing has no derivatives in forward mode (jvp, jacfwd): use reverse mode (grad, vjp, jacrev), "
    'or antialiasing="analytic" with backend="reference"'
)
BATCHED = (
    "gradients by kernels cannot be batched by is_grads_batched=True, or vectorize=True of torch.autograd.functional: "
    "use torch.func.jacrev, or vectorize=False"
)
MAPPED = "drawings cannot be mapped by torch.vmap: loop, or draw all strokes as one sketch and all views at once"
RECORDED = (
    "such a drawing cannot be recorded as a graph of torch's operations, which would hold the images as constants: "
    "use render with kernels in make_fx, torch.export or torch.compile; torch.jit.trace has no way"
)


@runtime_checkable
class Kernels(Protocol):
    """What draws and differentiates: the kernels of one kind of device."""

    def forward(self, inputs: KernelInputs, save: bool) -> tuple[Images, Any]:
        """The images, and if they are saved for it what the gradients need: no tuple, list or dictionary."""
        ...

    def backward(
        self, saved: Any, upstream: Upstream, planes: tuple[Tensor, Tensor], background: Tensor, needs: tuple[bool, ...]
    ) -> Gradients:
        """The gradients. planes: alpha and depth; needs: of each gradient whether it is asked for."""
        ...


def draw(inputs: KernelInputs, kernels: Kernels) -> Images:
    """Colour, alpha and depth, differentiable once.

    Raises:
        ValueError: a stroke with a value that cannot be drawn.
        RuntimeError: a transform that kernels do not take part in, or a graph that is recorded.
    """
    refuse_recording()
    tensors = inputs.tensors()
    if transformed():
        return _drawn(_Draw, inputs, kernels)
    if torch.is_grad_enabled() and any(t.requires_grad for t in tensors):
        return _drawn(_PlainDraw, inputs, kernels)
    return kernels.forward(inputs, save=False)[0]


def refuse_recording() -> None:
    """Raises RuntimeError where a recorded graph would hold the images as constants."""
    if torch._C._get_tracing_state() or recorded():
        raise RuntimeError(RECORDED)


def _refuse_legacy_batches(upstream: tuple[Tensor | None, ...]) -> None:
    if any(g is not None and torch._C._functorch.is_legacy_batchedtensor(g) for g in upstream):
        raise RuntimeError(BATCHED)


def _drawn(operation: type[torch.autograd.Function], inputs: KernelInputs, kernels: Kernels) -> Images:
    rest = inputs.cameras, inputs.chains, inputs.batch, inputs.size, inputs.options
    images = operation.apply(kernels, *rest, *inputs.tensors())  # type: ignore[no-untyped-call]
    return cast(Images, images[:3])


class _Draw(torch.autograd.Function):
    """From appearance and curves to images, and what was saved."""

    @staticmethod
    def forward(
        kernels: Kernels,
        cameras: PlainCameras | None,
        chains: Chains | None,
        batch: Batch | None,
        size: tuple[int, int],
        options: Options,
        *tensors: Tensor,
    ) -> tuple[Any, ...]:
        appearance, curves = cast(Appearance, tensors[:5]), cast(Curves, tensors[5:])
        images, saved = kernels.forward(
            KernelInputs(curves, cameras, chains, batch, appearance, size, options), save=True
        )
        return *images, saved

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Any, ...]) -> None:
        ctx.set_materialize_grads(False)
        ctx.kernels, _, _, _, _, ctx.options, *tensors = inputs
        _, alpha, depth, ctx.saved = output
        # What was saved points to tensors among these: held here too, a change of one before the backward is an error.
        ctx.save_for_backward(alpha, depth, *tensors)

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor | None) -> tuple[Tensor | None, ...]:
        _refuse_legacy_batches(upstream)
        alpha, depth, *tensors = ctx.saved_tensors
        given = (ctx.kernels, ctx.saved, ctx.options, ctx.needs_input_grad[6:], *upstream[:3], alpha, depth, *tensors)
        # Only a graph of the gradients must refuse to be differentiated; tiny images feel what it costs.
        as_operation = torch.is_grad_enabled() or transformed()
        gradients = _Gradients.apply(*given) if as_operation else _Gradients.forward(*given)  # type: ignore[no-untyped-call]
        return None, None, None, None, None, None, *gradients

    @staticmethod
    def jvp(ctx: Any, *tangents: object) -> NoReturn:
        raise RuntimeError(FORWARD_MODE_SAMPLED if ctx.options.strata else FORWARD_MODE)

    @staticmethod
    def vmap(*args: object) -> NoReturn:
        raise RuntimeError(MAPPED)


class _PlainDraw(torch.autograd.Function):
    """The same outside torch.func: operations that serve it take torch so long that tiny images feel it."""

    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> tuple[Any, ...]:
        output = _Draw.forward(*inputs)
        _Draw.setup_context(ctx, inputs, output)
        return output[:3]

    backward = _Draw.backward


class _Gradients(torch.autograd.Function):
    """The gradients of appearance and curves; they depend on all tensors: no derivative of theirs goes unnoticed."""

    @staticmethod
    def forward(kernels: Kernels, saved: Any, options: Options, needs: tuple[bool, ...], *tensors: Any) -> Gradients:
        upstream, planes, background = tensors[:3], tensors[3:5], tensors[8]
        return kernels.backward(saved, upstream, planes, background, needs)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Any, ...]) -> None:
        ctx.options = inputs[2]

    @staticmethod
    def backward(ctx: Any, *upstream: object) -> NoReturn:
        raise RuntimeError(TWICE_SAMPLED if ctx.options.strata else TWICE)

    jvp = _Draw.jvp

    @staticmethod
    def vmap(info: Any, in_dims: tuple[Any, ...], *given: Any) -> tuple[Gradients, tuple[int | None, ...]]:
        """One after the other: the rows of a Jacobian."""

        def row(k: int) -> Gradients:
            return cast(Gradients, _Gradients.apply(*(_at(k, *pair) for pair in zip(given, in_dims, strict=True))))  # type: ignore[no-untyped-call]

        columns = zip(*map(row, range(info.batch_size)), strict=True)
        gradients = tuple(None if column[0] is None else torch.stack(column) for column in columns)
        return gradients, tuple(None if g is None else 0 for g in gradients)


def _at(k: int, value: Any, axis: Any) -> Any:
    """Item k of what is batched along an axis."""
    return value if axis is None or not isinstance(value, Tensor) else value.select(axis, k)


def sampled(tensors: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
    """The same tensors, from which an estimate is made that has first derivatives in reverse mode only."""
    return cast(tuple[Tensor, ...], _Sampled.apply(*tensors))  # type: ignore[no-untyped-call]


class _Sampled(torch.autograd.Function):
    generate_vmap_rule = True

    @staticmethod
    def forward(*tensors: Tensor) -> tuple[Tensor, ...]:
        return tuple(t.view_as(t) for t in tensors)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Tensor, ...], output: tuple[Tensor, ...]) -> None:
        ctx.save_for_backward(*inputs)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, ...]:
        return cast(tuple[Tensor, ...], _Estimates.apply(len(gradients), *gradients, *ctx.saved_tensors))  # type: ignore[no-untyped-call]

    @staticmethod
    def jvp(ctx: Any, *tangents: object) -> NoReturn:
        raise RuntimeError(FORWARD_MODE_SAMPLED)


class _Estimates(torch.autograd.Function):
    """The first tensors, gradients; they depend on all, so that no derivative of theirs goes unnoticed."""

    generate_vmap_rule = True

    @staticmethod
    def forward(count: int, *tensors: Tensor) -> tuple[Tensor, ...]:
        return tuple(t.view_as(t) for t in tensors[:count])

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, ...]) -> None:
        pass

    @staticmethod
    def backward(ctx: Any, *gradients: object) -> NoReturn:
        raise RuntimeError(TWICE_SAMPLED)

    jvp = _Sampled.jvp
