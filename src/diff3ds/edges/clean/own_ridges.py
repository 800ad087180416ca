"""Curves that draw what no better one has drawn: bundles and doubles leave one, and so many stay at most.

In photographs one edge brings about several curves: both sides of a joint, or one at every depth where all cameras lie
in a plane with it. All of them are shown by the same ridges. Taken in the order of what each adds, the others have no
ridges left.
"""

import numpy as np
import torch

from diff3ds._shapes import Array, Index, Int
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import NEAR, SLANT, headings, spaced_samples
from diff3ds.edges.watch import Capped

# [px; numerical] Spacing of the points along curves whose ridges are taken: no ridge point lies between two of them.
SPACING = 0.5
# [fraction; empirical] So much of its ridges must be left to a curve by those before it.
OWN = 0.3


def with_own_ridges(curves: Curves, views: EdgeViews, most: int, capped: Capped) -> Curves:
    """The curves that have ridges of their own, in their order.

    Args:
        most: so many at most: those that explain most ridges that those before them do not.
        capped: told of what there was too much; see `watch`.
    """
    if not len(curves):
        return curves
    shown = _ridges_of(curves, views)
    taken = np.zeros(len(views.points), bool)
    # What each would add; as those before it are taken it only falls, so that old numbers are bounds.
    added = np.array([len(ridges) for ridges in shown])
    waiting, kept = added > 0, []
    while waiting.any():
        best = int(np.where(waiting, added, -1).argmax())
        left = int((~taken[shown[best]]).sum())
        if left < added[best]:
            added[best] = left
            waiting[best] = left >= OWN * len(shown[best])
            continue
        waiting[best] = False
        taken[shown[best]] = True
        kept.append(best)
    if len(kept) > most:
        capped("curves", most, len(kept))
    return curves[torch.tensor(sorted(kept[:most]), dtype=torch.int64)]


def _ridges_of(curves: Curves, views: EdgeViews) -> list[Int[Index, " _"]]:
    """The ridge points of all views that each curve runs along."""
    x, tangents, owner = spaced_samples(curves, SPACING * views.pixel)
    match = views.match(x)
    across = np.abs((headings(views, x, tangents, match.pixel) * views.normals[match.ridge]).sum(-1))
    view, sample = np.nonzero((match.distance < NEAR) & (across < SLANT))
    pairs: Array = np.unique(owner[sample].astype(np.int64) * len(views.points) + match.ridge[view, sample])
    curve, ridge = np.divmod(pairs, max(1, len(views.points)))
    return np.split(ridge, np.searchsorted(curve, np.arange(1, len(curves))))
