"""Drawing by kernels as an operator of `torch.library`: what torch.compile and torch.export put into their graphs.

Such an operator takes and gives nothing but tensors and numbers. So what the forward pass leaves for the backward pass
is not kept: that draws again.
"""

import math
from typing import Any, cast

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier.curves import elevate_homogeneous, homogeneous
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.project import Strokes2D, check_devices
from diff3ds.render.autograd import Upstream
from diff3ds.render.backends import Backend, choose_backend, drawing_device, kernel_dtype
from diff3ds.render.checks import Background, check_stroke_values
from diff3ds.render.kernel_inputs import Appearance, Curves, Images, KernelInputs, Options, of_sketch
from diff3ds.render.kernels import kernels_of
from diff3ds.render.options import Analytic, MonteCarlo
from diff3ds.sketch import Sketch, WidthSpace

TRANSFORMED = (
    "torch.func does not go through drawings in graphs: compile without it (autograd), or use it without compiling"
)


@torch.compiler.assume_constant_result  # type: ignore[untyped-decorator]
def kernels_for(device: str, dtype: torch.dtype, backend: Backend | None) -> str:
    """The backend that draws a compiled graph's sketches; empty if that is the reference, which is no operator."""
    place = torch.device(device)
    chosen = choose_backend(backend, place, dtype)
    return "" if chosen == "reference" or drawing_device(place) != place else chosen


def render(
    sketch: Sketch, cameras: Cameras, background: Background, antialiasing: Analytic | MonteCarlo, backend: str
) -> Images:
    """The images, by operations that a graph can hold.

    Raises:
        RuntimeError: samples of a generator, whose state a graph cannot hold.
    """
    if torch._C._are_functorch_transforms_active():
        raise RuntimeError(TRANSFORMED)
    check_devices(sketch, cameras)
    dtype = sketch.points.dtype
    drawn = sketch if kernel_dtype(dtype) == dtype else sketch.to(kernel_dtype(dtype))
    strata, seed, analytic = 0, torch.zeros((), dtype=torch.int64), Analytic()
    if isinstance(antialiasing, Analytic):
        analytic = antialiasing
    elif antialiasing.generator is not None:
        raise RuntimeError("compiled graphs draw their samples from torch's default generator: leave generator out")
    else:
        # By the graph, anew in each run: a number would be that of the first one for ever.
        strata, seed = math.isqrt(antialiasing.samples), torch.randint(0, 2**62, ())
    inputs = of_sketch(drawn, cameras, _canvas(background, drawn.color), analytic)
    chains = (None, None) if inputs.chains is None else (inputs.chains.stroke, inputs.chains.closed)
    options = inputs.options
    flags = [options.world, options.orthographic, options.differ_squares]
    numbers = [options.near, options.blur, options.width_scale]
    rest = (*chains, seed, list(inputs.size), flags, numbers, strata, backend)
    color, alpha, depth = draw(*inputs.appearance, *inputs.curves, *rest)
    return color.to(dtype), alpha.to(dtype), depth.to(dtype)


def _canvas(background: Background, color: Tensor) -> Float[Tensor, "V1 H1 W1 3"]:
    """The background with four axes; that it fits is checked where it is drawn."""
    canvas = torch.as_tensor(background, dtype=color.dtype, device=color.device)
    if canvas.ndim == 0 or canvas.shape[-1] == 1:
        canvas = canvas.reshape(*canvas.shape[:-1], 1).expand(*canvas.shape[:-1], 3)
    return canvas.reshape((1,) * (4 - canvas.ndim) + tuple(canvas.shape))


@torch.library.custom_op("diff3ds::draw", mutates_args=())
def draw(
    half_width: Tensor,
    color: Tensor,
    opacity: Tensor,
    background: Tensor,
    square: Tensor,
    points: Tensor,
    weights: Tensor,
    matrices: Tensor,
    stroke: Tensor | None,
    closed: Tensor | None,
    seed: Tensor,
    size: list[int],
    flags: list[bool],
    numbers: list[float],
    strata: int,
    backend: str,
) -> tuple[Tensor, Tensor, Tensor]:
    """Colour, alpha and depth of `KernelInputs`; `flags` and `numbers` are those of its options."""
    tensors = (half_width, color, opacity, background, square, points, weights, matrices)
    inputs = _inputs(tensors, stroke, closed, seed, size, flags, numbers, strata)
    try:
        images, _ = kernels_of(backend).forward(inputs, save=False)
    except ValueError:
        # The kernels only know that some value is bad; say which.
        check_stroke_values(_projected(inputs))
        raise
    return images


@draw.register_fake
def _(
    half_width: Tensor,
    color: Tensor,
    opacity: Tensor,
    background: Tensor,
    square: Tensor,
    points: Tensor,
    weights: Tensor,
    matrices: Tensor,
    stroke: Tensor | None,
    closed: Tensor | None,
    seed: Tensor,
    size: list[int],
    flags: list[bool],
    numbers: list[float],
    strata: int,
    backend: str,
) -> tuple[Tensor, Tensor, Tensor]:
    shape = (matrices.shape[0], *size)
    return color.new_empty(*shape, 3), color.new_empty(shape), color.new_empty(shape)


@torch.library.custom_op("diff3ds::draw_backward", mutates_args=())
def draw_backward(
    half_width: Tensor,
    color: Tensor,
    opacity: Tensor,
    background: Tensor,
    square: Tensor,
    points: Tensor,
    weights: Tensor,
    matrices: Tensor,
    stroke: Tensor | None,
    closed: Tensor | None,
    seed: Tensor,
    size: list[int],
    flags: list[bool],
    numbers: list[float],
    strata: int,
    backend: str,
    upstream: list[Tensor],
    needs: list[bool],
) -> list[Tensor]:
    """Gradients of the eight tensors from those of the images; zeros for those that are not needed."""
    tensors = (half_width, color, opacity, background, square, points, weights, matrices)
    kernels = kernels_of(backend)
    inputs = _inputs(tensors, stroke, closed, seed, size, flags, numbers, strata)
    (_, alpha, depth), saved = kernels.forward(inputs, save=True)
    gradients = kernels.backward(saved, cast(Upstream, tuple(upstream)), (alpha, depth), background, tuple(needs))
    return [torch.zeros_like(t) if g is None else g for g, t in zip(gradients, tensors, strict=True)]


@draw_backward.register_fake
def _(
    half_width: Tensor,
    color: Tensor,
    opacity: Tensor,
    background: Tensor,
    square: Tensor,
    points: Tensor,
    weights: Tensor,
    matrices: Tensor,
    *rest: object,
) -> list[Tensor]:
    return [torch.empty_like(t) for t in (half_width, color, opacity, background, square, points, weights, matrices)]


def _remember(ctx: Any, inputs: tuple[Any, ...], output: object) -> None:
    *tensors, size, flags, numbers, strata, backend = inputs
    ctx.save_for_backward(*tensors)
    ctx.rest = (size, flags, numbers, strata, backend)


def _gradients(ctx: Any, *upstream: Tensor) -> tuple[Tensor | None, ...]:
    needs = list(ctx.needs_input_grad[:8])
    found = draw_backward(*ctx.saved_tensors, *ctx.rest, list(upstream), needs)
    return *(g if needed else None for g, needed in zip(found, needs, strict=True)), *[None] * 8


draw.register_autograd(_gradients, setup_context=_remember)


def _inputs(
    tensors: tuple[Tensor, ...],
    stroke: Tensor | None,
    closed: Tensor | None,
    seed: Tensor,
    size: list[int],
    flags: list[bool],
    numbers: list[float],
    strata: int,
) -> KernelInputs:
    chains = None if stroke is None or closed is None else Chains(stroke, closed)
    (world, orthographic, differ_squares), (near, blur, width_scale) = flags, numbers
    options = Options(world, orthographic, near, blur, strata, int(seed), width_scale, differ_squares)
    appearance, curves = cast(Appearance, tensors[:5]), cast(Curves, tensors[5:])
    return KernelInputs(curves, None, chains, None, appearance, cast(tuple[int, int], tuple(size)), options)


def _projected(inputs: KernelInputs) -> Strokes2D:
    """The strokes as every view sees them."""
    points, weights, matrices = cast(tuple[Tensor, Tensor, Tensor], inputs.curves)
    control = elevate_homogeneous(homogeneous(points.double(), weights.double()))
    widths, color, opacity, *_ = inputs.appearance
    half = widths[None] * inputs.options.width_scale if widths.ndim == 1 else widths
    space: WidthSpace = "world" if inputs.options.world else "image"
    near, orthographic = inputs.options.near, inputs.options.orthographic
    return Strokes2D(control @ matrices[:, None].mT, half, color, opacity, space, near, orthographic, inputs.chains)
