"""Outlines of strokes whose width changes: the border of what a disc of changing radius covers on its way, as cubics.

Discs along c(t) with radius r(t) touch their border on both sides where the normal, tilted forward by the angle with
sine -r' / |c'|, leads: c + r n. The border there runs at a right angle to n. Where the way bends more tightly than the
disc is wide, such borders would turn back on themselves: there the outline is one of straight parts, each the hull of
two discs. All closed curves turn the same way round, so that overlaps fill once (winding rule "nonzero").
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Float

# Cubic Béziers that follow on each other: the start, then three control points each.
Path = Float[NDArray[np.float64], "_ 2"]
Cubics = Float[NDArray[np.float64], "P 4 3"]

# Of the parameter of a part, for the speed of borders: cubics have no change that is quicker. [empirical]
STEP = 1e-4
# Pixels: the last digit of what files have.
DIGIT = 1e-3
# 2^-24 of a piece is below any pixel.
MAX_HALVINGS = 24


class _Parts(NamedTuple):
    """Parts of pieces: as ribbons between two borders that run beside the way, or as hulls of two discs."""

    piece: NDArray[np.int64]
    start: NDArray[np.float64]
    stop: NDArray[np.float64]
    ribbon: NDArray[np.bool_]
    # Left and right borders as cubics, (P, 2, 4, 2), and the discs at both ends, (P, 2, 3).
    borders: NDArray[np.float64]
    discs: NDArray[np.float64]

    def rows(self, index: Any) -> "_Parts":
        """Some of them."""
        columns: list[Any] = [column[index] for column in self]
        return _Parts(*columns)


class Way(NamedTuple):
    """A stroke or a part of one.

    Attributes:
        points: Bézier control points (x, y, radius) of its pieces.
        joined: whether each piece begins where the one before it ends.
        closed: whether the last also ends where the first begins.
        cut: whether it has a straight end in place of a round one, at its start and at its end.
        overlap: pixels by which a straight end goes on beyond the place where it is cut.
    """

    points: Cubics
    joined: NDArray[np.bool_]
    closed: bool
    cut: tuple[bool, bool] = (False, False)
    overlap: float = 0.0


def outlines(ways: Sequence[Way], tolerance: float) -> Iterator[list[Path]]:
    """Of each way closed curves whose filled union is what the discs cover, to a tolerance in pixels.

    The tolerance is seen to at three places of each cubic.
    """
    if not ways:
        return
    joined = np.concatenate([way.joined for way in ways])
    parts = _parts(np.concatenate([way.points for way in ways]), tolerance)
    last = np.cumsum([len(way.points) for way in ways])
    rows = np.searchsorted(parts.piece, np.concatenate([[0], last]))
    for way, start, stop in zip(ways, rows[:-1], rows[1:], strict=True):
        yield _outline(parts.rows(slice(start, stop)), joined, way, tolerance)


def _outline(parts: _Parts, joined: NDArray[np.bool_], way: Way, tolerance: float) -> list[Path]:
    """Of one way.

    Args:
        joined: of the pieces of all ways.
    """
    paths: list[Path] = []
    run: list[int] = []
    for i in range(len(parts.piece)):
        apart = parts.start[i] == 0 and not joined[parts.piece[i]]
        if run and (apart or not parts.ribbon[i] or not _smooth(parts, run[-1], i, tolerance)):
            paths.append(_ribbon(parts, run, way))
            run = []
        if parts.ribbon[i]:
            run.append(i)
        else:
            paths.append(_hull(*parts.discs[i]))
    if run:
        ring = way.closed and len(run) == len(parts.piece) and _smooth(parts, run[-1], run[0], tolerance)
        paths += _ring(parts, run) if ring else [_ribbon(parts, run, way)]
    return paths


def _smooth(parts: _Parts, before: int, after: int, tolerance: float) -> bool:
    """Whether the borders of a part begin where those of another end."""
    gap = np.linalg.norm(parts.borders[before, :, 3] - parts.borders[after, :, 0], axis=-1)
    return bool(gap.max() <= tolerance / 2)


def _ribbon(parts: _Parts, run: list[int], way: Way) -> Path:
    """The borders of parts that go on from one another, with round ends, or straight ones where the way is cut."""
    left, right = (np.concatenate([parts.borders[run[0], s, :1], *parts.borders[run, s, 1:]]) for s in (0, 1))
    first, last = parts.discs[run[0], 0], parts.discs[run[-1], 1]
    straight = way.cut[0] and run[0] == 0, way.cut[1] and run[-1] == len(parts.piece) - 1
    end = _stump(left[-1], right[-1], way.overlap) if straight[1] else _arc(last, left[-1], right[-1])
    start = _stump(right[0], left[0], way.overlap) if straight[0] else _arc(first, right[0], left[0])
    return np.concatenate([left, end[1:], right[-2::-1], start[1:]])


def _stump(start: NDArray[np.float64], stop: NDArray[np.float64], overlap: float) -> Path:
    """Straight across, a little farther along the way."""
    if overlap == 0:
        return _line(start, stop)
    across = stop - start
    beyond = overlap * np.array([across[1], -across[0]]) / max(float(np.linalg.norm(across)), 1e-12)
    a, b = start - beyond, stop - beyond
    return np.concatenate([_line(start, a), _line(a, b)[1:], _line(b, stop)[1:]])


def _ring(parts: _Parts, run: list[int]) -> list[Path]:
    """Both borders of a closed way, the right one against it."""
    left, right = (np.concatenate([parts.borders[run[0], s, :1], *parts.borders[run, s, 1:]]) for s in (0, 1))
    return [left, right[::-1]]


def _hull(first: NDArray[np.float64], last: NDArray[np.float64]) -> Path:
    """The hull of two discs (x, y, r), or the larger one if it holds the other."""
    way = last[:2] - first[:2]
    distance = float(np.linalg.norm(way))
    if distance <= abs(last[2] - first[2]):
        disc = first if first[2] > last[2] else last
        side = np.array([0.0, disc[2]])
        there = _arc(disc, disc[:2] + side, disc[:2] - side)
        return np.concatenate([there, _arc(disc, disc[:2] - side, disc[:2] + side)[1:]])
    normals = _normals(way[None] / distance, np.array([(first[2] - last[2]) / distance]))[0]
    (a, b), (c, d) = first[:2] + first[2] * normals, last[:2] + last[2] * normals
    return np.concatenate([_line(a, c), _arc(last, c, d)[1:], _line(d, b)[1:], _arc(first, b, a)[1:]])


def straight(path: Path) -> NDArray[np.bool_]:
    """Which of the cubics of a path are straight lines, evenly run through, to what files have of digits."""
    first, second = path[1::3], path[2::3]
    start, stop = path[:-1:3], path[3::3]
    off = np.abs([2 * start + stop - 3 * first, start + 2 * stop - 3 * second]).max((0, 2))
    even: NDArray[np.bool_] = off <= 3 * DIGIT
    return even


def _line(start: NDArray[np.float64], stop: NDArray[np.float64]) -> Path:
    return start + (stop - start) * (np.arange(4) / 3)[:, None]


def _arc(disc: NDArray[np.float64], start: NDArray[np.float64], stop: NDArray[np.float64]) -> Path:
    """Along the border of a disc from one point to another, clockwise where y points up, in quarters at most.

    Such cubics are off by less than 3e-4 of the radius.
    """
    center, radius = disc[:2], float(disc[2])
    if radius == 0:
        return _line(start, stop)
    angles = [math.atan2(*(point - center)[::-1]) for point in (start, stop)]
    turn = (angles[0] - angles[1]) % (2 * math.pi)
    count = max(math.ceil(turn / (math.pi / 2) - 1e-9), 1)
    angle = angles[0] - turn * np.arange(count + 1) / count
    places = center + radius * np.stack([np.cos(angle), np.sin(angle)], -1)
    places[0], places[-1] = start, stop
    handle = radius * 4 / 3 * math.tan(turn / count / 4)
    along = handle * np.stack([np.sin(angle), -np.cos(angle)], -1)
    inner = np.stack([places[:-1] + along[:-1], places[1:] - along[1:], places[1:]], 1)
    return np.concatenate([places[:1], inner.reshape(-1, 2)])


def _normals(along: NDArray[np.float64], sine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors from the middle to the left and the right border, (P, 2, 2), of directions and tilts."""
    cosine = np.sqrt(np.clip(1 - sine**2, 0, None))
    across = np.stack([-along[:, 1], along[:, 0]], -1) * cosine[:, None]
    forward = along * sine[:, None]
    return np.stack([forward + across, forward - across], 1)


def _parts(points: Cubics, tolerance: float) -> _Parts:
    """Halves pieces until each half is a ribbon with borders within the tolerance, or a hull of two discs within it."""
    piece = np.arange(len(points))
    start, stop = np.zeros(len(points)), np.ones(len(points))
    done: list[_Parts] = []
    for level in range(MAX_HALVINGS + 1):
        control = points[piece]
        borders, ribbon = _borders(control, start, stop, tolerance)
        discs = np.stack([_disc(control, u) for u in (start, stop)], 1)
        fits = ribbon | _straight(control, start, stop, discs, tolerance) | (level == MAX_HALVINGS)
        done.append(_Parts(piece, start, stop, ribbon, borders, discs).rows(fits))
        piece, start, stop = np.repeat(piece[~fits], 2), np.repeat(start[~fits], 2), np.repeat(stop[~fits], 2)
        middle = (start + stop) / 2
        start[1::2], stop[::2] = middle[1::2], middle[::2]
        if not len(piece):
            break
    columns: list[Any] = [np.concatenate(column) for column in zip(*done, strict=True)]
    parts = _Parts(*columns)
    return parts.rows(np.lexsort((parts.start, parts.piece)))


def _disc(control: Cubics, u: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b = 1 - u, u
    basis = np.stack([a**3, 3 * a**2 * b, 3 * a * b**2, b**3], -1)
    value: NDArray[np.float64] = np.einsum("pk,pkd->pd", basis, control)
    return value


def _slope(control: Cubics, u: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b = 1 - u, u
    basis = 3 * np.stack([a**2, 2 * a * b, b**2], -1)
    value: NDArray[np.float64] = np.einsum("pk,pkd->pd", basis, np.diff(control, axis=1))
    return value


def _border(control: Cubics, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both borders, (P, 2, 2), and their directions; NaN where discs hold one another."""
    disc, slope = _disc(control, u), _slope(control, u)
    speed = np.linalg.norm(slope[:, :2], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = np.where(np.abs(slope[:, 2]) < speed, -slope[:, 2] / speed, np.nan)
        normals = _normals(slope[:, :2] / speed[:, None], sine)
    directions = np.stack([normals[..., 1], -normals[..., 0]], -1)
    directions[:, 1] *= -1
    return disc[:, None, :2] + disc[:, None, 2:] * normals, directions


def _borders(
    control: Cubics, start: NDArray[np.float64], stop: NDArray[np.float64], tolerance: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Cubics for both borders, by ends, directions and speeds there; and whether they run forward and are near."""
    span = stop - start
    fine = np.ones(len(control), bool)
    found = {}
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        u = start + share * span
        place, direction = _border(control, u)
        step = STEP * span[:, None, None]
        velocity = (_border(control, u + step[:, 0, 0])[0] - _border(control, u - step[:, 0, 0])[0]) / (2 * step)
        forward = (velocity * direction).sum(-1)
        # NaN is not forward.
        fine &= (forward > 0).all(-1)
        found[share] = place, direction * (forward * span[:, None] / 3)[..., None]
    (first, leaving), (last, arriving) = found[0.0], found[1.0]
    cubics = np.stack([first, first + leaving, last - arriving, last], 2)
    with np.errstate(invalid="ignore"):
        for share in (0.25, 0.5, 0.75):
            a, b = 1 - share, share
            near = a**3 * cubics[:, :, 0] + 3 * a * a * b * cubics[:, :, 1] + 3 * a * b * b * cubics[:, :, 2]
            off = np.linalg.norm(near + b**3 * cubics[:, :, 3] - found[share][0], axis=-1)
            fine &= (off <= tolerance).all(-1)
    return cubics, fine


def _straight(
    control: Cubics,
    start: NDArray[np.float64],
    stop: NDArray[np.float64],
    discs: NDArray[np.float64],
    tolerance: float,
) -> NDArray[np.bool_]:
    """Whether the discs in between are nearly those that go evenly from the first to the last."""
    off = np.zeros(len(control))
    for share in (0.25, 0.5, 0.75):
        even = discs[:, 0] + share * (discs[:, 1] - discs[:, 0])
        gap = _disc(control, start + share * (stop - start)) - even
        off = np.maximum(off, np.linalg.norm(gap[:, :2], axis=-1) + np.abs(gap[:, 2]))
    return off <= tolerance
