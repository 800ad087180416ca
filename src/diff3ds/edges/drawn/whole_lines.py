"""From curves that views agree on to lines as a person draws them: the steps in their order."""

from collections.abc import Callable

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Mask
from diff3ds.curves.shapes.curve_set import Curves, sampled
from diff3ds.edges.clean.simplify import Gaps, joined, pruned
from diff3ds.edges.clean.weld import welded
from diff3ds.edges.drawn.gaps import contradicted
from diff3ds.edges.drawn.junctions import POINTS, with_junctions
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.support import owners, samples

# [natural logarithms; empirical] A curve is there if what all views show of it is so much likelier than by chance, in
# the mean over its points.
LIKELY = 4.5
# [px, px; empirical] Gaps in a line, and how far from one curve the points of its pieces may lie.
GAP, WITHIN = 24.0, 1.2
# [px; empirical] Lines so near to each other, such as both edges of a thin plate or of a groove, are one: the pen draws
# no two there.
DOUBLED = 4.0
# [px; empirical] Ends that have something so near are not free.
MEETS = 1.0
# [fraction, fraction; empirical] Of the drawing's box: lines that are free at both ends are longer, and those that are
# free at one.
SCRAP, TWIG = 0.08, 0.03


def whole_lines(curves: Curves, chance: Chance, refined: Callable[[Curves], Curves]) -> Curves:
    """Fewer, longer lines that begin and end at others.

    Args:
        chance: of the views.
        refined: moves curves to where the views show them; vertices stay shared.
    """
    views = chance.views
    pixel = views.pixel
    curves = likely(curves, chance)
    gaps = Gaps(GAP, WITHIN, lambda start, stop: not contradicted(chance, start, stop))
    curves = with_junctions(welded(joined(curves, pixel, gaps=gaps), pixel), chance)
    curves = likely(refined(without_scraps(curves, pixel)), chance)
    curves = pruned(curves, views, 0.0, 0.0, DOUBLED)
    return without_scraps(with_junctions(without_scraps(curves, pixel), chance), pixel)


def likely(curves: Curves, chance: Chance) -> Curves:
    """The curves that are likelier to be there than to have come together by chance; all, if none is."""
    x, tangents = samples(curves)
    owner = owners(curves)
    told = np.bincount(owner, chance.evidence(x, tangents), len(curves)) / np.bincount(owner, minlength=len(curves))
    kept = told > LIKELY
    return curves[torch.from_numpy(kept)] if kept.any() else curves


def without_scraps(curves: Curves, pixel: float) -> Curves:
    """Without short lines that hang free; those that these had held go as well."""
    while len(curves):
        fine = sampled(curves, POINTS)
        length = np.linalg.norm(np.diff(fine, axis=1), axis=2).sum(1)
        free = free_ends(curves, fine, MEETS * pixel).sum(1)
        box = float(np.ptp(fine.reshape(-1, 3), axis=0).max())
        short = length < np.choose(free, [0.0, TWIG * box, SCRAP * box])
        if not short.any() or short.all():
            break
        curves = curves[torch.from_numpy(~short)]
    return curves


def free_ends(curves: Curves, fine: Float[Array, "N P 3"], near: float) -> Bool[Mask, "N 2"]:
    """Which ends (start, stop) have no other curve near them; closed curves have none."""
    from scipy.spatial import cKDTree

    count = fine.shape[1]
    steps = np.linalg.norm(np.diff(fine, axis=1), axis=2).max() if len(fine) else 0.0
    tree = cKDTree(fine.reshape(-1, 3))
    found = tree.query_ball_point(fine[:, [0, -1]], max(near, 0.6 * steps))
    free = np.array([[all(k // count == i for k in end) for end in ends] for i, ends in enumerate(found)])
    return free.reshape(-1, 2) & ~curves.closed.numpy()[:, None]
