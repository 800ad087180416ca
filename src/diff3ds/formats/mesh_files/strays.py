"""Pieces of a mesh without extent of their own, far from the rest: scans and CAD programs leave single triangles there.

With them in the picture the rest would be a dot, and what counts as near or the same would be as large as it.
"""

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.formats.mesh_files.polygons import numbered_places

# The smallest pieces, all together so large a share of the surface, may be strays. Empirical: of a model with a stray
# triangle it is a millionth, and of a small screw on a car's body some 1e-5.
SPECK = 1e-5
# Strays are farther from the box of the others than this, of that box's longest side. Empirical.
FAR = 1.0
# Of more faces than this, strays are looked for only where the outermost, so large a share of them on each side, make
# the box more than twice as large. Empirical: saves a second a million faces.
MANY, OUTERMOST = 1000, 0.05


def strays(vertices: Float[Array, "V 3"], faces: Int[Index, "F 3"]) -> Bool[Mask, " F"]:
    """Which faces are of stray pieces; faces with a place in common are of one piece."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    corners = vertices[faces]
    low, high = corners.min(1), corners.max(1)
    whole = (high.max(0) - low.min(0)).max()
    none = np.zeros(len(faces), bool)
    if len(faces) > MANY and whole <= (1 + FAR) * np.ptp(np.quantile(low, (OUTERMOST, 1 - OUTERMOST), axis=0), 0).max():
        return none
    place = numbered_places(vertices)[faces]
    count = int(place.max()) + 1
    ends = np.concatenate([place[:, [0, 1]], place[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(count, count))
    _, group = connected_components(graph, directed=False)
    _, piece = np.unique(group[place[:, 0]], return_inverse=True)
    a, b, c = corners.transpose(1, 0, 2)
    area = np.bincount(piece, np.linalg.norm(np.cross(b - a, c - a), axis=1))
    order = np.argsort(area)
    small = np.zeros(len(area), bool)
    small[order] = np.cumsum(area[order]) <= SPECK * area.sum()
    if not small.any() or small.all():
        return none
    rest = ~small[piece]
    least, most = low[rest].min(0), high[rest].max(0)
    away = np.maximum(least - high, low - most).max(1)
    # A piece is as far as its nearest face.
    nearest = np.full(len(area), np.inf)
    np.minimum.at(nearest, piece, away)
    return np.asarray(small & (nearest > FAR * (most - least).max()))[piece]
