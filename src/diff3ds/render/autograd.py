"""The compiled CPU kernels as one differentiable operation: from curves, in space or projected, to images."""

from typing import Any, cast

import torch
from torch.autograd.function import once_differentiable

from diff3ds._shapes import Tensor
from diff3ds.render.backends import get_num_threads, kernels
from diff3ds.render.drawing import Curves, Drawing, Images, Looks, Options


def draw(drawing: Drawing) -> Images:
    """Colour, alpha and depth by the CPU kernels.

    Raises:
        ValueError: a stroke with a value that cannot be drawn.
    """
    tensors = drawing.tensors()
    if torch.is_grad_enabled() and any(t.requires_grad for t in tensors):
        return cast(Images, _Draw.apply(drawing.size, drawing.options, *tensors))  # type: ignore[no-untyped-call]
    return _forward(drawing, save=False)[0]


def _forward(drawing: Drawing, save: bool) -> tuple[Images, Any]:
    color, alpha, depth, state = _ready_kernels().forward(*drawing, save)
    return (torch.from_numpy(color), torch.from_numpy(alpha), torch.from_numpy(depth)), state


def _ready_kernels() -> Any:
    module = kernels()
    assert module is not None
    module.set_threads(get_num_threads())
    return module


class _Draw(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, size: tuple[int, int], options: Options, *tensors: Tensor) -> Images:
        ctx.set_materialize_grads(False)
        looks, curves = cast(Looks, tensors[:4]), cast(Curves, tensors[4:])
        images, ctx.state = _forward(Drawing(curves, looks, size, options), save=True)
        # The kernels' state points to the background and the curves: saved, a change of them before the backward is an
        # error.
        ctx.save_for_backward(images[1], images[2], looks[3], *curves)
        return images

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor | None) -> tuple[Tensor | None, ...]:
        # Only a graph of the gradients must refuse to be differentiated; the refusal costs what tiny images feel.
        return (_once if torch.is_grad_enabled() else _gradients)(ctx, *upstream)


def _gradients(ctx: Any, *upstream: Tensor | None) -> tuple[Tensor | None, ...]:
    alpha, depth, canvas, *_ = ctx.saved_tensors
    needs = ctx.needs_input_grad
    # Only the gradient of depth needs them.
    planes = (None, None) if upstream[2] is None else (alpha, depth)
    gradients = _ready_kernels().backward(ctx.state, upstream, planes, needs[5], needs[-1])
    if needs[5]:
        gradients = (*gradients[:3], _summed(gradients[3], canvas.shape), *gradients[4:])
    return None, None, *(None if g is None else torch.from_numpy(g) for g in gradients)


_once = once_differentiable(_gradients)


def _summed(gradient: Any, shape: tuple[int, ...]) -> Any:
    """The gradient of what was expanded from a shape. Numpy's sums do not depend on the number of threads."""
    axes = tuple(k for k, n in enumerate(shape) if n == 1)
    total = gradient.sum(axis=axes, keepdims=True, dtype="float64") if axes else gradient
    return total.astype(gradient.dtype, copy=False)
