"""Rounded corners between two lines where no arc was found, or pieces that are none: tried, and kept if views show it.

A small arc breaks up into pieces, or is lost where another edge runs beside it. But the lines that it joins say nearly
everything about it: it touches both, so that only its size is open.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Kind, Primitive
from diff3ds.curves.shapes.smooth_joints import TURN
from diff3ds.curves.shapes.straight_lines import meeting, resampled, tangents_of
from diff3ds.edges.complete.hypothesis import (
    COVERED,
    PATH_SPACING,
    PIECE_FRACTION,
    PIECE_WITHIN,
    SHOWN,
    Hypothesis,
    fraction_shown,
    pieces_of,
)
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import NEAR, inliers
from diff3ds.edges.measure.fillets import fillets_of, tangent_arc
from diff3ds.edges.measure.planes import SAMPLES
from diff3ds.edges.watch import Tick, no_tick
from diff3ds.parallel.in_copies import in_copies

# [px; empirical] Lines that meet pass each other within this, and one of them ends so far from there at least, as far
# as an arc lies that is told from a sharp corner; they may go so far into the arc; the longest tangents; a line is no
# longer one if a corner leaves less of it.
PASS, OPEN, BEYOND, LONGEST, REST = 1.5, 2.5, 8.0, 45.0, 4.0
# [px; empirical] A ridge that shows a sample point of an arc lies so near: nearer than other proposals ask for, as the
# lines beside it do not end there.
SEEN = 0.8
# [px; measured] Ridges lie nearer to the arc than to what was there by so much: else it may be a chamfer or sharp. Of
# corners of 60 reconstructions of generated parts true ones gained .24 to .7, false ones .05 at most. Of several
# pieces, or where a bent one meets the lines at angles, the arc is the simpler one and must only be no worse.
NEARER = 0.1


@dataclass(frozen=True, eq=False)
class _Sides:
    """Two lines about to meet: numbers and ends (0 or 1), where they meet, unit vectors away, how far the ends are."""

    lines: tuple[int, int]
    ends: tuple[int, int]
    place: Float[Array, " 3"]
    ways: list[Array]
    near: list[float]
    far: list[float]


@dataclass(frozen=True, eq=False)
class _Corner:
    """An arc between two lines, the curves that it replaces, and how many views show it: mean of its sample points."""

    sides: _Sides
    arc: Float[Array, "4 3"]
    pieces: tuple[int, ...]
    views: float


def with_corners(curves: Curves, views: EdgeViews, min_views: float, tick: Tick = no_tick) -> Curves:
    """The curves with an arc between two lines wherever enough views show one; its pieces go.

    Args:
        min_views: so many views confirm an edge.
        tick: see `watch`.
    """
    while corners := _best(curves, views, SHOWN * min_views, tick):
        for done, corner in enumerate(corners):
            number = np.cumsum(~np.isin(np.arange(len(curves)), corner.pieces)) - 1
            curves = _with(curves, corner)
            corners[done + 1 :] = [_renumbered(other, number) for other in corners[done + 1 :]]
    return curves


def _renumbered(corner: _Corner, number: NDArray[np.int64]) -> _Corner:
    """The corner with the numbers that its curves have now."""
    first, second = (int(number[line]) for line in corner.sides.lines)
    sides = replace(corner.sides, lines=(first, second))
    return replace(corner, sides=sides, pieces=tuple(int(number[i]) for i in corner.pieces))


def _best(curves: Curves, views: EdgeViews, min_views: float, tick: Tick) -> list[_Corner]:
    """The corner that replaces most pieces, of these the one that most views show; and so on, as far as the next ones
    lie so far from those that one says nothing of the other.
    """
    points = curves.constrained(curves.points)[0].double().numpy()
    samples = sampled(curves)
    # What is round already stays: each corner makes one more of them, so that this ends.
    round_ = _rounded(curves, points)
    alone = ~curves.closed.numpy() & ~np.array([round_.issuperset(ends) for ends in curves.vertex.tolist()], bool)
    straight = (curves.kind == Kind.LINE).numpy()
    lines = np.nonzero(straight)[0].tolist()
    free = [(line, end) for line in lines for end in (0, 1) if int(curves.vertex[line, end]) not in round_]
    bent = _bent_between_lines(curves)
    pairs = _meeting_pairs(points, free, views.pixel)
    every = [(pair, sides) for pair in pairs if (sides := _sides(points, *pair, views.pixel)) is not None]

    def corner_of(k: int) -> _Corner | None:
        pair, sides = every[k]
        corner = _corner(samples, alone, straight, sides, views, min_views)
        # An arc that ends where the corner would begin is a piece of it, or there is no room for one.
        here = {arc for line, end in pair for arc in bent.get(int(curves.vertex[line, end]), [])}
        return corner if corner is not None and here.issubset(corner.pieces) else None

    tried = in_copies(corner_of, len(every), len(every), lambda done: tick(done, len(every)))
    found = [corner for corner in tried if corner is not None]
    chosen: list[_Corner] = []
    for corner in sorted(found, key=lambda corner: (-len(corner.pieces), -corner.views)):
        if not any(_disturb(corner, other, views.pixel) for other in chosen):
            chosen.append(corner)
    return chosen


def _disturb(one: _Corner, other: _Corner, pixel: float) -> bool:
    """Whether two corners share a curve, or lie so near that one may be taken for a piece of the other."""
    if {*one.sides.lines, *one.pieces} & {*other.sides.lines, *other.pieces}:
        return True
    reach = [max(np.linalg.norm(c.arc - c.sides.place, axis=1).max(), *c.sides.near) for c in (one, other)]
    apart = np.linalg.norm(one.sides.place - other.sides.place)
    return bool(apart < sum(reach) + BEYOND * pixel)


def _meeting_pairs(
    points: Float[Array, "N 4 3"], free: list[tuple[int, int]], pixel: float
) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Pairs of ends of lines, not too far apart, of which the lines pass each other closely, if made longer."""
    from scipy.spatial import cKDTree

    if not free:
        return []
    line, end = np.array(free).T
    near, far = points[line, 3 * end], points[line, 3 - 3 * end]
    pairs = np.sort(cKDTree(near).query_pairs(2 * LONGEST * pixel, output_type="ndarray"), axis=1)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    first, second = pairs[line[pairs[:, 0]] != line[pairs[:, 1]]].T
    along = unit(near - far)
    across = np.cross(along[first], along[second])
    length = np.linalg.norm(across, axis=1)
    apart = np.abs(((near[second] - near[first]) * across).sum(1)) / np.maximum(length, 1e-9)
    close = apart <= PASS * pixel + 1e-9
    return [(free[i], free[k]) for i, k in zip(first[close], second[close], strict=True)]


def _rounded(curves: Curves, points: Float[Array, "N 4 3"]) -> set[int]:
    """The vertices at the ends of arcs that meet a line smoothly at both ends."""
    arcs = [f.arc for f in fillets_of(curves, points) if int(curves.kind[f.arc]) == Kind.ARC]
    return set(curves.vertex[arcs].flatten().tolist())


def _bent_between_lines(curves: Curves) -> dict[int, list[int]]:
    """By vertex, the arcs there that have lines at both ends."""
    straight = set(curves.vertex[curves.kind == Kind.LINE].flatten().tolist())
    found: dict[int, list[int]] = {}
    for arc in torch.nonzero(curves.kind == Kind.ARC)[:, 0].tolist():
        ends = curves.vertex[arc].tolist()
        for name in ends if straight.issuperset(ends) else []:
            found.setdefault(name, []).append(arc)
    return found


def _sides(points: Float[Array, "N 4 3"], one: tuple[int, int], other: tuple[int, int], pixel: float) -> _Sides | None:
    """Two ends of lines as the sides of a corner; None if the lines do not meet at an angle beyond both."""
    near = [points[line][3 * end] for line, end in (one, other)]
    far = [points[line][3 - 3 * end] for line, end in (one, other)]
    if np.linalg.norm(near[0] - near[1]) > 2 * LONGEST * pixel:
        return None
    place = meeting(far, near, PASS * pixel)
    if place is None:
        return None
    ways = [unit(f - place) for f in far]
    reach, room = ([float((p - place) @ way) for p, way in zip(ps, ways, strict=True)] for ps in (near, far))
    if abs(ways[0] @ ways[1]) > np.cos(TURN) or min(reach) < -PASS * pixel or max(reach) < OPEN * pixel:
        return None
    # The other ends are no sides of a corner here.
    if any(n >= f for n, f in zip(reach, room, strict=True)):
        return None
    return _Sides((one[0], other[0]), (one[1], other[1]), place, ways, reach, room)


def _corner(
    samples: Float[Array, "N S 3"],
    alone: Bool[NDArray[np.bool_], " N"],
    straight: Bool[NDArray[np.bool_], " N"],
    sides: _Sides,
    views: EdgeViews,
    min_views: float,
) -> _Corner | None:
    """The arc between two lines that enough views show at most of its sample points.

    None if they do not, or if the ridges lie no nearer to it than to what was there.

    Args:
        samples: of all curves.
        alone, straight: curves that may be pieces of a corner; lines.
    """
    pixel = views.pixel
    lengths = _lengths(sides, pixel)
    if not len(lengths):
        return None
    arcs = np.stack([tangent_arc(sides.place, sides.ways, length) for length in lengths])
    candidates = curves_of([Primitive(Kind.ARC, arc, np.zeros(0)) for arc in arcs])
    x = candidates.at((torch.arange(SAMPLES) + 0.5) / SAMPLES).double().numpy()
    shown = Hypothesis.through(x).shown(views, SEEN)
    good, mean_views = fraction_shown(shown, min_views), shown.sum(0).mean(1)
    best = int(np.lexsort((mean_views, good))[-1])
    if good[best] < COVERED:
        return None
    # To where the lines end now: a line may go on too far, or too little.
    stems = [
        resampled(sides.place + np.array([[lengths[best]], [near]]) * way, PATH_SPACING * pixel)
        for near, way in zip(sides.near, sides.ways, strict=True)
    ]
    longer = [stem for stem, near in zip(stems, sides.near, strict=True) if near > lengths[best] + pixel]
    stems_shown = (fraction_shown(Hypothesis.through(stem).shown(views, SEEN), min_views) for stem in longer)
    if any(fraction < COVERED for fraction in stems_shown):
        return None
    path = np.concatenate([stems[0][::-1], resampled(x[best], PATH_SPACING * pixel), stems[1]])
    along = pieces_of(path, samples, pixel) & alone
    along[list(sides.lines)] = False
    pieces = tuple(np.nonzero(along)[0].tolist())
    if _doubled(samples, {*pieces, *sides.lines}, x[best], pixel):
        return None
    nearer = 0.0 if len(pieces) > 1 or not straight[list(pieces)].all() else NEARER
    before = _before(samples, sides, pieces, lengths[best], pixel)
    if _off([x[best]], views, min_views) > _off(before, views, min_views) - nearer:
        return None
    return _Corner(sides, arcs[best], pieces, float(mean_views[best]))


def _before(
    samples: Float[Array, "N S 3"], sides: _Sides, pieces: tuple[int, ...], length: float, pixel: float
) -> list[Array]:
    """What the arc stands for: the pieces and lines as far as its ends, or the sharp corner."""
    lines = [resampled(samples[i], pixel) for i in (*pieces, *sides.lines)] if pieces else []
    near = [part for line in lines for part in _within(line, sides.place, length)]
    return near or [resampled(_sharp(sides, length), pixel)]


def _lengths(sides: _Sides, pixel: float) -> Float[Array, " L"]:
    """The lengths of tangents to try."""
    half = np.arccos(np.clip(sides.ways[0] @ sides.ways[1], -1, 1)) / 2
    shortest = OPEN * pixel * np.cos(half) / (1 - np.sin(half))
    longest = min(min(sides.far) - REST * pixel, max(sides.near) + BEYOND * pixel, LONGEST * pixel)
    return np.arange(shortest, longest, PATH_SPACING * pixel)


def _sharp(sides: _Sides, length: float) -> Float[Array, "3 3"]:
    """The corner if it is not round."""
    first, second = (sides.place + length * way for way in sides.ways)
    return np.stack([first, sides.place, second])


def _within(line: Float[Array, "M 3"], place: Float[Array, " 3"], radius: float) -> list[Array]:
    """The part of a line that is near a place, if there is any."""
    near = line[np.linalg.norm(line - place, axis=1) < radius]
    return [near] if len(near) > 1 else []


def _off(lines: list[Array], views: EdgeViews, min_views: float) -> float:
    """How near enough views have a ridge that runs along, pixels, mean over the sample points."""
    x, tangents = np.concatenate(lines), np.concatenate([tangents_of(line) for line in lines])
    match = views.match(x)
    across = np.abs(((views.points[match.ridge] - match.pixel) * views.normals[match.ridge]).sum(-1))
    off = np.sort(np.where(inliers(views, x, tangents), np.minimum(across, NEAR), NEAR), axis=0)
    return float(off[min(int(np.ceil(min_views)), len(off)) - 1].mean())


def _doubled(samples: Float[Array, "N S 3"], gone: set[int], x: Float[Array, "P 3"], pixel: float) -> bool:
    """Whether a curve that stays runs along part of the arc."""
    reach = PIECE_WITHIN * pixel
    near = ((samples.min(1) < x.max(0) + reach) & (samples.max(1) > x.min(0) - reach)).all(1)
    rest = [resampled(samples[i], PATH_SPACING * pixel) for i in np.nonzero(near)[0].tolist() if i not in gone]
    return bool(rest) and bool(pieces_of(np.concatenate(rest), x[None], pixel, fraction=1 - PIECE_FRACTION)[0])


def _with(curves: Curves, corner: _Corner) -> Curves:
    """The curves with the corner instead of its pieces, and its lines up to it."""
    # As they are drawn: an end that leaves a vertex must not move the others.
    points, vertex = curves.constrained(curves.points)[0].clone(), curves.vertex.clone()
    free = int(vertex.max()) + 1
    arc = torch.from_numpy(corner.arc).to(points.dtype)
    for k, (line, end) in enumerate(zip(corner.sides.lines, corner.sides.ends, strict=True)):
        start, stop = (arc[3 * k], points[line, 3]) if end == 0 else (points[line, 0], arc[3 * k])
        points[line] = start + torch.linspace(0, 1, 4)[:, None] * (stop - start)
        vertex[line, end] = free + k
    keep = torch.ones(len(curves), dtype=torch.bool)
    keep[list(corner.pieces)] = False
    rest = replace(curves, points=points, vertex=vertex)[keep]
    joined = concatenated(rest, curves_of([Primitive(Kind.ARC, corner.arc, np.zeros(0))]))
    vertex = joined.vertex.clone()
    vertex[-1] = torch.tensor([free, free + 1])
    return replace(joined, vertex=vertex)
