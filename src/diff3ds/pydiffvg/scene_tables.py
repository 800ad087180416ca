"""Shapes and groups as tables: their integers in numpy, their tensors by reference, so that a step costs little."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch

from diff3ds._checks import kind
from diff3ds._shapes import Index, Tensor
from diff3ds.pydiffvg.scene_classes import (
    Circle,
    Color,
    Ellipse,
    LinearGradient,
    Path,
    Polygon,
    RadialGradient,
    Rect,
    ShapeGroup,
)
from diff3ds.render.areas import EVEN_ODD, NONZERO, STROKE

# Cubics of a round outline: of a circle they are off by 4e-6 of its radius.
ARCS = 8


class Outlines(NamedTuple):
    """The shapes of a scene, with points of paths and polygons first, then those of round shapes and rectangles."""

    points: list[Tensor]  # of paths and polygons, (n, 2) each
    radii: list[Tensor]  # of circles () or (1,), of ellipses (2,)
    centers: list[Tensor]
    corners: list[Tensor]  # p_min and p_max of each rectangle
    widths: list[Tensor]
    width_of_point: Index  # where in the joined widths that of each point is
    shape_of_point: Index
    inner: Index  # of each segment, control points between its ends
    contours: Index  # of each shape in the order of their list, (N, 5), as `Layers` has it


class Paint(NamedTuple):
    """What a layer is painted with: the stroke or the filling of a group."""

    group: int
    name: str
    color: Color


@dataclass(frozen=True)
class Scene:
    """What `serialize_scene` has read. The values of tensors are read when they are drawn."""

    canvas: tuple[float, float]
    outlines: Outlines
    contours: Index
    layers: Index
    paints: list[Paint]
    transforms: list[Tensor]


class _Lines(NamedTuple):
    """Of shapes of one kind: points that they have, segments, their inner points, and which are closed."""

    given: list[int]
    segments: list[int]
    inner: Index
    closed: list[bool]


def read_scene(canvas: tuple[float, float], shapes: Sequence[Any], groups: Sequence[Any]) -> Scene:
    """The tables of a scene.

    Raises:
        TypeError: what is no shape, no group, no tensor or no colour.
        ValueError: wrong numbers of points, widths or colours, and groups of shapes that are not there.
    """
    outlines = _outlines(shapes)
    used, owner = _used_shapes(groups, len(shapes))
    # What has no segment has no area and no stroke.
    drawn = outlines.contours[used, 3] > 0
    counts = np.bincount(owner[drawn], minlength=len(groups))
    first = np.cumsum(counts) - counts
    rows: list[tuple[int, ...]] = []
    paints: list[Paint] = []
    for place, group in enumerate(groups):
        filled = EVEN_ODD if group.use_even_odd_rule else NONZERO
        # DiffVG paints the filling over the inner half of the stroke.
        for name, color, rule in (("stroke", group.stroke_color, STROKE), ("fill", group.fill_color, filled)):
            if color is not None and counts[place]:
                _check_color(f"{name}_color of group {place}", color)
                rows.append((first[place], counts[place], rule, place, len(paints)))
                paints.append(Paint(place, name, color))
    layers = np.array(rows, dtype=np.int64).reshape(-1, 5)
    transforms = [
        _shaped(f"shape_to_canvas of group {k}", each.shape_to_canvas, (3, 3)) for k, each in enumerate(groups)
    ]
    return Scene(canvas, outlines, outlines.contours[used[drawn]], layers, paints, transforms)


def joined(tensors: Sequence[Tensor], join: Callable[[Any], Tensor], device: torch.device) -> Tensor:
    """Tensors as one on a device, wherever they are."""
    if len({each.device for each in tensors}) > 1:
        tensors = [each.to(device) for each in tensors]
    return join(tensors).to(device)


def flat(tensor: Tensor) -> Tensor:
    """The values of a tensor in one row."""
    return tensor if tensor.ndim == 1 else tensor.reshape(-1)  # a call that does nothing still takes a microsecond


def _outlines(shapes: Sequence[Any]) -> Outlines:
    kinds: dict[type, dict[int, Any]] = {Path: {}, Polygon: {}, Circle: {}, Ellipse: {}, Rect: {}}
    for place, shape in enumerate(shapes):
        found = next((each for each in kinds if isinstance(shape, each)), None)
        if found is None:
            known = ", ".join(each.__name__ for each in kinds)
            raise TypeError(f"shape {place} must be one of {known}, got {kind(shape)}")
        kinds[found][place] = shape
    paths, polygons, circles, ellipses, rects = kinds.values()
    lines, rounds = {**paths, **polygons}, {**circles, **ellipses}
    for place, shape in lines.items():
        if not isinstance(shape.points, Tensor) or shape.points.ndim != 2 or shape.points.shape[1] != 2:
            raise ValueError(f"points of shape {place} must be a tensor (P, 2), got {_told(shape.points)}")
    tables = [_of_paths(paths), _of_polygons(polygons.values()), _alike(len(rounds), ARCS, 2), _alike(len(rects), 4, 0)]
    places = np.array([*lines, *rounds, *rects], dtype=np.int64)
    contours, counts = _contours(tables, places)
    widths, width_of_point = _widths([shapes[place] for place in places], places, counts)
    radii = [_shaped(f"radius of shape {k}", each.radius, (2,) if k in ellipses else ()) for k, each in rounds.items()]
    corners = [(k, name, getattr(each, name)) for k, each in rects.items() for name in ("p_min", "p_max")]
    return Outlines(
        points=[shape.points for shape in lines.values()],
        radii=radii,
        centers=[_shaped(f"center of shape {k}", each.center, (2,)) for k, each in rounds.items()],
        corners=[_shaped(f"{name} of shape {k}", corner, (2,)) for k, name, corner in corners],
        widths=widths,
        width_of_point=width_of_point,
        shape_of_point=np.repeat(places, counts),
        inner=np.concatenate([each.inner for each in tables]),
        contours=contours,
    )  # fmt: skip


def _of_paths(paths: dict[int, Path]) -> _Lines:
    for place, path in paths.items():
        if not isinstance(path.num_control_points, Tensor) or path.num_control_points.ndim != 1:
            got = _told(path.num_control_points)
            raise ValueError(f"num_control_points of shape {place} must be a tensor (S,), got {got}")
    inner = _whole_numbers([path.num_control_points for path in paths.values()])
    segments = [path.num_control_points.shape[0] for path in paths.values()]
    wrong = np.flatnonzero(~np.isin(inner, (0, 1, 2)))
    if len(wrong):
        place = np.repeat(list(paths), segments)[wrong[0]]
        raise ValueError(f"num_control_points of shape {place} must be 0, 1 or 2 each, got {inner[wrong[0]]:g}")
    points = [path.points.shape[0] for path in paths.values()]
    return _Lines(points, segments, inner.astype(np.int64), [bool(path.is_closed) for path in paths.values()])


def _of_polygons(polygons: Iterable[Polygon]) -> _Lines:
    points, closed = [each.points.shape[0] for each in polygons], [bool(each.is_closed) for each in polygons]
    segments = [max(n - (not whole), 0) for n, whole in zip(points, closed, strict=True)]
    return _Lines(points, segments, np.zeros(sum(segments), dtype=np.int64), closed)


def _alike(count: int, segments: int, inner: int) -> _Lines:
    """Closed shapes of so many segments each."""
    points = segments * (inner + 1)
    return _Lines([points] * count, [segments] * count, np.full(count * segments, inner, np.int64), [True] * count)


def _contours(tables: list[_Lines], places: Index) -> tuple[Index, Index]:
    """The contours of all shapes, (N, 5), and how many points each kind's shapes have, one after the other."""
    given = np.array([n for each in tables for n in each.given], dtype=np.int64)
    segments = np.array([n for each in tables for n in each.segments], dtype=np.int64)
    closed = np.array([n for each in tables for n in each.closed], dtype=bool)
    steps = np.concatenate([each.inner for each in tables]) + 1
    needed = np.bincount(np.repeat(np.arange(len(places)), segments), steps, len(places)).astype(np.int64) + ~closed
    for k in np.flatnonzero((given < needed) & (segments > 0))[:1]:
        raise ValueError(
            f"shape {places[k]} has {given[k]} points, but its num_control_points ask for {needed[k]}"
            f"{'' if closed[k] else ', its end among them, for it is not closed'}"
        )
    # A closed path may say its first point again at its end.
    repeated = closed & (given > needed)
    contours = np.empty((len(places), 5), dtype=np.int64)
    columns = (
        np.cumsum(given) - given,
        needed + repeated,
        np.cumsum(segments) - segments,
        segments,
        closed & ~repeated,
    )
    contours[places] = np.stack(columns, 1)
    return contours, given


def _widths(shapes: list[Any], places: Index, points: Index) -> tuple[list[Tensor], Index]:
    """Half widths of shapes, and where in them, joined, that of each point is."""
    widths = [shape.stroke_width for shape in shapes]
    for place, width in zip(places, widths, strict=True):
        if not isinstance(width, Tensor):
            raise TypeError(f"stroke_width of shape {place} must be a tensor, got {kind(width)}")
    counts = np.array([width.numel() for width in widths], dtype=np.int64)
    for k in np.flatnonzero((counts != 1) & (counts != points))[:1]:
        raise ValueError(
            f"stroke_width of shape {places[k]} must be one, or one for each of its {points[k]} points, got {counts[k]}"
        )
    within = np.arange(points.sum()) - np.repeat(np.cumsum(points) - points, points)
    return widths, np.repeat(np.cumsum(counts) - counts, points) + within * np.repeat(counts > 1, points)


def _used_shapes(groups: Sequence[Any], shapes: int) -> tuple[Index, Index]:
    """The shapes of all groups, and which group each belongs to.

    Raises:
        TypeError, ValueError: ids that are no tensor, no whole numbers, or not those of shapes.
    """
    for place, group in enumerate(groups):
        if not isinstance(group, ShapeGroup):
            raise TypeError(f"group {place} must be a ShapeGroup, got {kind(group)}")
        if not isinstance(group.shape_ids, Tensor):
            raise TypeError(f"shape_ids of group {place} must be a tensor, got {kind(group.shape_ids)}")
    ids = _whole_numbers([group.shape_ids for group in groups])
    owner = np.repeat(np.arange(len(groups)), [group.shape_ids.numel() for group in groups])
    for k in np.flatnonzero((ids < 0) | (ids >= shapes) | (ids != np.floor(ids)))[:1]:
        raise ValueError(f"shape_ids of group {owner[k]} must be places in the list of {shapes} shapes, got {ids[k]:g}")
    return ids.astype(np.int64), owner


def _whole_numbers(tensors: Sequence[Tensor]) -> Any:
    """The values of tensors, flat, one after the other."""
    if not tensors:
        return np.zeros(0, dtype=np.int64)
    return joined([flat(each) for each in tensors], torch.cat, torch.device("cpu")).detach().numpy()


def _shaped(name: str, value: Any, shape: tuple[int, ...]) -> Tensor:
    """A tensor that has this shape; one value may have the shape (1,) as well.

    Raises:
        ValueError: another one.
    """
    if not isinstance(value, Tensor) or (value.shape != shape and (shape or value.shape != (1,))):
        raise ValueError(f"{name} must be a tensor of shape {shape}, got {_told(value)}")
    return value


def _told(value: object) -> str:
    return f"shape {tuple(value.shape)}" if isinstance(value, Tensor) else kind(value)


def _check_color(name: str, color: Any) -> None:
    """Checks the shapes of a colour's tensors."""
    if isinstance(color, Tensor):
        _shaped(name, color, (4,))
        return
    if not isinstance(color, LinearGradient | RadialGradient):
        raise TypeError(f"{name} must be RGBA, a LinearGradient, a RadialGradient or None, got {kind(color)}")
    for part in ("begin", "end") if isinstance(color, LinearGradient) else ("center", "radius"):
        _shaped(f"{part} of the {name}", getattr(color, part), (2,))
    offsets = color.offsets
    if not (isinstance(offsets, Tensor) and offsets.ndim == 1 and offsets.shape[0]):
        raise ValueError(f"offsets of the {name} must be a tensor (M,) of one stop or more, got {_told(offsets)}")
    _shaped(f"stop_colors of the {name}", color.stop_colors, (offsets.shape[0], 4))
