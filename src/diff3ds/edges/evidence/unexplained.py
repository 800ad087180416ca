"""Ridges that no curve explains yet."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.support import NEAR, SLANT, headings, spaced_samples
from diff3ds.parallel.side_by_side import side_by_side

# [px; empirical] Spacing of the sample points of curves.
APART = 0.5


def unexplained(views: EdgeViews, ridges: Sequence[Ridges], curves: Curves) -> list[Ridges]:
    """The ridge points that no curve passes, running the same way.

    Args:
        ridges: those of the views.
    """
    points, tangents, _ = spaced_samples(curves, APART * views.pixel)
    pixel = views.project(points)[0]
    ahead = headings(views, points, tangents, pixel)
    passed = side_by_side(lambda view: _passed(ridges[view], pixel[view], ahead[view]), len(ridges), len(ridges))
    return [ridge[~gone] for ridge, gone in zip(ridges, passed, strict=True)]


def _passed(ridge: Ridges, pixel: Array, ahead: Array) -> NDArray[np.bool_]:
    """Whether a curve's samples pass each ridge point: of the nearest few, one that runs the same way."""
    from scipy.spatial import cKDTree

    if not len(ridge):
        return np.zeros(0, bool)
    finite = np.isfinite(pixel).all(1)
    distance, nearest = cKDTree(pixel[finite]).query(ridge.points, k=4, distance_upper_bound=NEAR)
    found = np.isfinite(distance)
    heading = ahead[finite][np.where(found, nearest, 0)]
    across = np.abs((heading * ridge.normals[:, None]).sum(-1))
    return (found & (across < SLANT)).any(1)
