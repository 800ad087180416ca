"""A surface where values on a grid change their sign: naive surface nets (Gibson 1998)."""

from itertools import product

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.surfaces.shape.triangle_mesh import CREASE, TriangleMesh


def level_set(
    values: Float[Array, "X Y Z"], low: Float[Array, " 3"], spacing: float, crease: float = CREASE
) -> TriangleMesh:
    """The surface on which values are zero; what is outside of the grid is outside of the solid.

    Each cell with corners on both sides gets a vertex, the mean of the places at which its edges cross zero, and each
    edge that crosses zero gets the four-sided face between the cells around it. Neighbours share vertices, and sides
    are nearly equal.

    Args:
        values: positive inside, at points along three axes.
        low: the place of the first of them, world units.
        spacing: between neighbours, world units.
        crease: as of `TriangleMesh`.

    Raises:
        ValueError: values that are not finite, or none of them positive.
    """
    given = np.asarray(values, np.float64)
    if not np.isfinite(given).all():
        raise ValueError("values of a level set must be finite")
    if not (given > 0).any():
        raise ValueError("a level set needs a positive value: there is nothing inside")
    # A margin outside, as far from zero as the surface would have it half-way.
    padded = np.pad(given, 1, constant_values=-float(np.abs(given).max()))
    inside = padded > 0
    corners = list(product((0, 1), repeat=3))
    counts = np.stack([_corner(inside, corner) for corner in corners]).sum(0)
    cells = np.argwhere((counts > 0) & (counts < 8))
    number = np.full(counts.shape, -1, np.int64)
    number[tuple(cells.T)] = np.arange(len(cells))
    points = low + spacing * (_vertices(padded, inside, cells) - 1)
    faces = [_faces_across(inside, number, points, axis) for axis in range(3)]
    return TriangleMesh(points, np.concatenate(faces), crease=crease)


def _corner(grid: Bool[Mask, "X Y Z"], corner: tuple[int, ...]) -> Bool[Mask, "A B C"]:
    """The values at one corner of each cell."""
    return grid[tuple(slice(c, n - 1 + c) for c, n in zip(corner, grid.shape, strict=True))]


def _vertices(
    values: Float[Array, "X Y Z"], inside: Bool[Mask, "X Y Z"], cells: Int[Index, "M 3"]
) -> Float[Array, "M 3"]:
    """The mean place of the zeros along the edges of each cell, in cells."""
    total, count = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for axis in range(3):
        along = np.eye(3, dtype=np.int64)[axis]
        for corner in product((0, 1), repeat=3):
            if corner[axis]:
                continue
            start = cells + np.array(corner)
            one, other = tuple(start.T), tuple((start + along).T)
            crosses = inside[one] != inside[other]
            a, b = values[one][crosses], values[other][crosses]
            total[crosses] += start[crosses] + (a / (a - b))[:, None] * along
            count[crosses] += 1
    return total / count[:, None]


def _faces_across(
    inside: Bool[Mask, "X Y Z"], number: Int[Index, "A B C"], points: Float[Array, "M 3"], axis: int
) -> Int[Index, "F 3"]:
    """The faces between the cells around the edges along one axis, counter-clockwise seen from outside."""
    along = np.eye(3, dtype=np.int64)[axis]
    ahead = np.roll(inside, -1, axis)
    # The margin is outside all round, so that nothing crosses at its ends.
    edges = np.argwhere(inside != ahead)
    out = inside[tuple(edges.T)]
    one, other = np.roll(along, 1), np.roll(along, 2)
    quad = np.stack([number[tuple((edges - way).T)] for way in (one + other, other, 0 * one, one)], 1)
    quad[~out] = quad[~out][:, ::-1]
    # Cut along the shorter diagonal.
    a, b, c, d = points[quad].transpose(1, 0, 2)
    first = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1)
    rows = np.where(first[:, None], quad, np.roll(quad, -1, 1))
    return np.concatenate([rows[:, [0, 1, 2]], rows[:, [0, 2, 3]]])
