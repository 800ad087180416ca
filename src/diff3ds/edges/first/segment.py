"""Chains of points cut into the fewest lines, arcs and cubics that fit."""

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.curves.fit_cubics import EVEN, ROUNDS
from diff3ds.curves.shapes.primitives import (
    CIRCLE_ROUNDS,
    FREEDOM,
    MOST_SWEEP,
    ONE_WAY,
    POINT_SCATTER,
    SETTLED,
    WAVERING,
    Kind,
    Primitive,
    fit_arcs,
    fit_cubic,
    fit_line,
)
from diff3ds.curves.shapes.straight_lines import resampled
from diff3ds.render.backends import kernels

# [scatters; empirical] Points on a chain that are farther off count no more, in units of their scatter: a stray point
# is no reason for another curve.
STRAY = 3.0
# [square scatters; derived] Price of a free number in the same units as a point's squared distance over scatter.
PRICE = 1.0
# [%, px; empirical] A fit is good if so many of the points lie within this.
MOST, GOOD = 95, 1.0
# [px; empirical] An arc rises over its chord by at least this: less may be scatter of a line.
RISE = 1.2
# [px, points; speed] Spacing of points along a chain, and at how many of them it may be cut at most.
SPACING, CUTS = 1.0, 32


def segmented(chain: Float[Array, "M 3"], pixel: float) -> list[Primitive]:
    """The strokes of one chain, in order."""
    points = resampled(chain, SPACING * pixel)
    if len(points) < 4:
        return [fit_line(points)]
    arcs = fit_arcs(points, RISE * pixel)
    far_around = len(arcs) == 2 or (len(arcs) == 1 and arcs[0].kind == Kind.CIRCLE)
    if far_around and _is_good(arcs[0], pixel):
        return arcs
    best, cost = _best(points, pixel)
    # One stroke that fits needs no search.
    if best.kind != Kind.FREE and _is_good(best, pixel) and cost < FREEDOM[best.kind] + len(points):
        return [best]
    return _cut(points, pixel)


def _is_good(primitive: Primitive, pixel: float) -> bool:
    return bool(np.percentile(primitive.distances, MOST) < GOOD * pixel)


def _best(points: Float[Array, "M 3"], pixel: float, below: float = np.inf) -> tuple[Primitive, float]:
    """The cheapest single stroke and its cost; those of which the free numbers alone cost more are not fitted.

    Args:
        below: a higher cost is of no interest.
    """
    best = fit_line(points)
    cost = _cost(best, pixel)
    for kind in (Kind.ARC, Kind.FREE):
        if PRICE * FREEDOM[kind] >= min(cost, below):
            break
        found = fit_arcs(points, RISE * pixel) if kind == Kind.ARC else [fit_cubic(points)]
        if len(found) == 1 and found[0].kind == kind and _cost(found[0], pixel) < cost:
            best, cost = found[0], _cost(found[0], pixel)
    return best, cost


def _cost(primitive: Primitive, pixel: float) -> float:
    off = np.minimum(primitive.distances / (POINT_SCATTER * pixel), STRAY)
    return float((off**2).sum() + PRICE * FREEDOM[primitive.kind])


def _cut(points: Float[Array, "M 3"], pixel: float) -> list[Primitive]:
    """The cheapest sequence of strokes."""
    places = np.unique(np.linspace(0, len(points) - 1, min(CUTS, len(points))).round().astype(np.int64))
    start, stop = _starts(points, places, pixel), len(places) - 1
    found: list[Primitive] = []
    while stop > 0:
        part = points[places[start[stop]] : places[stop] + 1]
        found.insert(0, _best(part, pixel)[0] if len(part) >= 4 else fit_line(part))
        stop = int(start[stop])
    return found


def _starts(points: Float[Array, "M 3"], places: Int[Index, " P"], pixel: float) -> Int[Index, " P"]:
    """For each place where the last stroke of the cheapest sequence up to there begins: by dynamic programming."""
    if kernel := getattr(kernels(), "edges_cut", None):
        given = torch.from_numpy(points), torch.from_numpy(places)
        limits = POINT_SCATTER * pixel, STRAY, RISE * pixel
        prices = [PRICE * FREEDOM[kind] for kind in (Kind.LINE, Kind.ARC, Kind.FREE)]
        fits = [ONE_WAY, WAVERING, MOST_SWEEP], SETTLED, EVEN, CIRCLE_ROUNDS, ROUNDS
        return np.asarray(kernel(*given, *limits, prices, *fits)).view(np.int64)
    cost = np.full(len(places), np.inf)
    cost[0] = 0.0
    last = np.zeros(len(places), np.int64)
    least, open_ = np.zeros(len(places)), np.ones(len(places), bool)
    for stop in range(1, len(places)):
        for start in np.nonzero(open_[:stop])[0].tolist():
            part = points[places[start] : places[stop] + 1]
            left = cost[stop] - cost[start]
            # Many starts cost too much already with the cheapest stroke from there.
            if (len(part) < 3 and start > 0) or left <= PRICE * FREEDOM[Kind.LINE]:
                continue
            price = _best(part, pixel, left)[1] if len(part) >= 4 else PRICE * FREEDOM[Kind.LINE]
            if cost[start] + price < cost[stop]:
                cost[stop], last[stop] = cost[start] + price, start
            if left > PRICE * FREEDOM[Kind.FREE]:
                least[start] = cost[start] + price - PRICE * FREEDOM[Kind.FREE]
        # Points only add to costs: a start that costs more here than other ways does so from here on (PELT, Killick et
        # al. 2012).
        open_[:stop] &= least[:stop] < cost[stop]
    return last
