"""Chains of edge points: followed from the best points along their directions, one chain an edge."""

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import dot
from diff3ds.curves.shapes.straight_lines import polyline_length, resampled, tangents_of
from diff3ds.edges.first.triangulate import EdgePoints

# [px, px, cosine, px, ratio, cosine; empirical] The next point of a chain is so far away at most and so far ahead at
# least; at this angle to the direction at most; beside the tangent by at most the distance APART that points keep plus
# SIDEWAYS_SHARE of the way; and runs the same way.
REACH, NEAREST, AHEAD, APART, SIDEWAYS_SHARE, SAME_WAY = 3.1, 0.3, 0.35, 0.57, 0.15, 0.94
# [ratio; empirical] Between candidates, a pixel to the side counts as much as so many ahead.
SIDE_COST = 4.0
# [fraction; empirical] Weight of the newest point in the direction of a chain.
TURN = 0.5
# [px, cosine; empirical] Points within this distance of a finished chain that run along it belong to it.
TAKEN, TAKEN_COSINE = 1.3, 0.8
# [px; numerical] Spacing of the samples of chains for that.
SAMPLED = 0.4
# [points; empirical] A chain has so many points at least.
LEAST_POINTS = 4


def follow_chains(found: EdgePoints, pixel: float, shortest: float) -> list[Float[Array, "_ 3"]]:
    """Polylines along the edges; every point is used once.

    Args:
        pixel: world units of a pixel.
        shortest: length of a chain to stay, world units.
    """
    from scipy.spatial import cKDTree

    if not len(found):
        return []
    tree = cKDTree(found.points)
    near = [np.asarray(places, np.int64) for places in tree.query_ball_point(found.points, REACH * pixel)]
    used = np.zeros(len(found), bool)
    chains = []
    for start in np.argsort(-found.scores, kind="stable"):
        if used[start]:
            continue
        ahead = _followed(found, near, used, int(start), 1.0, pixel, [int(start)])
        back = _followed(found, near, used, int(start), -1.0, pixel, [int(start), *ahead])
        chain = [*back[::-1], int(start), *ahead]
        used[start] = True
        line = found.points[chain]
        if len(chain) < LEAST_POINTS or polyline_length(line) < shortest:
            continue
        used[chain] = True
        used[_beside(found, tree, line, pixel)] = True
        chains.append(line)
    return chains


def _followed(
    found: EdgePoints,
    near: list[NDArray[np.int64]],
    used: NDArray[np.bool_],
    start: int,
    sign: float,
    pixel: float,
    seen: list[int],
) -> list[int]:
    """Indices of the points after `start` in one direction; `near` are those around each."""
    part: list[int] = []
    free = ~used
    free[seen] = False
    at, heading = start, found.directions[start] * sign
    while True:
        following = _next(found, at, heading, near[at][free[near[at]]], pixel)
        if following is None:
            return part
        direction = found.directions[following]
        direction = direction * np.sign(direction @ heading)
        heading = (1 - TURN) * heading + TURN * direction
        heading /= np.sqrt(heading @ heading)
        at = following
        free[at] = False
        part.append(at)


def _next(found: EdgePoints, at: int, heading: Array, candidates: NDArray[np.int64], pixel: float) -> int | None:
    if not len(candidates):
        return None
    step = (found.points[candidates] - found.points[at]) / pixel
    square = dot(step, step)
    ahead = step @ heading
    aside = np.sqrt(np.maximum(square - ahead**2, 0))
    good = (ahead > AHEAD * np.sqrt(square)) & (ahead > NEAREST) & (aside < APART + SIDEWAYS_SHARE * ahead)
    good &= np.abs(found.directions[candidates] @ heading) > SAME_WAY
    cost = np.where(good, ahead + SIDE_COST * aside, np.inf)
    best = int(cost.argmin())
    return int(candidates[best]) if good[best] else None


def _beside(found: EdgePoints, tree: object, line: Array, pixel: float) -> NDArray[np.int64]:
    """Points that lie along a chain."""
    from scipy.spatial import cKDTree

    dense = resampled(line, SAMPLED * pixel)
    near = tree.query_ball_point(dense, TAKEN * pixel)  # type: ignore[attr-defined]
    others = np.unique(np.concatenate([np.asarray(n, np.int64) for n in near]))
    closest = cKDTree(dense).query(found.points[others])[1]
    along = np.abs((found.directions[others] * tangents_of(dense)[closest]).sum(1))
    return others[along > TAKEN_COSINE]
