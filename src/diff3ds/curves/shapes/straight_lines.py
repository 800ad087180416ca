"""Straight lines and polylines in space: directions, where lines meet, even steps, which ends lie together."""

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Int
from diff3ds.curves.directions import dot, unit

# [square sine; numerical] Lines at a smaller angle than this (1.8 degrees) count as parallel.
PARALLEL = 1e-3


def tangents_of(polylines: Float[Array, "*n m d"]) -> Float[Array, "*n m d"]:
    """Unit tangents at the points of polylines."""
    return unit(np.gradient(polylines, axis=-2))


def outward_tangent(control: Float[Array, "4 3"], end: int) -> Float[Array, " 3"]:
    """Unit tangent of a cubic at its start (0) or its end (1), pointing out of the curve."""
    return unit(control[0] - control[1] if end == 0 else control[3] - control[2])


def polyline_length(line: Float[Array, "M 3"]) -> float:
    """Length of a polyline."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def resampled(line: Float[Array, "M 3"], step: float) -> Float[Array, "K 3"]:
    """Points at even distances along a polyline, about `step` apart, the ends included."""
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    even = np.linspace(0, at[-1], max(2, round(at[-1] / step) + 1))
    return np.stack([np.interp(even, at, line[:, k]) for k in range(3)], 1)


def pairs_by_ends(ends: Float[Array, "M 2 3"], gap: float) -> Int[NDArray[np.int64], "P 2"]:
    """Pairs of curves, given by their ends, of which an end lies within a gap of an end of the other; ascending."""
    from scipy.spatial import cKDTree

    if not len(ends):
        return np.zeros((0, 2), np.int64)
    near = cKDTree(ends.reshape(-1, 3)).query_pairs(gap, output_type="ndarray") // 2
    return np.unique(np.sort(near[near[:, 0] != near[:, 1]], axis=1), axis=0).astype(np.int64)


def meeting(far: list[Array], near: list[Array], apart: float = np.inf) -> Float[Array, " 3"] | None:
    """The middle between the nearest points of two lines; None if they are parallel, or pass each other farther apart.

    Args:
        far: a point of each line.
        near: another point of each line.
        apart: the largest distance at which they still meet, world units.
    """
    a, b = (unit(n - f) for n, f in zip(near, far, strict=True))
    across = 1 - (a @ b) ** 2
    if across < PARALLEL:
        return None
    gap = near[1] - near[0]
    s = (gap @ a - (gap @ b) * (a @ b)) / across
    t = ((gap @ a) * (a @ b) - gap @ b) / across
    one, other = near[0] + s * a, near[1] + t * b
    return (one + other) / 2 if np.linalg.norm(one - other) <= apart else None


def nearest_to_lines(
    through: Float[Array, "K 3"], along: Float[Array, "K 3"], anchor: Float[Array, " 3"], pull: float
) -> Float[Array, " 3"]:
    """The point nearest to lines by least squares, pulled to an anchor: that decides where the lines leave it open.

    Args:
        through: a point of each line.
        along: unit vectors along the lines.
        pull: weight of the squared distance from the anchor, of which that from a line has 1.
    """
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    matrix = across.sum(0) + pull * np.eye(3)
    return np.linalg.solve(matrix, (across @ through[..., None])[..., 0].sum(0) + pull * anchor)


def off_segment(x: Float[Array, "*m 3"], start: Float[Array, " 3"], stop: Float[Array, " 3"]) -> Float[Array, "*m"]:
    """Distances from a segment."""
    along = stop - start
    fraction = np.clip((x - start) @ along / (along @ along), 0, 1)[..., None]
    apart = x - start - fraction * along
    return np.sqrt(dot(apart, apart))
