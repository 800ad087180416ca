"""Ridges of images at subpixel precision (Steger 1998): the centre lines of drawn edges, or of colour gradients."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float

# [px, ink; empirical] Edge maps: standard deviation of the Gaussian derivatives, and least value of a ridge. On the
# maps of two detectors, PiDiNet (thick lines) and DexiNed (thin ones).
MAP_SIGMA, MAP_VALUE = 1.0, 0.18
# [px, ratio, power; empirical] Edge maps with broader lines than this are narrowed, by the maximum within this part of
# the width. The maps of HED have lines of 14 px in pictures of 400, PiDiNet's 3.8, DexiNed's 1.6.
BROAD, REACH, NARROWER = 6.0, 0.35, 5
# [px, 1/px; empirical] Colour: standard deviation of the gradient's own Gaussian, and the gradient that counts as
# noise. The logarithm makes weak and strong edges comparable.
GRADIENT_SIGMA, GRADIENT_NOISE = 1.0, 0.02
# [px, log ratio; empirical] Colour: standard deviation of the derivatives that find ridges of the gradient, and least
# value of a ridge.
COLOR_SIGMA, COLOR_VALUE = 0.6, 0.35
# [fraction; empirical] A ridge is faint below this fraction of the median value: between the borders of rounded edges
# and real ones.
FAINT = 0.4
# [fraction; derived] Ridge points as a fraction of all pixels: lines 20 pixels apart all over the picture. CAD models
# have .006 to .01, photographs and toy bricks .1 and more. A point of space lies within half a cell's diagonal, 1.5
# pixels, of one by chance in 2 * 1.5 * .05 = 15 % of the views; 17 of 100 and 11 of 50 views confirm an edge.
MOST_INK = 0.05
# [1/px², 1/px; derived] Least curvature of a ridge across, relative to the value (a line whose profile has the
# standard deviation s has 1 / s²), and largest slope along it that is not the flank of another.
CURVATURE, FLANK = 0.07, 0.3
# [px, points, points, cosine, px; empirical] Curvature is that of a parabola through so many of the neighbours within
# this radius that run the same way, if there are so many at least; it moves a ridge by no more than the last.
AROUND, NEIGHBOURS, FEWEST, SAME_WAY, MOST_PULL = 4.5, 16, 6, 0.6, 0.3
# [px; derived] A ridge belongs to the pixel that holds its top. The polynomial of a line half a pixel away has its top
# at up to 0.5 / (1 - 0.25 / sigma²), sigma 1 or more in all: less would lose lines that run right between two pixels.
WITHIN = 0.67
# [px; derived] Filters see no true neighbours this close to the border.
BORDER = 6


@dataclass(frozen=True, eq=False)
class Ridges:
    """Points on the ridges of one image.

    Attributes:
        points: (x, y) in pixels, centres of pixels at half integers.
        normals: unit vectors across the ridge, of either sign.
        values: of the smoothed image.
        pulls: how far the smoothing is taken to have pulled each point along its normal, pixels: undone in `points`.
        softness: such a pull by curvature, pixels².
    """

    points: Float[Array, "M 2"]
    normals: Float[Array, "M 2"]
    values: Float[Array, " M"]
    pulls: Float[Array, " M"]
    softness: float = 0.0

    @staticmethod
    def sharp(points: Float[Array, "M 2"], normals: Float[Array, "M 2"], values: Float[Array, " M"]) -> "Ridges":
        """Ridges that no smoothing has pulled."""
        return Ridges(points, normals, values, np.zeros(len(points)))

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, index: NDArray[np.bool_]) -> "Ridges":
        return Ridges(self.points[index], self.normals[index], self.values[index], self.pulls[index], self.softness)


def map_ridges(ink: Float[NDArray[np.float32], "H W"]) -> Ridges:
    """Centre lines of an edge map or line drawing, ink in [0, 1]."""
    return find_ridges(ink, MAP_SIGMA, MAP_VALUE)


def map_tops(ink: Float[NDArray[np.float32], "H W"]) -> Ridges:
    """As `map_ridges`, where the smoothing has pulled them."""
    return find_tops(ink, MAP_SIGMA, MAP_VALUE)


def narrowed(ink: Float[NDArray[np.float32], "H W"], width: float) -> Float[NDArray[np.float32], "H W"]:
    """A map with broad lines as one with narrow ones, which have their tops where they were, and as high.

    Args:
        width: of the lines, pixels; what is no broader than `BROAD` stays.
    """
    from scipy.ndimage import maximum_filter

    if width <= BROAD:
        return ink
    top = maximum_filter(ink, 2 * round(REACH * width) + 1)
    return np.asarray(ink * (ink / np.maximum(top, 1e-6)) ** NARROWER, np.float32)


def without_faint(ridges: Sequence[Ridges]) -> list[Ridges]:
    """The ridges of all views without those much fainter than most: where a detector is in doubt, there is no edge."""
    values = np.concatenate([r.values for r in ridges])
    least = FAINT * float(np.median(values)) if len(values) else 0.0
    return [r[r.values > least] for r in ridges]


def strongest(ridges: Sequence[Ridges], most: int) -> list[Ridges]:
    """The ridges of all views without the weakest, so that so many points are left.

    One bound for all views: what is strong enough in one of them mostly is in the others.
    """
    values = np.concatenate([r.values for r in ridges])
    if len(values) <= most:
        return list(ridges)
    least = np.partition(values, len(values) - most)[len(values) - most]
    return [r[r.values >= least] for r in ridges]


def color_ridges(rgba: Float[NDArray[np.float32], "H W 4"]) -> Ridges:
    """Where colour or transparency changes fastest; colours times alpha, and alpha, in [0, 1]."""
    return find_ridges(color_gradient(rgba), COLOR_SIGMA, COLOR_VALUE)


def color_tops(rgba: Float[NDArray[np.float32], "H W 4"]) -> Ridges:
    """As `color_ridges`, where the smoothing has pulled them."""
    return find_tops(color_gradient(rgba), COLOR_SIGMA, COLOR_VALUE)


def color_gradient(rgba: Float[NDArray[np.float32], "H W 4"]) -> Float[NDArray[np.float32], "H W"]:
    """log(1 + gradient / noise) of colours times alpha and of alpha."""
    from scipy.ndimage import gaussian_filter

    square = np.zeros_like(rgba[..., 3])
    # Three channels of colour count as much as the outline.
    for channel, weight in zip(np.moveaxis(rgba, -1, 0), (1 / 3, 1 / 3, 1 / 3, 1.0), strict=True):
        for order in ((0, 1), (1, 0)):
            square += weight * gaussian_filter(channel, GRADIENT_SIGMA, order=order) ** 2
    return np.log1p(np.sqrt(square) / GRADIENT_NOISE)


def within(ridges: Ridges, known: Bool[NDArray[np.bool_], "H W"]) -> Ridges:
    """The ridges whose surroundings are known."""
    from scipy.ndimage import binary_erosion

    safe = binary_erosion(known, np.ones((3, 3), bool), iterations=BORDER)
    column, row = np.floor(ridges.points).astype(int).T
    return ridges[safe[row, column]]


def find_ridges(image: Float[NDArray[np.float32], "H W"], sigma: float, least_value: float) -> Ridges:
    """The tops of an image, see `find_tops`, where they would be without the smoothing."""
    return unshrunk(find_tops(image, sigma, least_value), sigma)


def find_tops(image: Float[NDArray[np.float32], "H W"], sigma: float, least_value: float) -> Ridges:
    """Points where the image is largest across the direction of its strongest curvature.

    The second-order Taylor polynomial of the smoothed image has its top across the ridge at t n, n the eigenvector of
    the most negative eigenvalue l of the Hessian, t = -(gradient . n) / l; the pixel holds a ridge point if that lies
    within it.

    Args:
        sigma: of the Gaussian derivatives, pixels.
        least_value: of the smoothed image.
    """
    from scipy.ndimage import gaussian_filter

    def derivative(*order: int) -> Array:
        return np.asarray(gaussian_filter(image, sigma, order=order, output=np.float64))

    value, gx, gy = derivative(0, 0), derivative(0, 1), derivative(1, 0)
    xx, xy, yy = derivative(0, 2), derivative(1, 1), derivative(2, 0)
    least = (xx + yy) / 2 - np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    nx, ny = _eigenvector(xx, xy, yy, least)
    top = -(gx * nx + gy * ny) / np.minimum(least, -1e-9)
    # On the flank of a bent line the image bends down along the line, a little, and falls off beside it.
    flank = np.abs(gx * ny - gy * nx) > FLANK * value
    ridge = (least < -CURVATURE * value) & (xx + yy < 0) & (value > least_value) & ~flank
    ridge &= (np.abs(top * nx) <= WITHIN) & (np.abs(top * ny) <= WITHIN)
    # The top of a dot falls off alike to all sides: it has no direction, and is no line.
    ridge &= (nx != 0) | (ny != 0)
    ridge[:BORDER] = ridge[-BORDER:] = ridge[:, :BORDER] = ridge[:, -BORDER:] = False
    y, x = np.nonzero(ridge)
    points = np.stack([x + 0.5 + (top * nx)[ridge], y + 0.5 + (top * ny)[ridge]], 1)
    return Ridges.sharp(points, np.stack([nx[ridge], ny[ridge]], 1), value[ridge])


def unshrunk(ridges: Ridges, sigma: float, among: Ridges | None = None) -> Ridges:
    """The ridges where they would be without the smoothing, which pulls bent lines to the inside.

    The Gaussian is heat flow over the time sigma² / 2; in polar coordinates around the centre of curvature its equation
    I_t = I_rr + k I_r moves a line inwards at the speed of its curvature k, by k sigma² / 2 in all.

    Args:
        sigma: of the smoothing, pixels.
        among: all ridges of the image, if these are some of them.
    """
    softness = sigma**2 / 2
    pulls = np.clip(_curvature(ridges, ridges if among is None else among) * softness, -MOST_PULL, MOST_PULL)
    # Towards the side of the normal is inwards where the curvature is positive.
    return replace(ridges, points=ridges.points - pulls[:, None] * ridges.normals, pulls=pulls, softness=softness)


def _curvature(ridges: Ridges, among: Ridges) -> Float[Array, " M"]:
    """Curvature of some ridges of an image, positive where they bend to the side of the normal, 1 / pixels."""
    from scipy.spatial import cKDTree

    if len(among) < FEWEST:
        return np.zeros(len(ridges))
    tree = cKDTree(among.points)
    distance, near = tree.query(ridges.points, k=min(NEIGHBOURS, len(among)), distance_upper_bound=AROUND)
    known = np.isfinite(distance.T)
    near = np.where(known, near.T, 0)
    # Neighbours in rows, one component after the other: what follows goes over each of them in a row.
    (x, y), (u, v) = (np.ascontiguousarray(values.T) for values in (ridges.points, ridges.normals))
    dx, dy = (axis.take(near) - own for axis, own in zip(among.points.T.copy(), (x, y), strict=True))
    other_u, other_v = (axis.take(near) for axis in among.normals.T.copy())
    across, along = dx * u + dy * v, dx * v - dy * u
    same = np.abs(other_u * u + other_v * v) > SAME_WAY
    weight = (known & same & (np.abs(across) < 0.5 + 0.5 * np.abs(along))).astype(np.float64)
    basis = [np.ones_like(along), along, along**2 / 2]
    weighted = [weight * one for one in basis]
    matrix = np.stack([np.stack([(one * other).sum(0) for other in basis], -1) for one in weighted], 1)
    right = np.stack([(one * across).sum(0) for one in weighted], -1)
    solid = (weight.sum(0) >= FEWEST) & ((weight * np.abs(along)).max(0) > AROUND / 2)
    matrix[~solid] = np.eye(3)
    bend = np.linalg.solve(matrix + 1e-6 * np.eye(3), right[..., None])[:, 2, 0]
    return np.where(solid, bend, 0.0)


def _eigenvector(xx: Array, xy: Array, yy: Array, value: Array) -> tuple[Array, Array]:
    """Unit eigenvector of the symmetric matrix ((xx, xy), (xy, yy)); of its two rows the longer gives it safely."""
    first = np.stack([xy, value - xx])
    second = np.stack([value - yy, xy])
    longer = (first**2).sum(0) >= (second**2).sum(0)
    vector = np.where(longer, first, second)
    length = np.sqrt((vector**2).sum(0))
    flat = length < 1e-12
    unit = np.where(flat, 0.0, vector / np.where(flat, 1.0, length))
    return unit[0], unit[1]
