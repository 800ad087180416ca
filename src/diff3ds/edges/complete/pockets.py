"""Bottoms of pockets and far ends of holes: the rim again, deeper down, where the views that look in show it.

Few views look to the bottom of a pocket, too few to confirm its edges one by one. But the rim says which views see
which place of a bottom at a given depth, for the line of sight has to pass the rim; and they show all of it or none.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves, concatenated, sampled
from diff3ds.curves.shapes.straight_lines import resampled
from diff3ds.edges.clean.weld import WITHIN
from diff3ds.edges.complete.hypothesis import PATH_SPACING, SEEN, Hypothesis, fraction_shown, is_told, pieces_of
from diff3ds.edges.complete.loops import Loop, find_loops
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import PARTS, SAMPLES, crowded, samples
from diff3ds.edges.measure.holes import INSIDE, SHALLOWEST
from diff3ds.edges.measure.offsets import STEP_ALONG, fitted
from diff3ds.edges.watch import Tick, no_tick

# Places around a rim: a multiple of the samples of a part.
PLACES = 2 * PARTS * SAMPLES
# [px; empirical] Steps of the depths that are tried.
STEP = 1.0
# [fraction, fraction; measured] Of the views that should see the sample points of a bottom this fraction has to show
# them, all in all, and of the sample points this fraction in half of their views or more, and in two at least. In 60
# reconstructions of generated parts 48 bottoms have both; of 934 sides of rims without one, each at its best depth,
# three, two of them a pixel or two beside a true one.
SHOWN, COVERED = 0.55, 0.4
# [views, fraction; empirical] So many views have to look at a sample point, for this fraction of the sample points.
FEWEST, LOOKED_AT = 2, 0.6
# [fraction; empirical] A bottom is there already if other curves are as near to this fraction of it as ends that meet:
# what shows it from outside says better how deep it lies.
THERE = 0.95

Flags = Bool[NDArray[np.bool_], "V S"]


def with_pockets(
    curves: Curves, views: EdgeViews, outward: float, tick: Tick = no_tick, chance: Chance | None = None
) -> Curves:
    """The curves with the bottoms of pockets that the views show, instead of pieces along them.

    Args:
        outward: offset of outlines that the detector has, pixels.
        tick: see `watch`.
        chance: of photographs with faint edges; what the views that look to a bottom show has to be likelier one.
    """
    bottoms: list[Curves] = []
    rims: list[int] = []
    # As they are drawn: an end that leaves a vertex must not move the others.
    drawn = curves.moved(curves.points)
    loops = find_loops(curves, views.pixel)
    for done, loop in enumerate(loops):
        tick(done, len(loops))
        for side in (1.0, -1.0):
            depth = _depth(loop, side, curves, views, chance)
            if depth is None:
                continue
            way = _fitted_way(loop, depth, views, outward)
            rim = drawn[torch.tensor(sorted(loop.members))]
            bottom = replace(rim, points=rim.points + torch.from_numpy(way).to(rim.points.dtype))
            if _off(bottom, [curves, *bottoms], WITHIN * views.pixel) > 1 - THERE:
                bottoms.append(bottom)
                rims += loop.members
    if not bottoms:
        return curves
    gone = np.zeros(len(curves), bool)
    for bottom in bottoms:
        gone |= pieces_of(np.concatenate(_dense(bottom, PATH_SPACING * views.pixel)), sampled(curves), views.pixel)
    gone[rims] = False
    found = drawn[torch.from_numpy(~gone)]
    for bottom in bottoms:
        found = _welded(found, bottom, views.pixel)
    return found


def _depth(loop: Loop, side: float, curves: Curves, views: EdgeViews, chance: Chance | None) -> float | None:
    """How far along its normal the rim appears again, world units; None if it does not."""
    found = []
    for depth in side * views.pixel * np.arange(SHALLOWEST, 2 / views.pixel, STEP):
        if np.linalg.norm(loop.sample_points(PLACES)[0] + depth * loop.normal, axis=1).min() > 1:
            break
        seen, looked = _seen(loop, depth, views)
        if not _many(looked):
            break
        score = _score(loop, float(depth), seen, looked, chance)
        if score is not None:
            found.append((score, float(depth)))
    # Where another curve appears in the same place, it explains the ridge.
    for _, depth in sorted(found, key=lambda one: (-one[0], abs(one[1]))):
        clear = ~_beside_others(loop, depth, curves, views)
        seen, looked = (flags & clear for flags in _seen(loop, depth, views))
        if _many(looked) and _score(loop, depth, seen, looked, chance) is not None:
            return depth
    return None


def _score(loop: Loop, depth: float, seen: Flags, looked: Flags, chance: Chance | None) -> float | None:
    """How well the views that look at a bottom show it; None if they do not."""
    if chance is None:
        return float(seen.sum() / looked.sum()) if _confirmed(seen, looked) else None
    x, tangents, _ = loop.sample_points(PLACES)
    told = chance.evidence(x + depth * loop.normal, tangents, looked)
    return float(told.mean()) if is_told(told) else None


def _many(looked: Flags) -> bool:
    """Whether enough views look at most sample points."""
    return bool(fraction_shown(looked, FEWEST) >= LOOKED_AT)


def _confirmed(seen: Flags, looked: Flags) -> bool:
    """Whether the views that look at a bottom show it."""
    min_views = np.maximum(looked.sum(0) / 2, FEWEST)
    return bool(seen.sum() >= SHOWN * looked.sum() and fraction_shown(seen, min_views) >= COVERED)


def _seen(
    loop: Loop, depth: float, views: EdgeViews
) -> tuple[Bool[NDArray[np.bool_], "V S"], Bool[NDArray[np.bool_], "V S"]]:
    """Which views show which sample points of a bottom, and which of them look there through the rim."""
    x, tangents, inwards = loop.sample_points(PLACES)
    below = x + depth * loop.normal
    looked = _looked_at(loop, depth, below + INSIDE * views.pixel * inwards, views)
    return Hypothesis(below, tangents).shown(views, SEEN) & looked, looked


def _beside_others(loop: Loop, depth: float, curves: Curves, views: EdgeViews) -> Bool[NDArray[np.bool_], "V S"]:
    """Where another curve appears beside a sample point of a bottom, running the same way."""
    places, along, _ = loop.sample_points(PLACES)
    x, tangents = samples(curves)
    both = np.concatenate([places + depth * loop.normal, x]), np.concatenate([along, tangents])
    others = np.arange(len(both[0])) >= PLACES
    asked = np.broadcast_to(~others, (len(views), len(others)))
    return crowded(views, *both, by=others, at=asked)[:, :PLACES]


def _looked_at(loop: Loop, depth: float, x: Float[Array, "S 3"], views: EdgeViews) -> Bool[NDArray[np.bool_], "V S"]:
    """Which views see points below the rim: from the other side of its plane, through the rim."""
    eye = views.centers[:, None]
    sight = x - eye
    fall = sight @ loop.normal
    along = ((loop.origin - eye) @ loop.normal) / np.where(np.abs(fall) < 1e-12, 1e-12, fall)
    front = (views.centers - loop.origin) @ loop.normal * depth < 0
    found = np.zeros(sight.shape[:2], bool)
    found[front] = loop.holds((eye + along[..., None] * sight)[front])
    return found


def _fitted_way(loop: Loop, depth: float, views: EdgeViews, outward: float) -> Float[Array, " 3"]:
    """The way from the rim to the bottom that agrees best with the ridges."""
    x, tangents, _ = loop.sample_points(PLACES)
    below = x + depth * loop.normal
    seen = _seen(loop, depth, views)[0]
    steps = STEP_ALONG * views.pixel * np.array([-1.0, 0.0, 1.0])[:, None, None] * tangents

    def moved(value: Float[Array, " 1"]) -> Float[Array, "3 S 3"]:
        return below + value[0] * loop.normal + steps

    found = float(fitted(moved, 1, loop.origin + depth * loop.normal, seen, views, outward)[0])
    return (depth + found) * loop.normal


def _off(bottom: Curves, others: list[Curves], distance: float) -> float:
    """The fraction of a bottom that is farther than this from the other curves."""
    from scipy.spatial import cKDTree

    there = np.concatenate([line for curves in others for line in _dense(curves, distance / 4)])
    return float((cKDTree(there).query(np.concatenate(_dense(bottom, distance / 4)))[0] > distance).mean())


def _dense(curves: Curves, step: float) -> list[Array]:
    """Points along each curve, so far apart."""
    return [resampled(line, step) for line in sampled(curves)]


def _welded(curves: Curves, bottom: Curves, pixel: float) -> Curves:
    """Both, with shared vertices where ends of the first lie at ends of the second."""
    joined = concatenated(curves, bottom)
    vertex, closed = joined.vertex.clone(), joined.closed
    ends = joined.constrained(joined.points)[0][:, [0, 3]].double()
    first = len(curves)
    # Each end of before goes to one vertex of the bottom: two of them in one would leave a curve without length.
    taken: set[int] = set()
    for i, end in product(range(first, len(joined)), (0, 1)):
        off = (ends[:first] - ends[i, end]).norm(dim=2)
        off[closed[:first]] = torch.inf
        row, k = divmod(int(off.argmin()), 2)
        name, old = int(vertex[i, end]), int(vertex[row, k])
        if not closed[i] and float(off[row, k]) < WITHIN * pixel and old not in taken:
            vertex[vertex == old] = name
            taken.add(name)
    return replace(joined, vertex=vertex)
