"""Spurious curves: curves that chance has made of the ridges of others, above all where cameras stand in rings.

Where several views at once show two lines crossing, a curve through these crossings agrees with all of them. In views
in a ring the same chance comes again and again. But wherever such a curve is shown, it lies on the ridges of other
curves; one that is there has ridges of its own in most views.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Int
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import (
    AGREEING,
    SEGMENT,
    SLANT,
    headings,
    inliers,
    owners,
    samples,
    spaced_samples,
)
from diff3ds.parallel.side_by_side import side_by_side

# [px; empirical] Another curve that passes so near and runs the same way explains a ridge as well.
BESIDE = 1.5
# [fraction, fraction; measured] A view shows ridges of a curve's own where this fraction of its inliers has no other
# explanation, and a curve that is there has them in at least this fraction of the views that show it. In rings of 24
# views true curves have .5 and more, spurious ones hardly any; in the 30 generated parts that the method was tuned on,
# none has less.
OWN, LEAST = 0.5, 0.3
# [fraction; empirical] What a larger fraction of the views shows may be one of several curves that lie in a plane with
# the cameras.
MOST_SHOWN = 0.75


def without_spurious(curves: Curves, views: EdgeViews) -> Curves:
    """The curves that have ridges of their own, once those that have the fewest are gone."""
    if not len(curves):
        return curves
    shown, beside = _explained(curves, views)
    owner = curves.owner.numpy()
    kept = np.ones(len(curves), bool)
    while True:
        fraction = _own_fraction(shown, beside[kept[beside[:, 2]]], owner)
        fraction[~kept] = np.inf
        worst = int(fraction.argmin())
        if fraction[worst] >= LEAST:
            return curves[torch.from_numpy(kept)]
        kept[worst] = False


def _own_fraction(
    shown: Bool[NDArray[np.bool_], "V M"], beside: Int[NDArray[np.int64], "P 3"], owner: Int[NDArray[np.int64], " S"]
) -> Float[Array, " N"]:
    """Of the views that show each curve, how many show ridges of its own; 1 where none or nearly all show it.

    Args:
        owner: the curve that each segment is of.
    """
    own = shown.copy()
    own[beside[:, 0], beside[:, 1]] = False
    own, every = (flags.reshape(len(flags), -1, SEGMENT) for flags in (own, shown))
    seen = every.mean(2) >= AGREEING
    clear = seen & (own.sum(2) >= OWN * every.sum(2))
    count, of = (np.bincount(owner, flags.sum(0)) for flags in (clear, seen))
    doubtful = (of > 0) & (of <= MOST_SHOWN * np.bincount(owner) * len(shown))
    return np.where(doubtful, count / np.maximum(of, 1), 1.0)


def _explained(
    curves: Curves, views: EdgeViews
) -> tuple[Bool[NDArray[np.bool_], "V M"], Int[NDArray[np.int64], "P 3"]]:
    """Where samples of the curves agree with the views, and which other curves pass there too: view, sample, curve."""
    x, tangents = samples(curves)
    shown = inliers(views, x, tangents)
    pixel = views.project(x)[0]
    heading = headings(views, x, tangents, pixel)
    places, directions, owner = spaced_samples(curves, views.pixel)
    passing, depth = views.project(places)
    ahead = headings(views, places, directions, passing)
    passing = np.where(depth[..., None] > 0, passing, np.inf)
    own = owners(curves)

    def explaining(view: int) -> Int[NDArray[np.int64], "Q 3"]:
        rows, near = _neighbours(pixel[view], passing[view], np.nonzero(shown[view])[0])
        turned = heading[view, rows, 0] * ahead[view, near, 1] - heading[view, rows, 1] * ahead[view, near, 0]
        by = owner[near]
        explains = (np.abs(turned) < SLANT) & (by != own[rows])
        pairs = np.unique(rows[explains] * len(curves) + by[explains])
        return np.stack([np.full(len(pairs), view), pairs // len(curves), pairs % len(curves)], 1)

    found = side_by_side(explaining, len(views), len(views))
    return shown, np.concatenate([np.zeros((0, 3), np.int64), *found])


def _neighbours(
    pixel: Float[Array, "M 2"], passing: Float[Array, "D 2"], rows: Int[NDArray[np.int64], " R"]
) -> tuple[Int[NDArray[np.int64], " P"], Int[NDArray[np.int64], " P"]]:
    """Pairs of some of the samples and of the points that appear beside them."""
    from scipy.spatial import cKDTree

    seen = np.nonzero(np.isfinite(passing).all(1))[0]
    pairs = cKDTree(pixel[rows]).sparse_distance_matrix(cKDTree(passing[seen]), BESIDE, output_type="ndarray")
    return rows[pairs["i"]], seen[pairs["j"]]
