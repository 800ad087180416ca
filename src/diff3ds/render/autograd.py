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
    module = _ready_kernels()
    first, *others = (_array(t) for t in drawing.curves)
    arrays = (_array(t) for t in drawing.looks)
    cubics = module.project(first, *others) if others else first
    *images, state = module.forward(cubics, *arrays, *drawing.size, *drawing.options, save)
    planes = (torch.from_numpy(a) for a in images)
    return cast(Images, tuple(planes)), state


def _array(tensor: Tensor) -> Any:
    return tensor.detach().contiguous().numpy()


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
        # The kernels' state points to the background: saved, a change of it before the backward is an error.
        ctx.save_for_backward(images[1], images[2], looks[3], *curves)
        return images

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *upstream: Tensor | None) -> tuple[Tensor | None, ...]:
        alpha, depth, canvas, *curves = ctx.saved_tensors
        needs_canvas, needs_matrices = ctx.needs_input_grad[5], ctx.needs_input_grad[-1]
        module = _ready_kernels()
        # Only the gradient of depth needs them.
        planes = [None, None] if upstream[2] is None else [alpha.numpy(), depth.numpy()]
        arrays = [None if g is None else _array(g) for g in upstream]
        g_cubics, *g_strokes, g_canvas = module.backward(ctx.state, *arrays, *planes, needs_canvas)
        g_curves = [g_cubics]
        if len(curves) > 1:
            g_curves = module.project_backward(*(_array(t) for t in curves), g_cubics, needs_matrices)
        if needs_canvas:
            g_canvas = _summed(g_canvas, canvas.shape)
        gradients = (*g_strokes, g_canvas, *g_curves)
        return None, None, *(None if g is None else torch.from_numpy(g) for g in gradients)


def _summed(gradient: Any, shape: tuple[int, ...]) -> Any:
    """The gradient of what was expanded from a shape. Numpy's sums do not depend on the number of threads."""
    axes = tuple(k for k, n in enumerate(shape) if n == 1)
    total = gradient.sum(axis=axes, keepdims=True, dtype="float64") if axes else gradient
    return total.astype(gradient.dtype, copy=False)
