"""Pairs of discs on the page that may touch, of which some are much larger than others."""

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int


def near_pairs(points: Float[Array, "N 2"], reach: Float[Array, " N"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
    """Pairs of points that are not farther apart than the sum of their reaches, and some others; first the lower row.

    Points of like reaches are looked for together.
    """
    from scipy.spatial import cKDTree

    if not len(points):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    size = np.ceil(np.log2(np.maximum(reach, 1.0))).astype(np.int64)
    classes = [np.flatnonzero(size == k) for k in np.unique(size)]
    trees = [cKDTree(points[rows]) for rows in classes]
    largest = [float(reach[rows].max()) for rows in classes]
    pairs: list[tuple[Index, Index]] = []
    for k, rows in enumerate(classes):
        both = trees[k].query_pairs(2 * largest[k], output_type="ndarray")
        pairs.append((rows[both[:, 0]], rows[both[:, 1]]))
        for other, others in enumerate(classes[:k]):
            found = trees[k].sparse_distance_matrix(trees[other], largest[k] + largest[other], output_type="ndarray")
            pairs.append((rows[found["i"]], others[found["j"]]))
    first, second = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return np.minimum(first, second), np.maximum(first, second)
