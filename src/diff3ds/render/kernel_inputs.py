"""What compiled kernels are given: curves, in space or projected, their appearance, and options."""

import math
from typing import NamedTuple

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.project import Strokes2D, half_widths, width_space
from diff3ds.render.options import Analytic, MonteCarlo
from diff3ds.sketch import Sketch

Images = tuple[Float[Tensor, "V H W 3"], Float[Tensor, "V H W"], Float[Tensor, "V H W"]]
# Homogeneous cubics in pixels, or what gives them: control points, weights, and the projections of the views.
Curves = tuple[Tensor] | tuple[Tensor, Tensor, Tensor]
# Half widths in pixels, a row for all views or one a view (`Strokes2D.half_width`), or with one axis the full widths of
# a sketch's strokes, in units of which `Options.width_scale` speaks; colours; opacities; the background, whose first
# three axes may be 1.
Appearance = tuple[Tensor, Tensor, Tensor, Tensor]


class Options(NamedTuple):
    """What the kernels need besides tensors: field by field `Options` of csrc/cpu/driver.h, and part of CUDA's `Job`.

    Attributes:
        world, orthographic, near: as of `Strokes2D`.
        blur: standard deviation of the filter, pixels.
        strata: samples per pixel and direction, 0 for analytic antialiasing.
        seed: of the samples.
        width_scale: half widths in pixels of a full width of 1, where full widths are given; else 1.
    """

    world: bool
    orthographic: bool
    near: float
    blur: float
    strata: int
    seed: int
    width_scale: float


class KernelInputs(NamedTuple):
    """One call of the kernels; `size` is (height, width), `chains` as of `Strokes2D`."""

    curves: Curves
    chains: Chains | None
    appearance: Appearance
    size: tuple[int, int]
    options: Options

    def tensors(self) -> tuple[Tensor, ...]:
        """The appearance, and then the curves."""
        return (*self.appearance, *self.curves)


def of_sketch(
    sketch: Sketch, cameras: Cameras, background: Float[Tensor, "V1 H1 W1 3"], antialiasing: Analytic | MonteCarlo
) -> KernelInputs:
    """Those of a sketch, projected by the kernels: a tenth faster than before them where images are tiny."""
    plain = sketch.width.ndim == 1 and sketch.width_space == "image"
    widths, scale = (sketch.width, cameras.size[0] / 2) if plain else (half_widths(sketch, cameras), 1.0)
    appearance = (widths, sketch.color, sketch.opacity, background)
    world = width_space(sketch, cameras) == "world"
    options = _options(antialiasing, (world, cameras.orthographic, cameras.near), scale)
    curves = (sketch.points, sketch.weights, cameras.projection)
    return KernelInputs(curves, sketch.chains, appearance, cameras.size, options)


def of_strokes(
    strokes: Strokes2D,
    size: tuple[int, int],
    background: Float[Tensor, "V1 H1 W1 3"],
    antialiasing: Analytic | MonteCarlo,
) -> KernelInputs:
    """Those of strokes that are projected already."""
    appearance = (strokes.half_width, strokes.color, strokes.opacity, background)
    how = strokes.width_space == "world", strokes.orthographic, strokes.near
    options = _options(antialiasing, how, 1.0)
    return KernelInputs((strokes.cubics,), strokes.chains, appearance, size, options)


def _options(antialiasing: Analytic | MonteCarlo, how: tuple[bool, bool, float], width_scale: float) -> Options:
    if isinstance(antialiasing, Analytic):
        return Options(*how, antialiasing.blur, strata=0, seed=0, width_scale=width_scale)
    strata, seed = math.isqrt(antialiasing.samples), antialiasing.seed()
    return Options(*how, blur=0.0, strata=strata, seed=seed, width_scale=width_scale)
