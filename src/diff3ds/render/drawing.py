"""What compiled kernels are given: curves, in space or projected, looks, and options."""

from typing import NamedTuple

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.project import Strokes2D, half_widths
from diff3ds.sketch import Sketch

Images = tuple[Float[Tensor, "V H W 3"], Float[Tensor, "V H W"], Float[Tensor, "V H W"]]
# Homogeneous cubics in pixels, or what gives them: control points, weights, and the projections of the views.
Curves = tuple[Tensor] | tuple[Tensor, Tensor, Tensor]
# Half widths in pixels, a row for all views or one a view (`Strokes2D.half_width`), or with one axis the full widths of
# a sketch, in units of which `Options.width_scale` speaks; colours; opacities; the background, whose first three axes
# may be 1.
Looks = tuple[Tensor, Tensor, Tensor, Tensor]


class Options(NamedTuple):
    """What the kernels need besides tensors.

    Attributes:
        world, near: as of `Strokes2D`.
        blur: standard deviation of the filter, pixels.
        strata: samples per pixel and direction, 0 for analytic antialiasing.
        seed: of the samples.
        width_scale: half widths in pixels of a full width of 1, where full widths are given; else 1.
    """

    world: bool
    near: float
    blur: float
    strata: int
    seed: int
    width_scale: float


class Drawing(NamedTuple):
    """One call of the kernels; `size` is (height, width)."""

    curves: Curves
    looks: Looks
    size: tuple[int, int]
    options: Options

    def tensors(self) -> tuple[Tensor, ...]:
        """The looks, and then the curves."""
        return (*self.looks, *self.curves)


def of_sketch(
    sketch: Sketch, cameras: Cameras, background: Float[Tensor, "V1 H1 W1 3"], blur: float, strata: int, seed: int
) -> Drawing:
    """The drawing of a sketch, projected by the kernels: a tenth faster than before them where images are tiny."""
    world = sketch.width_space == "world"
    widths, scale = (half_widths(sketch, cameras), 1.0) if world else (sketch.width, cameras.size[0] / 2)
    looks = (widths, sketch.color, sketch.opacity, background)
    options = Options(world, cameras.near, blur, strata, seed, scale)
    return Drawing((sketch.points, sketch.weights, cameras.projection), looks, cameras.size, options)


def of_strokes(
    strokes: Strokes2D,
    size: tuple[int, int],
    background: Float[Tensor, "V1 H1 W1 3"],
    blur: float,
    strata: int,
    seed: int,
) -> Drawing:
    """The drawing of strokes that are projected already."""
    options = Options(strokes.width_space == "world", strokes.near, blur, strata, seed, 1.0)
    return Drawing((strokes.cubics,), (strokes.half_width, strokes.color, strokes.opacity, background), size, options)
