"""Outlines of ink along lines: two sides at their half widths, ends and bends, as contours that turn one way round.

All parts of a contour wind the same way round what they cover, however the line bends and crosses itself, so that a
union (`union.py`) by nonzero winding is exactly what a pen of these widths covers.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float
from diff3ds.curves.fit_cubics import fit_outlines, is_straight, through_points
from diff3ds.page.lines import Line

# px. Of cubics from the outline at the samples.
TOLERANCE = 0.08
# On the inner side of a bend the outline is kept to this part of the radius of curvature; what lies beyond is added.
INSIDE = 0.8
# The inner parts of bends are added in wedges that turn by less (radians): then each lies in one disc of the pen.
WEDGE = 1.0
# Bends are taken for no sharper than this (radians): the sides of sharper ones meet too far away to be ink there.
SHARPEST = 2.5
# px. What is narrower ends in a point.
POINT = 0.02
# Handles of a quarter of a circle, for cubics: off by 2.7e-4 of the radius.
QUARTER = 0.5522847498

Cap = Literal["round", "flat"]


class Side:
    """A side of a line: points, along which cubics are fitted, together with those of other lines."""

    def __init__(self, points: Float[Array, "n 2"], closed: bool = False) -> None:
        self.points, self.closed = points, closed
        self.cubics: Float[Array, "m 4 2"] | None = None


# Cubics and sides that follow on each other round what is covered.
Contour = list[Float[Array, "_ 4 2"] | Side]


def fit_sides(contours: Iterable[Contour]) -> None:
    """Fits cubics along all sides that have none yet."""
    sides = [part for contour in contours for part in contour if isinstance(part, Side) and part.cubics is None]
    fitted = fit_outlines([side.points for side in sides], [side.closed for side in sides], TOLERANCE)
    for side, cubics in zip(sides, fitted, strict=True):
        side.cubics = cubics


def smooth_sides(contours: Iterable[Contour]) -> None:
    """Cubics from point to point along all sides that have none yet: for pixels, where their number does not count."""
    sides = [part for contour in contours for part in contour if isinstance(part, Side) and part.cubics is None]
    through = through_points([side.points for side in sides], [side.closed for side in sides])
    for side, cubics in zip(sides, through, strict=True):
        side.cubics = cubics


def add_contours(path: Any, contours: Sequence[Contour]) -> None:
    """Adds contours to a path of pathops; what it has winds the same way round."""
    fit_sides(contours)
    for contour in contours:
        add_contour(path, np.concatenate([part.cubics if isinstance(part, Side) else part for part in contour]))


def strip(
    line: Line,
    half_width: Float[Array, " n"],
    cap: Cap = "round",
    left: Float[Array, " n"] | None = None,
) -> list[Contour]:
    """The outline of a line: all that lies within its half widths, across it.

    Args:
        half_width: at the samples, pixels, not negative; only to the right, the side of the normals, with `left`.
        cap: how the line ends.
        left: half widths to the left, if they differ.
    """
    left = half_width if left is None else left
    if len(line.points) < 2:
        return disc(line.points[0], float(half_width[0] + left[0]) / 2)
    line, half_width, left = _sampled_at_bends(line, half_width, left)
    near_right, near_left = inside_bends(line, half_width, left)
    right = line.points + near_right[:, None] * line.normals
    other = line.points - near_left[:, None] * line.normals
    contours: list[Contour]
    if line.closed:
        contours = [[Side(other, True)], [Side(right[::-1], True)]]
    else:
        stop, start = _cap(line, -1, half_width, left, cap), _cap(line, 0, half_width, left, cap)
        contours = [[Side(other), stop, Side(right[::-1]), start]]
    return [*contours, *_wedges(line, half_width, near_right, 1.0), *_wedges(line, left, near_left, -1.0)]


def disc(centre: Float[Array, " 2"], radius: float) -> list[Contour]:
    """A disc; nothing of one that is too small."""
    return [] if radius <= POINT else [[centre + _arc(np.array([radius, 0.0]), 2 * math.pi)]]


def add_contour(path: Any, cubics: Float[Array, "m 4 2"]) -> None:
    """Adds a closed contour, turned so that it winds positively, from x towards y.

    Cubics that do not meet are joined by straight lines.
    """
    if not len(cubics):
        return
    rows = cubics.reshape(-1, 8).tolist()
    path.moveTo(*rows[0][:2])
    last = rows[0][:2]
    for row, cubic in zip(rows, cubics, strict=True):
        if row[:2] != last:
            path.lineTo(*row[:2])
        if is_straight(cubic):
            path.lineTo(*row[6:])
        else:
            path.cubicTo(*row[2:])
        last = row[6:]
    path.close()


def inside_bends(line: Line, right: Float[Array, " n"], left: Float[Array, " n"]) -> tuple[Array, Array]:
    """Half widths to the right (the side of the normals) and to the left, kept short of the centres of bends."""
    turn, step = np.diff(line.angle), np.diff(line.along)
    sides = []
    for width, sign in ((right, 1.0), (left, -1.0)):
        # The centre of a bend lies on the side to which the line turns.
        radius = np.where(sign * turn > 1e-9, INSIDE * step / np.abs(turn).clip(1e-9), np.inf)
        ends = (radius[-1:], radius[:1]) if line.closed else (np.full(1, np.inf), np.full(1, np.inf))
        around = np.minimum(np.concatenate([ends[0], radius]), np.concatenate([radius, ends[1]]))
        sides.append(np.minimum(width, around))
    return sides[0], sides[1]


def _sampled_at_bends(line: Line, right: Array, left: Array) -> tuple[Line, Array, Array]:
    """A line with samples where the sides before and after a tight bend meet, and its half widths there.

    Without them a corner between long straight parts would thin all of these, and fill what lies between them.
    """
    more = []
    short = np.logical_or(
        *(near < wide - POINT for near, wide in zip(inside_bends(line, right, left), (right, left), strict=True))
    )
    for start, stop in _runs(short):
        turn = min(abs(float(line.angle[stop - 1] - line.angle[start])), SHARPEST)
        reach = float(np.maximum(right, left)[start:stop].max()) * math.tan(turn / 2)
        # Twice as far too: then what lies beyond is seen to be straight.
        places = [line.along[start] - reach * k for k in (1, 2)] + [line.along[stop - 1] + reach * k for k in (1, 2)]
        more += [place % line.length for place in places] if line.closed else places
    # A sample that is there already, or lies in the bend, is none more.
    fresh = [each for each in more if 0 < each < line.length and np.abs(line.along - each).min() > POINT]
    if not fresh:
        return line, right, left
    sampled = line.at(np.concatenate([line.along, fresh]))
    right, left = (np.interp(sampled.along, line.along, wide) for wide in (right, left))
    return sampled, right, left


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where runs of flags begin and stop."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _wedges(line: Line, half_width: Array, clamped: Array, sign: float) -> Iterator[Contour]:
    """What the pen covers on the inner side of tight bends, beyond what the strip has of it."""
    short = clamped < half_width - POINT
    if not short.any():
        return
    far = line.points + sign * half_width[:, None] * line.normals
    for start, stop in _runs(short):
        # One sample more on both sides, so that wedges and strip overlap.
        start, stop = max(start - 1, 0), min(stop + 1, len(short))
        count = max(1, math.ceil(abs(line.angle[stop - 1] - line.angle[start]) / WEDGE))
        cuts = np.linspace(start, stop - 1, count + 1).round().astype(int).tolist()
        for first, last in pairwise(cuts):
            rows = slice(first, last + 1)
            yield from _hull(np.concatenate([line.points[rows], far[rows]]))


def _hull(points: Array) -> Iterator[Contour]:
    """The convex hull of points, wound positively; none of points on a line."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    rows = points[order].tolist()

    def half(rows: list[list[float]]) -> list[list[float]]:
        hull: list[list[float]] = []
        for p in rows:
            while len(hull) > 1 and (hull[-1][0] - hull[-2][0]) * (p[1] - hull[-2][1]) <= (
                hull[-1][1] - hull[-2][1]
            ) * (p[0] - hull[-2][0]):
                hull.pop()
            hull.append(p)
        return hull[:-1]

    hull = half(rows) + half(rows[::-1])
    if len(hull) >= 3:
        begin, end = np.array(hull[:-1]), np.array(hull[1:])
        yield [np.stack([begin, begin, end, end], 1)]


def _cap(line: Line, end: int, right: Array, left: Array, cap: Cap) -> Array:
    """Cubics from one side to the other around an end."""
    normal = line.normals[end]
    radius = float(right[end] + left[end]) / 2
    if radius <= POINT:
        return np.zeros((0, 4, 2))
    centre = line.points[end] + normal * float(right[end] - left[end]) / 2
    start = -normal * radius if end else normal * radius
    if cap == "flat":
        return np.array([[centre + start, centre + start, centre - start, centre - start]])
    return centre + _arc(start, math.pi)


def _arc(start: Float[Array, " 2"], turn: float) -> Float[Array, "m 4 2"]:
    """Cubics around the origin from a point on, in the direction from x towards y, by quarter turns."""
    cubics = []
    x, y = start.tolist()
    for _ in range(round(turn / (math.pi / 2))):
        u, v = -y, x
        cubics.append([(x, y), (x + QUARTER * u, y + QUARTER * v), (u + QUARTER * x, v + QUARTER * y), (u, v)])
        x, y = u, v
    return np.array(cubics)
