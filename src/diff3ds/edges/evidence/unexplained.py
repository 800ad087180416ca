"""Ridges that no curve explains yet."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Float
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.ridges import Array, Ridges
from diff3ds.edges.evidence.support import NEAR, SLANT
from diff3ds.edges.shapes.curve_set import Curves

# Samples of curves, pixels apart.
APART = 0.5


def unexplained(views: EdgeViews, ridges: Sequence[Ridges], curves: Curves) -> list[Ridges]:
    """The ridge points that no curve passes, running the same way.

    Args:
        ridges: those of the views.
    """
    counts = np.ceil(_lengths(curves) / (APART * views.pixel)).astype(np.int64) + 2
    most = int(counts.max())
    points = curves.at(torch.linspace(0, 1, most)).double().numpy()
    tangents = np.gradient(points, axis=1)
    # Of short curves fewer samples: all of them, for all views, would be too many.
    owner = np.repeat(np.arange(len(curves)), counts)
    at = np.concatenate([np.linspace(0, most - 1, count).round().astype(np.int64) for count in counts])
    points, tangents = points[owner, at], tangents[owner, at]
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True) + 1e-12
    pixel = views.project(points)[0]
    ahead = views.project(points + 0.1 * views.pixel * tangents)[0] - pixel
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True) + 1e-12
    return [ridge[~_passed(ridge, pixel[view], ahead[view])] for view, ridge in enumerate(ridges)]


def _lengths(curves: Curves) -> Float[Array, " N"]:
    polyline = curves.at(torch.linspace(0, 1, 33))
    return (polyline[:, 1:] - polyline[:, :-1]).norm(dim=2).sum(1).double().numpy()


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
