"""The compiled CPU kernels as differentiable operations: projection and rasterisation."""

from typing import Any, NamedTuple, cast

import torch
from torch.autograd.function import once_differentiable

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.project import Strokes2D, half_widths
from diff3ds.render.backends import get_num_threads, kernels
from diff3ds.sketch import Sketch


class Options(NamedTuple):
    """What the kernels need besides tensors. strata: samples per pixel and direction, 0 for analytic antialiasing."""

    world: bool
    near: float
    blur: float
    strata: int
    seed: int


def project(sketch: Sketch, cameras: Cameras) -> Strokes2D:
    """As `diff3ds.project.project`, on the CPU; bitwise equal on any number of threads."""
    points, weights = sketch.points, sketch.weights
    cubics = cast(Tensor, _Project.apply(points, weights, cameras.projection))  # type: ignore[no-untyped-call]
    half_width = half_widths(sketch, cameras)
    return Strokes2D(cubics, half_width, sketch.color, sketch.opacity, sketch.width_space, cameras.near)


class _Project(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, points: Tensor, weights: Tensor, matrices: Tensor) -> Tensor:
        ctx.save_for_backward(points, weights, matrices)
        return torch.from_numpy(_ready_kernels().project(*(_array(t) for t in (points, weights, matrices))))

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, g_cubics: Tensor) -> tuple[Tensor | None, ...]:
        inputs = (_array(t) for t in ctx.saved_tensors)
        arrays = _ready_kernels().project_backward(*inputs, _array(g_cubics), ctx.needs_input_grad[2])
        return tuple(None if a is None else torch.from_numpy(a) for a in arrays)


def _array(tensor: Tensor) -> Any:
    return tensor.detach().contiguous().numpy()


Images = tuple[Float[Tensor, "V H W 3"], Float[Tensor, "V H W"], Float[Tensor, "V H W"]]


def rasterize(
    strokes: Strokes2D,
    size: tuple[int, int],
    background: Float[Tensor, "V1 H1 W1 3"],
    blur: float,
    strata: int,
    seed: int,
) -> Images:
    """Colour, alpha and depth by the CPU kernels; the background's first three axes may be 1.

    Raises:
        ValueError: a stroke with a value that cannot be drawn.
    """
    options = Options(strokes.width_space == "world", strokes.near, blur, strata, seed)
    tensors = (strokes.cubics, strokes.half_width, strokes.color, strokes.opacity, background)
    if torch.is_grad_enabled() and any(t.requires_grad for t in tensors):
        return cast(Images, _Rasterize.apply(*tensors, size, options))  # type: ignore[no-untyped-call]
    return _forward(tensors, size, options, save=False)[0]


def _forward(tensors: tuple[Tensor, ...], size: tuple[int, int], options: Options, save: bool) -> tuple[Images, Any]:
    module = _ready_kernels()
    *strokes, background = tensors
    arrays = [_array(t) for t in strokes]
    canvas = background.detach().contiguous().expand(len(tensors[0]), *size, 3).numpy()
    *images, state = module.forward(*arrays, canvas, *options, save)
    color, alpha, depth = (torch.from_numpy(a) for a in images)
    return (color, alpha, depth), state


def _ready_kernels() -> Any:
    module = kernels()
    assert module is not None
    module.set_threads(get_num_threads())
    return module


class _Rasterize(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> Images:
        *tensors, size, options = inputs
        ctx.set_materialize_grads(False)
        images, ctx.state = _forward(tuple(tensors), size, options, save=True)
        # The kernels' state points to the background: saved, a change of it before the backward is an error.
        ctx.save_for_backward(images[1], images[2], tensors[4])
        return images

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *upstream: Tensor | None) -> tuple[Tensor | None, ...]:
        alpha, depth, canvas = ctx.saved_tensors
        # Only the gradient of depth needs them.
        planes = [None, None] if upstream[2] is None else [alpha.numpy(), depth.numpy()]
        arrays = [None if g is None else _array(g) for g in upstream]
        *gradients, g_canvas = _ready_kernels().backward(ctx.state, *arrays, *planes, ctx.needs_input_grad[4])
        if g_canvas is not None:
            # Summed by numpy, whose sums do not depend on the number of threads.
            axes = tuple(k for k, n in enumerate(canvas.shape) if n == 1)
            total = g_canvas.sum(axis=axes, keepdims=True, dtype="float64") if axes else g_canvas
            g_canvas = torch.from_numpy(total.astype(g_canvas.dtype, copy=False))
        return (*(torch.from_numpy(g) for g in gradients), g_canvas, None, None)
