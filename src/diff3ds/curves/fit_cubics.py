"""Cubics through rows of points, in any dimension: few of them, within a tolerance, smooth or with corners kept.

All rows are fitted at once, by least squares with parameters that move towards the closest points; rows that no cubic
fits are cut, and their parts fitted again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.bezier.curves import bernstein
from diff3ds.curves.directions import turns, unit

# Rounds of improved parameters, and of those of outlines, of which there are many; empirical.
ROUNDS, OUTLINE_ROUNDS = 4, 2
# Pull of free control points towards even spacing, relative to the number of points: decides where points leave the
# shape open.
EVEN = 1e-3
# Where a row of points turns by more (radians), it has a corner: smooth outlines are sampled at a third of that.
CORNER = 0.6
# Of the tolerance. What is nearer to the point before it says nothing about the direction.
SHORTEST = 2e-3
# Radians; a row whose cubic would leave its ends along the chord but for this, and whose points lie within half the
# tolerance of it, is a straight line; one of two points, which say less, but for that.
LEVEL, LEVEL_OF_TWO = 0.045, 0.014
# Steps of which one is so many times as long as the other are no samples of one parabola. [empirical]
UNEVEN = 3.0


@dataclass(frozen=True, eq=False)
class FittedRows:
    """Cubics along rows of points.

    Attributes:
        control: their control points.
        start: the point at which each begins, in rising order.
        stop: and ends.
        t: the parameter of each point in the cubic within which it lies; of ends of cubics it means nothing.
    """

    control: Float[Array, "C 4 D"]
    start: Int[Index, " C"]
    stop: Int[Index, " C"]
    t: Float[Array, " N"]


class _Rows(NamedTuple):
    """Points of rows one after the other: where each row's begin, how many they are, and the row of each point."""

    points: Float[Array, "M D"]
    at: Int[Index, " M"]
    row: Int[Index, " M"]
    offset: Int[Index, " R"]
    counts: Int[Index, " R"]

    @staticmethod
    def of(points: Float[Array, "N D"], start: Int[Index, " R"], stop: Int[Index, " R"]) -> "_Rows":
        counts = stop - start + 1
        offset = np.cumsum(counts) - counts
        row = np.repeat(np.arange(len(start)), counts)
        at = np.arange(len(row)) - offset[row] + start[row]
        return _Rows(points[at], at, row, offset, counts)

    @property
    def ends(self) -> tuple[Float[Array, "R D"], Float[Array, "R D"]]:
        return self.points[self.offset], self.points[self.offset + self.counts - 1]


def fit_rows(
    points: Float[Array, "N D"],
    start: Int[Index, " R"],
    stop: Int[Index, " R"],
    tolerance: float,
    length: Float[Array, " N"] | None = None,
    measured: int | None = None,
    ways: Float[Array, "R 2 D"] | None = None,
    rounds: int = ROUNDS,
) -> FittedRows:
    """Cubics from the first point of each row to its last one, as many as it takes.

    Args:
        points: of all rows.
        start: the first point of each row.
        stop: and its last one, which may be the first of the next row.
        tolerance: largest distance of the points from the cubics.
        length: how far along its row each point lies, by which parameters begin; by default along the points.
        measured: distances are those of so many coordinates, which the others follow; by default of all.
        ways: unit vectors from the ends of each row into it, along which cubics leave these; they go on smoothly in
            each other then.
        rounds: in which the points' parameters move towards their closest points.
    """
    if length is None:
        length = _along_points(points)
    parameters = np.zeros(len(points))
    done: list[tuple[Array, Index, Index]] = []
    while len(start):
        rows = _Rows.of(points, start, stop)
        control, t, off = _fitted(rows, length, measured or points.shape[1], rounds, ways)
        parameters[rows.at] = t
        error = np.maximum.reduceat(off, rows.offset)
        if ways is not None:
            straight = _is_level(rows, ways, tolerance)
            first, last = (end[straight] for end in rows.ends)
            control[straight] = np.stack([first, first, last, last], 1)
            error[straight] = 0
        good = (error <= tolerance) | (rows.counts < 3)
        done.append((control[good], start[good], stop[good]))
        # In the middle of the length, and not at an end.
        nearer = length[rows.at] < ((length[start] + length[stop]) / 2)[rows.row]
        middle = (start + np.add.reduceat(nearer, rows.offset, dtype=np.int64))[~good]
        start, stop = start[~good], stop[~good]
        middle = np.clip(middle, start + 1, stop - 1)
        start, stop = np.concatenate([start, middle]), np.concatenate([middle, stop])
        if ways is not None:
            along, rest = unit(points[middle + 1] - points[middle - 1]), ways[~good]
            ways = np.concatenate([np.stack([rest[:, 0], -along], 1), np.stack([along, rest[:, 1]], 1)])
    if not done:
        nothing = np.zeros(0, np.int64)
        return FittedRows(np.zeros((0, 4, points.shape[1])), nothing, nothing, parameters)
    control, start, stop = (np.concatenate(column) for column in zip(*done, strict=True))
    order = np.argsort(start, kind="stable")
    return FittedRows(control[order], start[order], stop[order], parameters)


def fit_points(points: Float[Array, "M D"]) -> tuple[Float[Array, "4 D"], Float[Array, " M"]]:
    """The one cubic nearest to points in a row, from the first to the last region of them, and their distances."""
    moved, even, pull = points - points[0], np.linspace(0, 1, 4)[:, None] * (points[-1] - points[0]), EVEN * len(points)
    length = _along_points(points)
    t = length / (length[-1] if length[-1] > 0 else 1.0)
    # As for rows, of which one alone takes half of the time so.
    for left in range(ROUNDS, -1, -1):
        basis = bernstein(t, 3)
        control = np.linalg.solve(basis.T @ basis + pull * np.eye(4), basis.T @ moved + pull * even)
        off = moved - basis @ control
        if left:
            t = _nearer(t, off.T, 3 * (bernstein(t, 2) @ np.diff(control, axis=0)).T)
            t[0], t[-1] = 0, 1
    return points[0] + control, np.linalg.norm(off, axis=1)


def fit_outline(
    points: Float[Array, "N D"], tolerance: float, closed: bool = False, corner: float = CORNER
) -> Float[Array, "C 4 D"]:
    """Cubics that follow on each other from the first point to the last, or round to the first again.

    They go on smoothly in each other but at corners. One with its inner control points on its ends stands for a
    straight line (`is_straight`).

    Args:
        tolerance: largest distance of the points from the cubics.
        corner: radians; points at which the row turns by more are corners.
    """
    return fit_outlines([points], [closed], tolerance, corner)[0]


def fit_outlines(
    outlines: Sequence[Float[Array, "_ D"]], closed: Sequence[bool], tolerance: float, corner: float = CORNER
) -> list[Float[Array, "_ 4 D"]]:
    """As `fit_outline`, of many at once: the same cubics in a tenth of the time."""
    if not outlines:
        return []
    rows = [_between_corners(points, tolerance, loop, corner) for points, loop in zip(outlines, closed, strict=True)]
    first = np.cumsum([len(points) for points, _, _ in rows])[:-1]
    length = np.concatenate([_along_points(points) for points, _, _ in rows])
    points, ends, ways = (np.concatenate(column) for column in zip(*rows, strict=True))
    start, stop = (ends + np.repeat([0, *first], [len(each) for _, each, _ in rows])[:, None]).T
    fitted = fit_rows(points, start, stop, tolerance, length, ways=ways, rounds=OUTLINE_ROUNDS)
    return np.split(fitted.control, np.searchsorted(fitted.start, first))


def through_points(
    outlines: Sequence[Float[Array, "_ D"]], closed: Sequence[bool], corner: float = CORNER
) -> list[Float[Array, "_ 4 D"]]:
    """Cubics from each point of outlines to the next, smooth but at corners: of parabolas through three points.

    Args:
        outlines: points; one less cubics than points, of closed ones as many.
        closed: whether each goes round to its first point again.
        corner: as of `fit_outline`.
    """
    if not outlines:
        return []
    rows = [np.concatenate([each, each[:1]]) if loop else each for each, loop in zip(outlines, closed, strict=True)]
    counts = np.array([len(each) for each in rows])
    points = np.concatenate(rows)
    last = counts.cumsum() - 1
    first = last - counts + 1
    at = np.delete(np.arange(len(points)), last)
    step = np.zeros_like(points)
    step[at] = points[at + 1] - points[at]
    # Before each point, and after it; at the ends of open ones the one that there is, round the seam of closed ones.
    before, after = np.roll(step, 1, axis=0), step
    loops = np.array(closed, bool)
    before[first] = np.where(loops[:, None], step[np.maximum(last - 1, first)], step[first])
    after[last] = np.where(loops[:, None], step[first], before[last])
    a, b = (np.sqrt((each**2).sum(1, keepdims=True)) for each in (before, after))
    smooth = (a > 0) & (b > 0) & ((before * after).sum(1, keepdims=True) > np.cos(corner) * a * b)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Where an arc of short steps meets a long straight one, the long one says where both go.
        even = np.maximum(a, b) < UNEVEN * np.minimum(a, b)
        slope = np.where(even, before / a * b + after / b * a, before + after) / (a + b)
    leaving = np.where(smooth, slope * b, after)
    arriving = np.where(smooth, slope * a, before)
    cubics = np.stack(
        [points[at], points[at] + leaving[at] / 3, points[at + 1] - arriving[at + 1] / 3, points[at + 1]], 1
    )
    return np.split(cubics, (counts - 1).cumsum()[:-1])


def _between_corners(
    points: Float[Array, "N D"], tolerance: float, closed: bool, corner: float
) -> tuple[Float[Array, "M D"], Int[Index, "R 2"], Float[Array, "R 2 D"]]:
    """The points of an outline, the first and the last of each row between corners, and `ways` of `fit_rows`."""
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1) > SHORTEST * tolerance
    points = points[np.append(True, apart)[: len(points)]]
    if closed and len(points) > 1 and np.linalg.norm(points[-1] - points[0]) <= SHORTEST * tolerance:
        points = points[:-1]
    if len(points) < 2:
        return points[:0], np.zeros((0, 2), np.int64), np.zeros((0, 2, points.shape[1]))
    smooth_seam = False
    if closed:
        around = turns(points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points) > corner
        # Begin at a corner, if there is one: then the seam is a point like any other.
        turn = int(around.argmax())
        smooth_seam = not around[turn]
        points = np.roll(points, -turn, axis=0)
        points = np.concatenate([points, points[:1]])
    steps = np.diff(points, axis=0)
    corners = np.flatnonzero(turns(steps[:-1], steps[1:]) > corner) + 1
    start, stop = np.append(0, corners), np.append(corners, len(points) - 1)
    seam = unit(points[1] - points[-2])
    ends = np.stack([_leaving(points, start, stop, 1), _leaving(points, stop, start, -1)], 1)
    return points, np.stack([start, stop], 1), np.stack([seam, -seam])[None] if smooth_seam else ends


def is_straight(cubic: Float[Array, "4 D"]) -> bool:
    """Whether a cubic of `fit_outline` stands for a straight line."""
    return bool((cubic[1] == cubic[0]).all())


def _along_points(points: Float[Array, "N D"]) -> Float[Array, " N"]:
    """How far along their polyline points lie."""
    return np.append(0.0, np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum())[: len(points)]


def _fitted(
    rows: _Rows,
    length: Float[Array, " N"],
    measured: int,
    rounds: int,
    ways: Float[Array, "R 2 D"] | None,
) -> tuple[Float[Array, "R 4 D"], Float[Array, " M"], Float[Array, " M"]]:
    """A cubic for each row, and the parameters and distances of the points."""
    begin = length[rows.at[rows.offset]]
    span = length[rows.at[rows.offset + rows.counts - 1]] - begin
    t = (length[rows.at] - begin[rows.row]) / np.where(span > 0, span, 1.0)[rows.row]
    # Coordinates one after the other: numpy takes several times as long to go along the few of each point.
    points = np.ascontiguousarray(rows.points.T)
    moved = points - points.take(rows.offset, 1).take(rows.row, 1)
    for left in range(rounds, -1, -1):
        b = _bernstein(t, 3)
        control = _free(rows, b, moved) if ways is None else _along(rows, b, moved, ways)
        own = control[..., :measured]
        off = points[:measured] - _mixed(b, own, rows.row)
        if not left:
            break
        # What is not measured follows.
        t = _nearer(t, off, 3 * _mixed(_bernstein(t, 2), np.diff(own, axis=1), rows.row))
        t[rows.offset], t[rows.offset + rows.counts - 1] = 0, 1
    return control, t, np.linalg.norm(off, axis=0)


def _nearer(t: Float[Array, " M"], off: Float[Array, "D M"], tangent: Float[Array, "D M"]) -> Float[Array, " M"]:
    """Parameters after a step of Gauss and Newton towards the closest point; `off` is from there to the point."""
    return np.clip(t + (off * tangent).sum(0) / np.maximum((tangent**2).sum(0), 1e-12), 0, 1)


def _bernstein(t: Float[Array, " M"], degree: int) -> Float[Array, "K M"]:
    return np.ascontiguousarray(bernstein(t, degree).T)


def _mixed(b: Float[Array, "K M"], control: Float[Array, "R K D"], row: Int[Index, " M"]) -> Float[Array, "D M"]:
    """The points of the rows' curves at these Bernstein polynomials."""
    along = np.ascontiguousarray(control.transpose(1, 2, 0)).take(row, 2)
    return np.asarray((b[:, None] * along).sum(0))


def _sums(
    rows: _Rows, b: Float[Array, "4 M"], moved: Float[Array, "D M"]
) -> tuple[Float[Array, "R 2 4"], Float[Array, "R 2 D"]]:
    """Of products of inner Bernstein polynomials with all, and with the points as seen from the first of each row."""
    some = b[1:3, None]
    products, sums = (np.add.reduceat(some * other, rows.offset, axis=2).transpose(2, 0, 1) for other in (b, moved))
    return np.ascontiguousarray(products), np.ascontiguousarray(sums)


def _free(rows: _Rows, b: Float[Array, "4 M"], moved: Float[Array, "D M"]) -> Float[Array, "R 4 D"]:
    """The cubics of least squares from end to end of rows, pulled towards even spacing."""
    products, sums = _sums(rows, b, moved)
    first, last = rows.ends
    even = np.linspace(0, 1, 4)[:, None] * (last - first)[:, None]
    pull = (EVEN * rows.counts)[:, None, None]
    inner, held = [1, 2], [0, 3]
    right = sums - products[:, :, held] @ even[:, held] + pull * even[:, inner]
    even[:, inner] = np.linalg.solve(products[:, :, inner] + pull * np.eye(2), right)
    return first[:, None] + even


def _along(
    rows: _Rows, b: Float[Array, "4 M"], moved: Float[Array, "D M"], ways: Float[Array, "R 2 D"]
) -> Float[Array, "R 4 D"]:
    """The cubics of least squares that leave the ends of rows along these vectors."""
    products, sums = _sums(rows, b, moved)
    first, last = rows.ends
    chord = last - first
    rest = sums - (products[:, :, 2:].sum(2))[..., None] * chord[:, None]
    wanted = (rest * ways).sum(2)
    a, b, c = products[:, 0, 1], products[:, 0, 2] * (ways[:, 0] * ways[:, 1]).sum(1), products[:, 1, 2]
    determinant = a * c - b * b
    sound = np.abs(determinant) > 1e-12 * a * c
    reach = np.stack([wanted[:, 0] * c - wanted[:, 1] * b, wanted[:, 1] * a - wanted[:, 0] * b], 1)
    reach /= np.where(sound, determinant, 1.0)[:, None]
    steps = np.linalg.norm(np.diff(rows.points, axis=0, append=rows.points[-1:]), axis=1)
    steps[rows.offset + rows.counts - 1] = 0
    third = np.add.reduceat(steps, rows.offset)[:, None] / 3
    # Handles that point backwards, or far beyond the points, make loops.
    sound &= ((reach > 0) & (reach < 4 * third)).all(1)
    handles = np.where(sound[:, None], reach, third)[..., None] * ways
    return np.stack([first, first + handles[:, 0], last + handles[:, 1], last], 1)


def _is_level(rows: _Rows, ways: Float[Array, "R 2 D"], tolerance: float) -> Bool[Mask, " R"]:
    """Which rows are straight lines."""
    first, last = rows.ends
    way = unit(last - first)
    moved = rows.points - first[rows.row]
    across = moved - (moved * way[rows.row]).sum(1, keepdims=True) * way[rows.row]
    off = np.maximum.reduceat(np.linalg.norm(across, axis=1), rows.offset)
    turned = np.maximum(turns(way, ways[:, 0]), turns(-way, ways[:, 1]))
    pair = rows.counts == 2
    return (off < tolerance / 2) & (turned < np.where(pair, LEVEL_OF_TWO, LEVEL)) | (pair & (first == last).all(1))


def _leaving(
    points: Float[Array, "N D"], start: Int[Index, " R"], stop: Int[Index, " R"], step: int
) -> Float[Array, "R D"]:
    """The directions in which rows leave their first points: of the parabola through the first three."""
    first = points[start + step] - points[start]
    three = np.abs(stop - start) > 1
    second = points[np.where(three, start + 2 * step, stop)] - points[start + step]
    a, b = (np.linalg.norm(each, axis=1, keepdims=True) for each in (first, second))
    curved = first / a * (2 * a + b) - second / np.where(b > 0, b, 1.0) * a
    return unit(np.where(three[:, None], curved, first))
