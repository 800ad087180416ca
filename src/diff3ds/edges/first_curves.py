"""The first curves: cells near ridges, points on edges, chains of them, and the lines, arcs and cubics of these."""

from collections.abc import Callable

import torch

from diff3ds._shapes import Array, Float
from diff3ds.curves.shapes.curve_set import Curves, curves_of
from diff3ds.curves.shapes.primitives import Primitive
from diff3ds.edges.clean.own_ridges import with_own_ridges
from diff3ds.edges.drawn.whole_lines import likely
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import CHORDS, mean_of_segments, part_support
from diff3ds.edges.first.carve import CELL, carve
from diff3ds.edges.first.circles import find_circles
from diff3ds.edges.first.ridge_chains import APART, follow_chains
from diff3ds.edges.first.segment import segmented
from diff3ds.edges.first.triangulate import EdgePoints, thinned, triangulate
from diff3ds.edges.watch import Capped, Tick, no_tick, not_said
from diff3ds.parallel.in_copies import in_copies

# [units; derived] Half the side of the cube that is carved; the views' frame puts what they show into the unit ball.
REACH = 1.1
# [px; empirical] Distances from the flanks of an edge, and shortest chain.
FLANK, SHORTEST_CHAIN = 1.4, 4.3
# [ratio; empirical] The scores of points are weighted views.
SCORE = 0.9
# [natural logarithms; empirical] Points of photographs are so much likelier to lie on an edge than to have come
# together by chance: less than curves have to be, in the mean.
LIKELY_POINT = 6.0
# [curves; speed] More curves than a coloured sketch has strokes are no sketch; each is looked at in all views again
# and again.
MOST_CURVES = 1500
# [curves; speed] Of photographs fewer, and where there are more only those with ridges of their own: a drawing has no
# more lines.
MOST_OF_PHOTOGRAPHS = 500


def first_curves(
    views: EdgeViews,
    min_views: float,
    ticks: Callable[[str], Tick] = lambda stage: no_tick,
    capped: Capped = not_said,
    *,
    most: int = MOST_CURVES,
    textured: bool = False,
) -> Curves:
    """Lines, arcs and cubics through triangulated points, as they come.

    Args:
        min_views: so many views confirm an edge.
        ticks: gives for the name of a stage what is told how far it is.
        capped: see `watch`.
        most: so many curves, those that the views show most of.
        textured: points that may have come together by chance go.
    """
    found = edge_points(views, cells_near(views, min_views, ticks, capped), min_views, ticks)
    return curves_through(found, views, ticks, capped, most=most, textured=textured)


def cells_near(views: EdgeViews, min_views: float, ticks: Callable[[str], Tick], capped: Capped) -> Float[Array, "M 3"]:
    """Centres of the cells near edges that so many views confirm; arguments as for `first_curves`."""
    return carve(views, REACH, CELL * views.pixel, min_views, ticks("carve"), capped)


def edge_points(
    views: EdgeViews, cells: Float[Array, "M 3"], min_views: float, ticks: Callable[[str], Tick]
) -> EdgePoints:
    """Points on edges that so many views confirm, apart from each other; arguments as for `first_curves`.

    Args:
        cells: places near edges.
    """
    found = triangulate(views, cells, SCORE * min_views, ticks("points on edges"))
    return thinned(found, APART * views.pixel, FLANK * views.pixel)


def curves_through(
    found: EdgePoints,
    views: EdgeViews,
    ticks: Callable[[str], Tick],
    capped: Capped,
    *,
    most: int = MOST_CURVES,
    textured: bool = False,
) -> Curves:
    """Lines, arcs and cubics through points; other arguments as for `first_curves`."""
    chance = Chance.of(views) if textured else None
    if chance is not None:
        found = found[chance.evidence(found.points, found.directions) > LIKELY_POINT]
    tick = ticks("first curves")
    known: dict[bytes, list[Primitive]] = {}

    def pieces(points: EdgePoints) -> list[Primitive]:
        chains = follow_chains(points, views.pixel, SHORTEST_CHAIN * views.pixel)
        # Most chains are the same without the circles.
        new = [chain for chain in chains if chain.tobytes() not in known]
        found = in_copies(
            lambda k: segmented(new[k], views.pixel), len(new), len(new), lambda done: tick(done, len(new))
        )
        known.update(zip((chain.tobytes() for chain in new), found, strict=True))
        return [piece for chain in chains for piece in known[chain.tobytes()]]

    first = pieces(found)
    circles, rest = find_circles(found, first, views.pixel)
    curves = curves_of([*(pieces(rest) if circles else first), *circles])
    if chance is not None:
        curves, most = likely(curves, chance), min(most, MOST_OF_PHOTOGRAPHS)
        # Doubles of some hundred are told apart better when they have been refined.
        return with_own_ridges(curves, views, most, capped) if len(curves) > most else curves
    return _best_shown(curves, views, most, capped)


def _best_shown(curves: Curves, views: EdgeViews, most: int, capped: Capped) -> Curves:
    """The curves that the views show most of, if there are very many: by their lengths, times the views."""
    if len(curves) <= most:
        return curves
    capped("curves", most, len(curves))
    shown = mean_of_segments(curves, part_support(views, curves).double().mean(2).sum(0))
    lines = curves.at(torch.linspace(0, 1, CHORDS + 1))
    ink = shown * (lines[:, 1:] - lines[:, :-1]).norm(dim=2).sum(1)
    return curves[ink.argsort(descending=True, stable=True)[:most].sort().values]
