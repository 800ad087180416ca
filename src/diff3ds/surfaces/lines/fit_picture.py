"""Chains of points seen by a camera to rational cubics that stay within a tolerance of them in the picture.

What is fitted is the picture: a polynomial cubic in pixels, with the inverse depth (without perspective the depth) as a
third coordinate. As a homogeneous curve that is a rational cubic in space, whose picture is the fitted one exactly.
"""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.curves.fit_cubics import FittedRows, fit_rows
from diff3ds.page.picture import Picture

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

    @property
    def places(self) -> tuple[Float[Array, " A"], Float[Array, " A"]]:
        """Numbers of cubics plus parameters, rising, and the points of chains that lie there."""
        counts = self.stop - self.start + 1
        offset = np.cumsum(counts) - counts
        cubic = np.repeat(np.arange(len(counts)), counts)
        place = np.arange(len(cubic)) - offset[cubic] + self.start[cubic]
        t = self.t[place]
        t[offset], t[offset + counts - 1] = 0, 1
        return np.maximum.accumulate(cubic + t), place.astype(np.float64)


def fit_chains(
    points: Float[Array, "M 3"],
    first: Int[Index, " F"],
    cuts: Int[Index, " U"],
    picture: Picture,
    tolerance: float,
    spacing: float = 0.0,
) -> FittedChains:
    """Rational cubics along chains of points in front of the near plane.

    Args:
        points: world units; the first point of a closed chain comes again at its end.
        first: the first point of each chain, and the number of all.
        cuts: points at which one cubic has to end and another to begin.
        tolerance: largest distance of the points from the cubics, in pixels of the picture.
        spacing: points that are nearer than this to the one before, pixels, are not fitted.
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
    length = np.append(0.0, np.cumsum(steps))[: len(points)]
    kept = np.arange(len(points))
    if spacing and len(points):
        far = np.append(True, np.diff(np.floor(length / spacing)) > 0)
        far[ends] = True
        kept = np.flatnonzero(far)
    start, stop = np.searchsorted(kept, start), np.searchsorted(kept, stop)
    fitted = fit_rows(values[kept], start, stop, tolerance, length[kept], measured=2)
    start, stop = kept[fitted.start], kept[fitted.stop]
    t = _between(fitted, length, kept) if len(kept) < len(points) else fitted.t
    return FittedChains(_in_space(fitted.control, picture), chain[start], start, stop, t)


def _between(fitted: FittedRows, length: Float[Array, " M"], kept: Int[Index, " K"]) -> Float[Array, " M"]:
    """Parameters of all points, of which some were fitted."""
    left, right = fitted.t.copy(), fitted.t.copy()
    left[fitted.start], right[fitted.stop] = 0, 1
    before = np.minimum(np.searchsorted(kept, np.arange(len(length)), "right"), len(kept) - 1) - 1
    begin, end = length[kept[before]], length[kept[before + 1]]
    share = (length - begin) / np.where(end > begin, end - begin, 1.0)
    return left[before] + share * (right[before + 1] - left[before])


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
