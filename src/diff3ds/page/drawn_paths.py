"""A view of a sketch as paths of cubic Béziers in the order in which they are painted: what SVG and PDF files hold."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple, TypedDict, Unpack

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds.camera import Cameras
from diff3ds.page.depth_order import Part, painting_order
from diff3ds.page.screen_pieces import Pieces, on_page, screen_pieces
from diff3ds.page.sheet.ink_boxes import Box, box_of
from diff3ds.page.sheet.page_layout import widened
from diff3ds.page.stroke_outlines import Path, Way, outlines
from diff3ds.parallel.in_copies import in_copies
from diff3ds.project import Strokes2D, project
from diff3ds.sketch import Sketch

# Pixels. An edge that is off by this changes a pixel by as much at most: 13 of 255.
TOLERANCE = 0.05
# Of it: the curve, and the outline around it.
_CURVE, _BORDER = 0.6, 0.4
# Pixels by which parts of an opaque stroke lie over each other where it is cut, so that nothing shines through between
# them; those of a translucent one only touch, since they would be darker.
OVERLAP = 0.5


class DrawnPath(NamedTuple):
    """A path to stroke with round ends, or to fill by the rule "nonzero".

    Attributes:
        strokes: the number of its stroke; of several that a pen joins theirs, in their order along it.
        curves: cubics that follow on each other, in pixels: the start, then three control points each.
        closed: whether each of the curves ends where it begins.
        width: to stroke with, pixels; None to fill.
        color: RGB in [0, 1].
        opacity: in [0, 1].
        multiplied: whether its colour is multiplied with what lies below, as transparent paint does.
    """

    strokes: tuple[int, ...]
    curves: list[Path]
    closed: bool
    width: float | None
    color: tuple[float, float, float]
    opacity: float
    multiplied: bool = False


def drawn_paths(
    sketch: Sketch,
    cameras: Cameras,
    view: int,
    *,
    centerline: bool = False,
    tolerance: float = TOLERANCE,
    ordered: bool = True,
) -> list[DrawnPath]:
    """What one view shows, far paths first; parts of strokes that would leave the page are cut off.

    Strokes of one width in image units, and all as centre lines, are paths to stroke. Others are outlines to fill, and
    so are the parts of strokes that have been cut because of their depth.

    Args:
        centerline: one path a stroke, in the order of the sketch, as a pen draws it: nothing hides anything.
        tolerance: how far a path may be off the exact stroke, pixels.
        ordered: otherwise paths are in the order of the sketch, and none is cut for its depth.
    """
    projected = project(sketch, cameras)
    strokes, size, page = _where_square(projected, view, cameras.size)
    oblong = projected.square is not None
    even = centerline or (strokes.width_space == "image" and strokes.half_width.ndim == 2 and not oblong)
    pieces = screen_pieces(strokes, view, size, tolerance if centerline else _CURVE * tolerance)
    pieces = on_page(pieces, size)
    if centerline or not ordered:
        # They are in the order of the strokes.
        counts = torch.unique_consecutive(pieces.stroke, return_counts=True)[1]
        ends = [0, *counts.cumsum(0).tolist()]
        parts = [Part(pieces.rows(slice(*ends_of)), (False, False)) for ends_of in pairwise(ends)]
    else:
        parts = painting_order(strokes, view, pieces)
    # A path to stroke would end round where it is cut, and hide what it should not.
    lined = [even and not any(part.cut) for part in parts]
    overlap = torch.where(strokes.opacity < 1, 0.0, OVERLAP).tolist()
    ways = [
        Way(
            part.pieces.points.numpy(),
            _joined(part.pieces),
            _closes(strokes, part.pieces),
            part.cut,
            overlap[int(part.pieces.stroke[0])],
        )
        for part, line in zip(parts, lined, strict=True)
        if not line
    ]
    filled = outlines(ways, _BORDER * tolerance)
    colors, opacities = strokes.color.double().clamp(0, 1).tolist(), strokes.opacity.tolist()
    found, scale = [], page.scale
    for (pieces, _), line in zip(parts, lined, strict=True):
        stroke = int(pieces.stroke[0])
        width = 2 * float(pieces.points[..., 2].mean()) * scale if line else None
        opacity = 1.0 if centerline else opacities[stroke]
        r, g, b = colors[stroke]
        curves = [page.place(curve) for curve in (_centre_line(pieces) if line else next(filled))]
        closed = not line or _closes(strokes, pieces)
        found.append(DrawnPath((stroke,), curves, closed, width, (r, g, b), opacity))
    return found


def joined_dashes(paths: Sequence[DrawnPath], dashes: Sequence[int], pens: bool = False) -> list[DrawnPath]:
    """Paths of which the dashes of a line are one path of several curves, in the place of the first.

    Those that would come to lie below what they are above stay apart, unless that is dashed too.

    Args:
        paths: in their order.
        dashes: of each stroke the line that it is a dash of, -1 for others.
        pens: whether their order is that of pens: then only dashes that follow on each other are joined.
    """
    boxes = np.array([box_of_paths([path]) or (np.inf, np.inf, -np.inf, -np.inf) for path in paths]).reshape(-1, 4)
    looks = [(path.color, path.opacity, path.multiplied) for path in paths]
    codes = {look: code for code, look in enumerate(dict.fromkeys(looks))}
    look = np.array([codes[each] for each in looks], int)
    whole_ones = np.array([all(dashes[stroke] < 0 for stroke in path.strokes) for path in paths], bool)
    made: list[DrawnPath] = []
    # Of dashes that look alike: the first path, and the one that is made of it.
    begun: dict[object, tuple[int, int]] = {}
    for row, path in enumerate(paths):
        lines = {dashes[stroke] for stroke in path.strokes}
        wide = None if path.width is None else round(path.width, 3)
        key = (lines.pop() if len(lines) == 1 else -1, wide, path.closed, look[row])
        first, place = begun.get(key, (row, -1))
        between = slice(first + 1, row)
        over = (boxes[between, :2] <= boxes[row, 2:]).all(1) & (boxes[between, 2:] >= boxes[row, :2]).all(1)
        over &= whole_ones[between] & ((look[between] != look[row]) | (path.opacity < 1))
        if key[0] < 0 or place < 0 or over.any() or (pens and place < len(made) - 1):
            begun[key] = row, len(made)
            made.append(path)
            continue
        whole = made[place]
        made[place] = whole._replace(strokes=whole.strokes + path.strokes, curves=whole.curves + path.curves)
    return made


class Drawing(TypedDict, total=False):
    """Options of `drawn_paths`."""

    centerline: bool
    tolerance: float


def ink_boxes(sketches: Sequence[Sketch], **how: Unpack[Drawing]) -> Callable[[Cameras, float], list[Box | None]]:
    """The boxes of what is drawn in each view, in pixels, as `lay_out` asks for them: widths of strokes included.

    Args:
        sketches: one a view.
        how: as of `drawn_paths`.
    """

    def boxes(cameras: Cameras, widen: float) -> list[Box | None]:
        def box(view: int) -> Box | None:
            return box_of_paths(drawn_paths(widened(sketches[view], widen), cameras, view, ordered=False, **how))

        return in_copies(box, len(sketches), len(sketches))

    return boxes


def box_of_paths(paths: Iterable[DrawnPath]) -> Box | None:
    """The box of the ink, pixels; None of nothing."""
    curves = [(curve, (path.width or 0.0) / 2) for path in paths for curve in path.curves if len(curve)]
    return box_of([curve for curve, _ in curves], [reach for _, reach in curves])


class _Page(NamedTuple):
    """The way back from where pixels are square to the page: a map of what begins at `corner` there."""

    back: NDArray[np.float64]
    corner: NDArray[np.float64]

    @property
    def scale(self) -> float:
        """Of widths, in the mean of all directions."""
        return math.sqrt(np.linalg.det(self.back))

    def place(self, points: Path) -> Path:
        """Points in pixels of the page."""
        return (points + self.corner) @ self.back.T


def _where_square(strokes: Strokes2D, view: int, size: tuple[int, int]) -> tuple[Strokes2D, tuple[int, int], _Page]:
    """Strokes as they are where pixels are square, as large as the page is there at least, and the way back."""
    if strokes.square is None:
        return strokes, size, _Page(np.eye(2), np.zeros(2))
    square = strokes.square[view].detach()
    height, width = size
    corners = square.new_tensor([[0, 0], [width, 0], [0, height], [width, height]]) @ square.T
    low, high = corners.amin(0), corners.amax(0)
    across, down = (high - low).ceil().int().tolist()
    places, rest = strokes.cubics[..., :2] @ square.T, strokes.cubics[..., 2:]
    moved = torch.cat([places - low * rest[..., :1], rest], -1)
    return replace(strokes, cubics=moved, square=None), (down, across), _Page(square.inverse().numpy(), low.numpy())


def _joined(pieces: Pieces) -> NDArray[np.bool_]:
    """Whether each piece begins where the one before it ends."""
    joined = np.zeros(len(pieces.stroke), bool)
    joined[1:] = (pieces.start[1:] == pieces.stop[:-1]).numpy()
    return joined


def _closes(strokes: Strokes2D, pieces: Pieces) -> bool:
    """Whether the pieces of a stroke run round without a gap."""
    chains, stroke = strokes.chains, int(pieces.stroke[0])
    if chains is None or not bool(chains.closed[stroke]):
        return False
    whole = (pieces.start[1:] == pieces.stop[:-1]).all()
    return bool(whole & (pieces.start[0] == chains.first[stroke]) & (pieces.stop[-1] == chains.first[stroke + 1]))


def _centre_line(pieces: Pieces) -> list[Path]:
    """Curves, broken where pieces are not joined."""
    points, joined = pieces.points[..., :2].numpy(), _joined(pieces)
    begins = np.flatnonzero(~joined)
    return [
        np.concatenate([points[a, :1], points[a:b, 1:].reshape(-1, 2)])
        for a, b in zip(begins, [*begins[1:], len(points)], strict=True)
    ]
