"""Shared end points: ends of curves that lie together become one vertex."""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves, sampled
from diff3ds.curves.shapes.straight_lines import nearest_to_lines

# [px, fraction; empirical] Ends within this distance meet, unless that is a larger fraction of the length of one of
# their curves.
WITHIN, SHARE = 3.0, 0.4
# [ratio, px; empirical] Pull of the ends' own mean on a vertex, against the meeting of the tangents; and how far
# tangents may take it.
OWN, FARTHEST = 0.05, 4.5


def welded(curves: Curves, pixel: float) -> Curves:
    """Curves whose ends share vertices where they lie together; vertices move to where the tangents meet."""
    if not len(curves):
        return curves
    samples = sampled(curves)
    group = _groups(curves, samples, pixel)
    ends = np.stack([samples[:, 0], samples[:, -1]], 1).reshape(-1, 3)
    tangents = unit(np.stack([samples[:, 2] - samples[:, 0], samples[:, -3] - samples[:, -1]], 1).reshape(-1, 3))
    names, vertex = np.unique(group, return_inverse=True)
    places = np.stack([place_of_vertex(ends[group == n], tangents[group == n], pixel) for n in names])
    target = torch.from_numpy(places[vertex.reshape(-1, 2)]).to(curves.points.dtype)
    moved = curves.points.clone()
    shift = (target - moved[:, [0, 3]]).masked_fill(curves.closed[:, None, None], 0.0)
    moved[:, :2] += shift[:, :1]
    moved[:, 2:] += shift[:, 1:]
    return replace(curves, points=moved, vertex=torch.from_numpy(vertex.reshape(-1, 2)))


def _groups(curves: Curves, samples: Array, pixel: float) -> NDArray[np.int64]:
    """The group of every end, nearest pairs first; no curve gets both its ends into one."""
    from scipy.spatial import cKDTree

    length = np.repeat(np.linalg.norm(np.diff(samples, axis=1), axis=2).sum(1), 2)
    ends = np.stack([samples[:, 0], samples[:, -1]], 1).reshape(-1, 3)
    group = curves.vertex.reshape(-1).numpy().copy()
    pairs = sorted(
        (float(np.linalg.norm(ends[i] - ends[k])), i, k) for i, k in cKDTree(ends).query_pairs(WITHIN * pixel)
    )
    closed = np.repeat(curves.closed.numpy(), 2)
    for distance, i, k in pairs:
        if group[i] == group[k] or distance > SHARE * min(length[i], length[k]) or closed[i] or closed[k]:
            continue
        members = np.nonzero((group == group[i]) | (group == group[k]))[0]
        if len(np.unique(members // 2)) == len(members):
            group[members] = min(group[i], group[k])
    return group


def place_of_vertex(ends: Float[Array, "M 3"], tangents: Float[Array, "M 3"], pixel: float) -> Float[Array, " 3"]:
    """Where the tangents through these ends meet; the ends' mean if that is far."""
    middle = ends.mean(0)
    if len(ends) == 1:
        return middle
    point = nearest_to_lines(ends, tangents, middle, OWN * len(ends))
    return point if np.linalg.norm(point - middle) < FARTHEST * pixel else middle
