"""What is drawn: DiffVG's classes of shapes, groups and colours, which hold the tensors of their users."""

from enum import IntEnum

import torch

from diff3ds._shapes import Tensor


def _one() -> Tensor:
    """The half width of shapes that say none: a tensor of their own, for users make them leaves."""
    return torch.tensor(1.0)


class Path:
    """Lines and Bézier curves, one after the other.

    Args:
        num_control_points: of each segment (S,), between its ends: 0 for a line, 1 for a quadratic, 2 for a cubic.
        points: ends and control points in their order, (P, 2); a closed path does not repeat its first point.
        stroke_width: *half* the width of its stroke, one value or one for each point; 0 draws nothing.
        id: a name, written to SVG files.
        use_distance_approx: has no effect; strokes are exact.
    """

    def __init__(
        self,
        num_control_points: Tensor,
        points: Tensor,
        is_closed: bool,
        stroke_width: Tensor | None = None,
        id: str = "",
        use_distance_approx: bool = False,
    ) -> None:
        self.num_control_points = num_control_points
        self.points = points
        self.is_closed = is_closed
        self.stroke_width = _one() if stroke_width is None else stroke_width
        self.id = id
        self.use_distance_approx = use_distance_approx


class Polygon:
    """Lines through `points` (P, 2); closed or not."""

    def __init__(
        self,
        points: Tensor,
        is_closed: bool,
        stroke_width: Tensor | None = None,
        id: str = "",
    ) -> None:
        self.points = points
        self.is_closed = is_closed
        self.stroke_width = _one() if stroke_width is None else stroke_width
        self.id = id


class Circle:
    """A circle with one `radius` and a `center` (2,)."""

    def __init__(
        self,
        radius: Tensor,
        center: Tensor,
        stroke_width: Tensor | None = None,
        id: str = "",
    ) -> None:
        self.radius = radius
        self.center = center
        self.stroke_width = _one() if stroke_width is None else stroke_width
        self.id = id


class Ellipse:
    """An ellipse with a `radius` (2,) along x and y and a `center` (2,)."""

    def __init__(
        self,
        radius: Tensor,
        center: Tensor,
        stroke_width: Tensor | None = None,
        id: str = "",
    ) -> None:
        self.radius = radius
        self.center = center
        self.stroke_width = _one() if stroke_width is None else stroke_width
        self.id = id


class Rect:
    """A rectangle between the corners `p_min` and `p_max`, (2,) each."""

    def __init__(
        self,
        p_min: Tensor,
        p_max: Tensor,
        stroke_width: Tensor | None = None,
        id: str = "",
    ) -> None:
        self.p_min = p_min
        self.p_max = p_max
        self.stroke_width = _one() if stroke_width is None else stroke_width
        self.id = id


class LinearGradient:
    """Colours that change from `begin` to `end`, (2,) each, on the canvas: `stop_colors` (M, 4) at `offsets` (M,)."""

    def __init__(
        self,
        begin: Tensor | None = None,
        end: Tensor | None = None,
        offsets: Tensor | None = None,
        stop_colors: Tensor | None = None,
    ) -> None:
        self.begin = torch.zeros(2) if begin is None else begin
        self.end = torch.zeros(2) if end is None else end
        self.offsets = torch.zeros(1) if offsets is None else offsets
        self.stop_colors = torch.zeros(1, 4) if stop_colors is None else stop_colors


class RadialGradient:
    """Colours that change from `center` (2,) outwards, the last at `radius` (2,) along x and y; on the canvas."""

    def __init__(
        self,
        center: Tensor | None = None,
        radius: Tensor | None = None,
        offsets: Tensor | None = None,
        stop_colors: Tensor | None = None,
    ) -> None:
        self.center = torch.zeros(2) if center is None else center
        self.radius = torch.zeros(2) if radius is None else radius
        self.offsets = torch.zeros(1) if offsets is None else offsets
        self.stop_colors = torch.zeros(1, 4) if stop_colors is None else stop_colors


Color = Tensor | LinearGradient | RadialGradient


class ShapeGroup:
    """Shapes that are painted as one: their union, first its stroke, then its filling, each once with its alpha.

    Args:
        shape_ids: places of the shapes in the list of all.
        fill_color: RGBA (4,), a gradient of colours, or None for no filling.
        use_even_odd_rule: what is filled where outlines overlap: where an odd number of them lies, or (False) where
            their windings do not cancel.
        stroke_color: as `fill_color`.
        shape_to_canvas: affine (3, 3), from the shapes' coordinates to the canvas; widths of strokes go with it.
        id: a name, written to SVG files.
    """

    def __init__(
        self,
        shape_ids: Tensor,
        fill_color: Color | None,
        use_even_odd_rule: bool = True,
        stroke_color: Color | None = None,
        shape_to_canvas: Tensor | None = None,
        id: str = "",
    ) -> None:
        self.shape_ids = shape_ids
        self.fill_color = fill_color
        self.use_even_odd_rule = use_even_odd_rule
        self.stroke_color = stroke_color
        self.shape_to_canvas = torch.eye(3) if shape_to_canvas is None else shape_to_canvas
        self.id = id


class FilterType(IntEnum):
    """By what samples are weighed around a pixel; `box` is drawn."""

    box = 0
    tent = 1
    parabolic = 2
    hann = 3


class PixelFilter:
    """By what samples are weighed; a box of radius .5, which is a pixel's area, is drawn."""

    def __init__(self, type: FilterType, radius: Tensor | None = None) -> None:
        self.type = type
        self.radius = torch.tensor(0.5) if radius is None else radius


class OutputType(IntEnum):
    """What is drawn: `color`; `sdf`, signed distances, is refused."""

    color = 1
    sdf = 2
