"""What is drawn: DiffVG's classes of shapes, groups and colours, which hold the tensors of their users."""

from dataclasses import dataclass, field
from enum import IntEnum

import torch

from diff3ds._shapes import Tensor


def _one() -> Tensor:
    """The half width of shapes that say none: a tensor of their own, for users make them leaves."""
    return torch.tensor(1.0)


@dataclass(eq=False, repr=False)
class Path:
    """Lines and Bézier curves, one after the other.

    Attributes:
        num_control_points: of each segment (S,), between its ends: 0 for a line, 1 for a quadratic, 2 for a cubic.
        points: ends and control points in their order, (P, 2); a closed path does not repeat its first point.
        stroke_width: *half* the width of its stroke, one value or one for each point; 0 draws nothing.
        id: a name, written to SVG files.
        use_distance_approx: has no effect; strokes are exact.
    """

    num_control_points: Tensor
    points: Tensor
    is_closed: bool
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""
    use_distance_approx: bool = False


@dataclass(eq=False, repr=False)
class Polygon:
    """Lines through `points` (P, 2); closed or not."""

    points: Tensor
    is_closed: bool
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False, repr=False)
class Circle:
    """A circle with one `radius` and a `center` (2,)."""

    radius: Tensor
    center: Tensor
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False, repr=False)
class Ellipse:
    """An ellipse with a `radius` (2,) along x and y and a `center` (2,)."""

    radius: Tensor
    center: Tensor
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False, repr=False)
class Rect:
    """A rectangle between the corners `p_min` and `p_max`, (2,) each."""

    p_min: Tensor
    p_max: Tensor
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False, repr=False)
class LinearGradient:
    """Colours that change from `begin` to `end`, (2,) each, on the canvas: `stop_colors` (M, 4) at `offsets` (M,)."""

    begin: Tensor = field(default_factory=lambda: torch.zeros(2))
    end: Tensor = field(default_factory=lambda: torch.zeros(2))
    offsets: Tensor = field(default_factory=lambda: torch.zeros(1))
    stop_colors: Tensor = field(default_factory=lambda: torch.zeros(1, 4))


@dataclass(eq=False, repr=False)
class RadialGradient:
    """Colours that change from `center` (2,) outwards, the last at `radius` (2,) along x and y; on the canvas."""

    center: Tensor = field(default_factory=lambda: torch.zeros(2))
    radius: Tensor = field(default_factory=lambda: torch.zeros(2))
    offsets: Tensor = field(default_factory=lambda: torch.zeros(1))
    stop_colors: Tensor = field(default_factory=lambda: torch.zeros(1, 4))


Color = Tensor | LinearGradient | RadialGradient


@dataclass(eq=False, repr=False)
class ShapeGroup:
    """Shapes that are painted as one: their union, first its stroke, then its filling, each once with its alpha.

    Attributes:
        shape_ids: places of the shapes in the list of all.
        fill_color: RGBA (4,), a gradient of colours, or None for no filling.
        use_even_odd_rule: what is filled where outlines overlap: where an odd number of them lies, or (False) where
            their windings do not cancel.
        stroke_color: as `fill_color`.
        shape_to_canvas: affine (3, 3), from the shapes' coordinates to the canvas; widths of strokes go with it.
        id: a name, written to SVG files.
    """

    shape_ids: Tensor
    fill_color: Color | None
    use_even_odd_rule: bool = True
    stroke_color: Color | None = None
    shape_to_canvas: Tensor = field(default_factory=lambda: torch.eye(3))
    id: str = ""


class FilterType(IntEnum):
    """By what samples are weighed around a pixel; `box` is drawn."""

    box = 0
    tent = 1
    parabolic = 2
    hann = 3


@dataclass(eq=False, repr=False)
class PixelFilter:
    """By what samples are weighed; a box of radius .5, which is a pixel's area, is drawn."""

    type: FilterType
    radius: Tensor = field(default_factory=lambda: torch.tensor(0.5))


class OutputType(IntEnum):
    """What is drawn: `color`; `sdf`, signed distances, is refused."""

    color = 1
    sdf = 2
