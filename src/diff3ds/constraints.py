"""What the strokes of a fit must keep to: functions from a sketch to one that obeys, applied after every step.

`FitConfig.constraints` takes any number of them, applied in order; gradients pass through. Strokes are named by their
indices in the sketch that the fit began with, so constraints and refinements that drop strokes exclude each other.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import torch

from diff3ds._checks import as_numbers
from diff3ds._shapes import Int, Tensor
from diff3ds.curves.directions import turns
from diff3ds.sketch import Sketch

Constraint = Callable[[Sketch], Sketch]

# Radians; rounding turns a smooth joint less, and an eye sees no more.
SMOOTH = 1e-2


def fixed(sketch: Sketch, strokes: Sequence[int] | Int[Tensor, " S"]) -> Constraint:
    """These strokes stay what they are in this sketch, with their widths, colours and opacities.

    Raises:
        IndexError: a stroke that the sketch does not have.
    """
    rows = _rows(sketch, strokes)
    segments = _segments(sketch, rows)
    kept = {name: value.detach() for name, value in sketch.tensors().items()}

    def hold(moved: Sketch) -> Sketch:
        tensors = {}
        for name, value in moved.tensors().items():
            place = segments if name in moved.segment_fields else rows
            tensors[name] = value.index_copy(0, place, kept[name][place].to(value))
        return moved.replace(**tensors)

    return hold


def on_plane(
    sketch: Sketch,
    strokes: Sequence[int] | Int[Tensor, " S"],
    normal: Sequence[float] | Tensor,
    offset: float = 0.0,
) -> Constraint:
    """Control points of these strokes lie on the plane normal . x = offset |normal|: they are projected onto it.

    Raises:
        IndexError: a stroke that the sketch does not have.
        ValueError: a normal without a length, or not of three numbers.
    """
    segments, direction = _segments(sketch, _rows(sketch, strokes)), _unit(normal)

    def flatten(moved: Sketch) -> Sketch:
        n = direction.to(moved.points)
        some = moved.points[segments]
        some = some - ((some @ n) - offset)[..., None] * n
        return replace(moved, points=moved.points.index_copy(0, segments, some))

    return flatten


def mirrored(
    sketch: Sketch,
    originals: Sequence[int] | Int[Tensor, " S"],
    images: Sequence[int] | Int[Tensor, " S"],
    normal: Sequence[float] | Tensor,
    offset: float = 0.0,
) -> Constraint:
    """Each image is the original, reflected at the plane normal . x = offset |normal|, in the same order.

    Images take over weights, widths, colours and opacities. Gradients of both go to the original.

    Raises:
        IndexError: a stroke that the sketch does not have.
        ValueError: other numbers of images than of originals, a stroke that is both, or strokes of different numbers of
            segments; a normal without a length.
    """
    before, after, direction = _rows(sketch, originals), _rows(sketch, images), _unit(normal)
    if len(before) != len(after) or len(torch.unique(torch.cat([before, after]))) != 2 * len(before):
        raise ValueError(f"expected as many images as originals, all different, got {originals} and {images}")
    if sketch.chains is not None and not torch.equal(sketch.chains.counts[before], sketch.chains.counts[after]):
        raise ValueError("a stroke and its image must have the same number of segments")
    segments = _segments(sketch, before), _segments(sketch, after)

    def reflect(moved: Sketch) -> Sketch:
        tensors = {}
        for name, value in moved.tensors().items():
            source, place = segments if name in moved.segment_fields else (before, after)
            tensors[name] = value.index_copy(0, place, value[source])
        points, n = tensors["points"], direction.to(moved.points)
        some = points[segments[1]]
        some = some - 2 * ((some @ n) - offset)[..., None] * n
        tensors["points"] = points.index_copy(0, segments[1], some)
        return moved.replace(**tensors)

    return reflect


def smooth(sketch: Sketch, turn: float = SMOOTH) -> Constraint:
    """Joints that are smooth in this sketch stay so: each lies between its neighbouring control points, as far along.

    Joints of straight segments stay as they are, since their neighbours are joints as well.

    Args:
        sketch: before anything has moved.
        turn: a joint is smooth if the curve turns there by less than this, radians, below a quarter turn.

    Raises:
        ValueError: another turn.
    """
    if not (isinstance(turn, int | float) and 0 < turn < math.pi / 2):
        raise ValueError(f"turn must be an angle between 0 and a quarter turn, in radians, got {turn!r}")
    chains = sketch.chains
    if chains is None or sketch.points.shape[1] < 3:
        return lambda moved: moved
    ends, starts = chains.joints
    points = sketch.points.detach()
    before, after = points[starts, 0] - points[ends, -2], points[starts, 1] - points[starts, 0]
    lengths = torch.linalg.vector_norm(before, dim=-1), torch.linalg.vector_norm(after, dim=-1)
    level = torch.from_numpy(turns(*(way.cpu().double().numpy() for way in (before, after))) < turn).to(points.device)
    ends, starts = ends[level], starts[level]
    ratio = (lengths[0] / (lengths[0] + lengths[1]))[level, None]

    def straighten(moved: Sketch) -> Sketch:
        joint = torch.lerp(moved.points[ends, -2], moved.points[starts, 1], ratio.to(moved.points))
        first = moved.points[:, 0].index_copy(0, starts, joint)
        last = moved.points[:, -1].index_copy(0, ends, joint)
        return replace(moved, points=torch.cat([first[:, None], moved.points[:, 1:-1], last[:, None]], 1))

    return straighten


def _rows(sketch: Sketch, strokes: Sequence[int] | Tensor) -> Int[Tensor, " S"]:
    rows = torch.as_tensor(strokes, device=sketch.points.device).reshape(-1)
    if rows.dtype != torch.int64 and len(rows):
        raise TypeError(f"strokes must be whole numbers, indices of strokes, got {strokes!r}")
    rows = rows.long()
    if len(rows) and not 0 <= int(rows.min()) <= int(rows.max()) < len(sketch):
        raise IndexError(f"strokes must be indices from 0 to {len(sketch) - 1}, got {rows.tolist()}")
    return rows


def _segments(sketch: Sketch, rows: Int[Tensor, " S"]) -> Int[Tensor, " L"]:
    return rows if sketch.chains is None else sketch.chains.select(rows)[0]


def _unit(normal: Sequence[float] | Tensor) -> Tensor:
    n = as_numbers("normal", normal, torch.float64)
    length = torch.linalg.vector_norm(n)
    if n.shape != (3,) or not 0 < float(length) < float("inf"):
        raise ValueError(f"normal must be three numbers with a length, got {normal}")
    unit: Tensor = n / length
    return unit
