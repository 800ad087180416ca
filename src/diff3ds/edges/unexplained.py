"""Ridges that no curve explains yet."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds.edges.curves import Curves
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.ridges import Array, Ridges
from diff3ds.edges.support import NEAR, SLANT

# Samples of curves, pixels apart.
APART = 0.5


def unexplained(views: EdgeViews, ridges: Sequence[Ridges], curves: Curves) -> list[Ridges]:
    """The ridge points that no curve passes, running the same way.

    Args:
        ridges: those of the views.
    """
    count = int(np.ceil(_longest(curves) / (APART * views.pixel))) + 2
    points = curves.at(torch.linspace(0, 1, count)).double().numpy()
    tangents = np.gradient(points, axis=1).reshape(-1, 3)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True) + 1e-12
    points = points.reshape(-1, 3)
    pixel = views.project(points)[0]
    ahead = views.project(points + 0.1 * views.pixel * tangents)[0] - pixel
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True) + 1e-12
    return [ridge[~_passed(ridge, pixel[view], ahead[view])] for view, ridge in enumerate(ridges)]


def _longest(curves: Curves) -> float:
    polyline = curves.at(torch.linspace(0, 1, 33))
    return float((polyline[:, 1:] - polyline[:, :-1]).norm(dim=2).sum(1).max())


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
