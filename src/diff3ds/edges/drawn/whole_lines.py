"""From curves that views agree on to lines as a person draws them: the steps in their order."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves, concatenated, sampled
from diff3ds.edges.clean.simplify import Gaps, joined, pruned
from diff3ds.edges.clean.weld import welded
from diff3ds.edges.drawn.gaps import contradicted
from diff3ds.edges.drawn.grown import grown
from diff3ds.edges.drawn.junctions import POINTS, with_junctions
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import owners, samples

# [natural logarithms, natural logarithms a view; empirical] A curve is there if what all views show of it is so much
# likelier than by chance, in the mean over its points; where views are few, so much a view, for they cannot say more.
LIKELY, EACH_VIEW = 10.0, 0.8
# [natural logarithms a view; empirical] What grows at a line's end needs less where views are few: the line is there.
EACH_GROWING = 0.4
# [px, px; empirical] Gaps in a line, and how far from one curve the points of its pieces may lie.
GAP, WITHIN = 24.0, 1.2
# [px; empirical] Lines so near to each other, such as both edges of a thin plate or of a groove, are one: the pen draws
# no two there.
DOUBLED = 4.0
# [px; empirical] Ends that have something so near are not free.
MEETS = 1.0
# [fraction, fraction; empirical] Of the drawing's box: lines that hold on to no others are longer together, and those
# with one loose end.
SCRAP, TWIG = 0.08, 0.03
# [px, px; empirical] Lines so long are no scraps and no twigs in any case: large pictures show large things in detail.
LONG_SCRAP, LONG_TWIG = 24.0, 9.0
# [natural logarithms times px; empirical] The evidence of lines that hold on to no others, times their lengths: chance
# makes short ones everywhere.
ALONE = 220.0
# [rounds; empirical] What has grown has loose ends itself.
ROUNDS = 2


def whole_lines(
    curves: Curves,
    chance: Chance,
    refined: Callable[[Curves], Curves],
    rest: Callable[[Curves], EdgeViews],
) -> Curves:
    """Fewer, longer lines that begin and end at others.

    Args:
        chance: of the views.
        refined: moves curves to where the views show them; vertices stay shared.
        rest: the views with the edges that curves do not explain.
    """
    views = chance.views
    pixel = views.pixel
    curves = without_scraps(_brought_together(likely(curves, chance), chance), chance)
    for _ in range(ROUNDS):
        more = grown(curves, _loose(curves, pixel), chance, rest(curves), _least(chance, EACH_GROWING))
        if not len(more):
            break
        curves = without_scraps(_brought_together(concatenated(curves, more), chance), chance)
    curves = likely(refined(curves), chance)
    curves = pruned(curves, views, 0.0, 0.0, DOUBLED)
    curves = with_junctions(without_scraps(curves, chance), chance)
    return without_scraps(likely(curves, chance), chance)


def _brought_together(curves: Curves, chance: Chance) -> Curves:
    """Curves that continue each other as one, ends on the lines that they nearly meet."""
    gaps = Gaps(GAP, WITHIN, lambda start, stop: not contradicted(chance, start, stop))
    pixel = chance.views.pixel
    return with_junctions(welded(joined(curves, pixel, gaps=gaps), pixel), chance)


def likely(curves: Curves, chance: Chance) -> Curves:
    """The curves that are likelier to be there than to have come together by chance; all, if none is."""
    kept = _evidence(curves, chance) > _least(chance, EACH_VIEW)
    return curves[torch.from_numpy(kept)] if kept.any() else curves


def _least(chance: Chance, each: float) -> float:
    """The evidence that curves have in the mean, where views are few so much a view: natural logarithms."""
    return min(LIKELY, each * len(chance.views))


def likelier(before: Curves, after: Curves, chance: Chance) -> Curves:
    """The curves after they were moved, and those before of which that is less likely: texture draws them aside."""
    worse = torch.from_numpy(_evidence(after, chance) < _evidence(before, chance))
    return after.moved(torch.where(worse[:, None, None], before.points, after.points))


def _evidence(curves: Curves, chance: Chance) -> Float[Array, " N"]:
    """Of each curve the mean over its points, natural logarithms."""
    x, tangents = samples(curves)
    owner, count = owners(curves), len(curves)
    return np.bincount(owner, chance.evidence(x, tangents), count) / np.bincount(owner, minlength=count)


def without_scraps(curves: Curves, chance: Chance) -> Curves:
    """Without short loose ends, and without lines that hold on to no others, unless these are sure, or long.

    What such lines had held goes as well.
    """
    from scipy.sparse.csgraph import connected_components

    pixel, told = chance.views.pixel, _evidence(curves, chance)
    while len(curves):
        fine = sampled(curves, POINTS)
        length = np.linalg.norm(np.diff(fine, axis=1), axis=2).sum(1)
        meeting, loose = _meeting(curves, fine, MEETS * pixel)
        box = float(np.ptp(fine.reshape(-1, 3), axis=0).max())
        group = connected_components(meeting, directed=False)[1]
        whole, sure = (np.bincount(group, value)[group] for value in (length, told * length / pixel))
        scrap, twig = min(SCRAP * box, LONG_SCRAP * pixel), min(TWIG * box, LONG_TWIG * pixel)
        short = (whole < scrap) | (sure < ALONE) | ((loose.sum(1) == 1) & (length < twig))
        if not short.any() or short.all():
            break
        curves, told = curves[torch.from_numpy(~short)], told[~short]
    return curves


def _loose(curves: Curves, pixel: float) -> Bool[NDArray[np.bool_], "N 2"]:
    """Which ends meet no other curve."""
    return _meeting(curves, sampled(curves, POINTS), MEETS * pixel)[1]


def _meeting(curves: Curves, fine: Float[Array, "N P 3"], near: float) -> tuple[Any, Bool[NDArray[np.bool_], "N 2"]]:
    """Which curves meet others with an end, as a sparse matrix, and which ends meet none."""
    from scipy.sparse import coo_array
    from scipy.spatial import cKDTree

    number, count = fine.shape[:2]
    steps = float(np.linalg.norm(np.diff(fine, axis=1), axis=2).max())
    found = cKDTree(fine.reshape(-1, 3)).query_ball_point(fine[:, [0, -1]], max(near, 0.6 * steps))
    pairs, loose = [], np.zeros((number, 2), bool)
    for curve in np.nonzero(~curves.closed.numpy())[0].tolist():
        for end in (0, 1):
            others = {place // count for place in found[curve, end]} - {curve}
            pairs += [(curve, other) for other in others]
            loose[curve, end] = not others
    one, other = np.array(pairs, np.int64).reshape(-1, 2).T
    return coo_array((np.ones(len(one)), (one, other)), shape=(number, number)), loose
