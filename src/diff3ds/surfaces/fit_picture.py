"""Chains of points seen by a camera to rational cubics that stay within a tolerance of them in the picture.

What is fitted is the picture: a polynomial cubic in pixels, with the inverse depth (without perspective the depth) as a
third coordinate. As a homogeneous curve that is a rational cubic in space, whose picture is the fitted one exactly.
"""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.surfaces.meshes.view import Picture

# Rounds of improved parameters; empirical.
ROUNDS = 4
# Pull of inner control points towards even spacing, relative to the number of points: decides where points leave the
# shape open.
EVEN = 1e-3
# A step along the line of sight counts so much of one across it where parameters are spread along a chain: a chain that
# comes towards the camera has parameters too. Empirical.
ALONG_SIGHT = 0.05


@dataclass(frozen=True, eq=False)
class FittedChains:
    """Cubics along chains.

    Attributes:
        control: homogeneous control points in the world (w P, w).
        chain: the chain of each, in order; cubics of a chain follow on each other.
        start: the point, counted over all chains, at which each begins.
        stop: and ends.
        t: the parameter of each point in the cubic within which it lies; of ends of cubics it means nothing.
    """

    control: Float[Array, "C 4 4"]
    chain: Int[Index, " C"]
    start: Int[Index, " C"]
    stop: Int[Index, " C"]
    t: Float[Array, " M"]


def fit_chains(
    points: Float[Array, "M 3"], first: Int[Index, " F"], cuts: Int[Index, " U"], picture: Picture, tolerance: float
) -> FittedChains:
    """Rational cubics along chains of points in front of the near plane.

    Args:
        points: world units; the first point of a closed chain comes again at its end.
        first: the first point of each chain, and the number of all.
        cuts: points at which one cubic has to end and another to begin.
        tolerance: largest distance of the points from the cubics, in pixels of the picture.
    """
    pixels, depths = picture.seen(points)
    inverse = depths if picture.orthographic else 1 / depths
    values = np.column_stack([pixels, inverse])
    chain = np.repeat(np.arange(len(first) - 1), np.diff(first))
    ends = np.unique(np.concatenate([first[:-1], first[1:] - 1, cuts]))
    start, stop = ends[:-1], ends[1:]
    same = chain[start] == chain[stop]
    start, stop = start[same], stop[same]
    focal = np.linalg.norm(picture.projection[:2, :3]) / 2**0.5
    sight = (
        np.abs(np.diff(depths)) * ALONG_SIGHT * focal / (1 if picture.orthographic else np.maximum(depths[1:], 1e-12))
    )
    steps = np.hypot(np.linalg.norm(np.diff(pixels, axis=0), axis=1), sight)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    done: list[tuple[Array, Index, Index]] = []
    parameters = np.zeros(len(points))
    while len(start):
        control, error = _fit(values, length, start, stop, parameters)
        good = (error <= tolerance) | (stop - start < 2)
        done.append((control[good], start[good], stop[good]))
        start, stop = start[~good], stop[~good]
        # In the middle of the length, and not at an end.
        middle = np.searchsorted(length, (length[start] + length[stop]) / 2)
        middle = np.clip(middle, start + 1, stop - 1)
        start, stop = np.concatenate([start, middle]), np.concatenate([middle, stop])
    if not done:
        nothing = np.zeros(0, np.int64)
        return FittedChains(np.zeros((0, 4, 4)), nothing, nothing, nothing, parameters)
    control, start, stop = (np.concatenate(column) for column in zip(*done, strict=True))
    order = np.argsort(start, kind="stable")
    return FittedChains(_in_space(control[order], picture), chain[start[order]], start[order], stop[order], parameters)


def _fit(
    values: Float[Array, "M 3"],
    length: Float[Array, " M"],
    start: Int[Index, " P"],
    stop: Int[Index, " P"],
    parameters: Float[Array, " M"],
) -> tuple[Float[Array, "P 4 3"], Float[Array, " P"]]:
    """Cubics of least squares through the end points of runs, and the largest distances of the points, pixels.

    Args:
        parameters: filled in for the points of these runs.
    """
    counts = stop - start + 1
    offset = np.cumsum(counts) - counts
    run = np.repeat(np.arange(len(start)), counts)
    at = np.arange(len(run)) - offset[run] + start[run]
    points = values[at]
    p0, p3 = values[start], values[stop]
    span = length[stop] - length[start]
    t = (length[at] - length[start][run]) / np.where(span > 0, span, 1.0)[run]
    thirds = p0[:, None] + np.array([1 / 3, 2 / 3])[:, None] * (p3 - p0)[:, None]
    # Depths have no part in the parameters, and follow them.
    for left in range(ROUNDS, -1, -1):
        control = _least_squares(points, t, run, offset, counts, p0, p3, thirds)
        own = control[run]
        b = _bernstein(t)
        value = np.einsum("nk,nkd->nd", b, own[..., :2])
        off = points[:, :2] - value
        if not left:
            break
        step = np.diff(own[..., :2], axis=1)
        s = 1 - t
        tangent = 3 * np.einsum("nk,nkd->nd", np.stack([s * s, 2 * s * t, t * t], 1), step)
        t = np.clip(t + (off * tangent).sum(1) / np.maximum((tangent**2).sum(1), 1e-12), 0, 1)
        t[offset], t[offset + counts - 1] = 0, 1
    parameters[at] = t
    return control, np.maximum.reduceat(np.linalg.norm(off, axis=1), offset)


def _least_squares(
    points: Float[Array, "N 3"],
    t: Float[Array, " N"],
    run: Int[Index, " N"],
    offset: Int[Index, " P"],
    counts: Int[Index, " P"],
    p0: Float[Array, "P 3"],
    p3: Float[Array, "P 3"],
    thirds: Float[Array, "P 2 3"],
) -> Float[Array, "P 4 3"]:
    b = _bernstein(t)
    rest = points - b[:, :1] * p0[run] - b[:, 3:] * p3[run]
    pull = EVEN * counts
    a11, a12, a22 = (np.add.reduceat(b[:, i] * b[:, j], offset) for i, j in ((1, 1), (1, 2), (2, 2)))
    a11, a22 = a11 + pull, a22 + pull
    r1, r2 = (np.add.reduceat(b[:, k : k + 1] * rest, offset) + pull[:, None] * thirds[:, k - 1] for k in (1, 2))
    det = a11 * a22 - a12 * a12
    p1 = (a22[:, None] * r1 - a12[:, None] * r2) / det[:, None]
    p2 = (a11[:, None] * r2 - a12[:, None] * r1) / det[:, None]
    return np.stack([p0, p1, p2, p3], 1)


def _bernstein(t: Float[Array, " N"]) -> Float[Array, "N 4"]:
    s = 1 - t
    return np.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], 1)


def _in_space(control: Float[Array, "P 4 3"], picture: Picture) -> Float[Array, "P 4 4"]:
    """Homogeneous control points in the world, from pixels and inverse depths (depths without perspective)."""
    x, y, third = np.moveaxis(control, -1, 0)
    one = np.ones_like(x)
    if picture.orthographic:
        projected = np.stack([x, y, one, third], -1)
    else:
        # The inverse depth is the weight: kept off zero, which few points and a steep change could make of it.
        least = 0.1 * np.minimum(third[:, [0]], third[:, [3]])
        projected = np.stack([x, y, one, np.maximum(third, least)], -1)
    return projected @ np.linalg.inv(picture.projection).T
