"""Drawing by kernels as an operator of `torch.library`: what torch.compile and torch.export put into their graphs.

Such an operator takes and gives nothing but tensors and numbers. So what the forward pass leaves for the backward pass
is not kept: that draws again.
"""

import math
from typing import Any, NamedTuple, cast, get_type_hints

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier.curves import elevate_homogeneous, homogeneous
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.project import Strokes2D, check_devices
from diff3ds.render.antialiasing import Analytic, MonteCarlo
from diff3ds.render.autograd import Upstream
from diff3ds.render.backends import Backend, choose_backend, drawing_device, kernel_dtype
from diff3ds.render.checks import Background, check_stroke_values
from diff3ds.render.kernel_inputs import Images, KernelInputs, Options, of_sketch
from diff3ds.render.kernels import kernels_of
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
    color, alpha, depth = draw(
        *inputs.appearance,
        *inputs.curves,
        *chains,
        seed,
        list(inputs.size),
        world=options.world,
        orthographic=options.orthographic,
        differ_squares=options.differ_squares,
        near=options.near,
        blur=options.blur,
        width_scale=options.width_scale,
        strata=strata,
        backend=backend,
    )
    return color.to(dtype), alpha.to(dtype), depth.to(dtype)


def _canvas(background: Background, color: Tensor) -> Float[Tensor, "V1 H1 W1 3"]:
    """The background with four axes; that it fits is checked where it is drawn."""
    canvas = torch.as_tensor(background, dtype=color.dtype, device=color.device)
    if canvas.ndim == 0 or canvas.shape[-1] == 1:
        canvas = canvas.reshape(*canvas.shape[:-1], 1).expand(*canvas.shape[:-1], 3)
    return canvas.reshape((1,) * (4 - canvas.ndim) + tuple(canvas.shape))


class Given(NamedTuple):
    """What the operator is given: `KernelInputs` and its options, as a graph holds them. The seed is a tensor there."""

    half_width: Tensor
    color: Tensor
    opacity: Tensor
    background: Tensor
    square: Tensor
    points: Tensor
    weights: Tensor
    matrices: Tensor
    stroke: Tensor | None
    closed: Tensor | None
    seed: Tensor
    size: list[int]
    world: bool
    orthographic: bool
    differ_squares: bool
    near: float
    blur: float
    width_scale: float
    strata: int
    backend: str

    @property
    def inputs(self) -> KernelInputs:
        """What kernels are given."""
        chains = None if self.stroke is None or self.closed is None else Chains(self.stroke, self.closed)
        seed, square = int(self.seed), self.differ_squares
        options = Options(
            self.world, self.orthographic, self.near, self.blur, self.strata, seed, self.width_scale, square
        )
        appearance = (self.half_width, self.color, self.opacity, self.background, self.square)
        curves = (self.points, self.weights, self.matrices)
        return KernelInputs(curves, None, chains, None, appearance, (self.size[0], self.size[1]), options)


# What the fields are called in the language of torch's schemas.
KINDS = {
    Tensor: "Tensor",
    Tensor | None: "Tensor?",
    list[int]: "SymInt[]",
    bool: "bool",
    float: "float",
    int: "SymInt",
    str: "str",
}
FIELDS = ", ".join(f"{KINDS[kind]} {name}" for name, kind in get_type_hints(Given).items())
# How many fields have gradients, and how many are tensors: these are the first.
DIFFERENTIABLE = Given._fields.index("stroke")
TENSORS = Given._fields.index("size")


@torch.library.custom_op("diff3ds::draw", mutates_args=(), schema=f"({FIELDS}) -> (Tensor, Tensor, Tensor)")
def draw(*given: Any) -> tuple[Tensor, Tensor, Tensor]:
    """Colour, alpha and depth of what is `Given`."""
    one = Given(*given)
    try:
        images, _ = kernels_of(one.backend).forward(one.inputs, save=False)
    except ValueError:
        # The kernels only know that some value is bad; say which.
        check_stroke_values(_projected(one.inputs))
        raise
    return images


@draw.register_fake
def _(*given: Any) -> tuple[Tensor, Tensor, Tensor]:
    one = Given(*given)
    shape = (one.matrices.shape[0], *one.size)
    return one.color.new_empty(*shape, 3), one.color.new_empty(shape), one.color.new_empty(shape)


@torch.library.custom_op(
    "diff3ds::draw_backward", mutates_args=(), schema=f"({FIELDS}, Tensor[] upstream, bool[] needs) -> Tensor[]"
)
def draw_backward(*given: Any) -> list[Tensor]:
    """Gradients of what is differentiable from those of the images; zeros for those that are not needed."""
    *first, upstream, needs = given
    one = Given(*first)
    kernels = kernels_of(one.backend)
    (_, alpha, depth), saved = kernels.forward(one.inputs, save=True)
    gradients = kernels.backward(saved, cast(Upstream, tuple(upstream)), (alpha, depth), one.background, tuple(needs))
    return [torch.zeros_like(t) if g is None else g for g, t in zip(gradients, given[:DIFFERENTIABLE], strict=True)]


@draw_backward.register_fake
def _(*given: Any) -> list[Tensor]:
    return [torch.empty_like(tensor) for tensor in given[:DIFFERENTIABLE]]


def _remember(ctx: Any, inputs: tuple[Any, ...], output: object) -> None:
    ctx.save_for_backward(*inputs[:TENSORS])
    ctx.rest = inputs[TENSORS:]


def _gradients(ctx: Any, *upstream: Tensor) -> tuple[Tensor | None, ...]:
    needs = list(ctx.needs_input_grad[:DIFFERENTIABLE])
    found = draw_backward(*ctx.saved_tensors, *ctx.rest, list(upstream), needs)
    rest = [None] * (len(Given._fields) - DIFFERENTIABLE)
    return *(g if needed else None for g, needed in zip(found, needs, strict=True)), *rest


draw.register_autograd(_gradients, setup_context=_remember)


def _projected(inputs: KernelInputs) -> Strokes2D:
    """The strokes as every view sees them."""
    points, weights, matrices = cast(tuple[Tensor, Tensor, Tensor], inputs.curves)
    control = elevate_homogeneous(homogeneous(points.double(), weights.double()))
    widths, color, opacity, *_ = inputs.appearance
    half = widths[None] * inputs.options.width_scale if widths.ndim == 1 else widths
    space: WidthSpace = "world" if inputs.options.world else "image"
    near, orthographic = inputs.options.near, inputs.options.orthographic
    return Strokes2D(control @ matrices[:, None].mT, half, color, opacity, space, near, orthographic, inputs.chains)
