"""Ridges of images at subpixel precision (Steger 1998): the centre lines of drawn edges, or of colour gradients."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Float

Array = NDArray[np.float64]

# Edge maps: standard deviation of the Gaussian derivatives in pixels, least value and curvature of a ridge. Empirical
# on the maps of two detectors, PiDiNet (thick lines) and DexiNed (thin ones).
MAP_SIGMA, MAP_VALUE, MAP_CURVATURE = 1.0, 0.18, 0.02
# Colour: of the gradient's own Gaussian and of its ridges. The logarithm makes weak and strong edges comparable;
# GRADIENT_NOISE is the gradient per pixel that counts as noise. Empirical.
GRADIENT_SIGMA, GRADIENT_NOISE = 1.0, 0.02
COLOR_SIGMA, COLOR_VALUE, COLOR_CURVATURE = 0.6, 0.35, 0.05
# Share of the median value below which a ridge is faint. Empirical, between the borders of rounded edges and real ones.
FAINT = 0.4
# A ridge belongs to the pixel that holds its top; a little overlap leaves no gaps between neighbours.
WITHIN = 0.6
# Filters see no true neighbours this close to the border.
BORDER = 6


@dataclass(frozen=True, eq=False)
class Ridges:
    """Points on the ridges of one image.

    Attributes:
        points: (x, y) in pixels, centres of pixels at half integers.
        normals: unit vectors across the ridge, of either sign.
        values: of the smoothed image.
    """

    points: Float[Array, "M 2"]
    normals: Float[Array, "M 2"]
    values: Float[Array, " M"]

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, index: NDArray[np.bool_]) -> "Ridges":
        return Ridges(self.points[index], self.normals[index], self.values[index])


def map_ridges(ink: Float[NDArray[np.float32], "H W"]) -> Ridges:
    """Centre lines of an edge map or line drawing, ink in [0, 1]."""
    return find_ridges(ink, MAP_SIGMA, MAP_VALUE, MAP_CURVATURE)


def without_faint(ridges: Sequence[Ridges]) -> list[Ridges]:
    """The ridges of all views without those much fainter than most: where a detector is in doubt, there is no edge."""
    values = np.concatenate([r.values for r in ridges])
    least = FAINT * float(np.median(values)) if len(values) else 0.0
    return [r[r.values > least] for r in ridges]


def color_ridges(rgba: Float[NDArray[np.float32], "H W 4"]) -> Ridges:
    """Where colour or transparency changes fastest, colours straight, all in [0, 1]."""
    return find_ridges(color_gradient(rgba), COLOR_SIGMA, COLOR_VALUE, COLOR_CURVATURE)


def color_gradient(rgba: Float[NDArray[np.float32], "H W 4"]) -> Float[NDArray[np.float32], "H W"]:
    """log(1 + gradient / noise) of the premultiplied colours and of alpha."""
    from scipy.ndimage import gaussian_filter

    alpha = rgba[..., 3]
    # Three channels of colour count as much as the outline.
    channels = [(rgba[..., k] * alpha, 1 / 3) for k in range(3)] + [(alpha, 1.0)]
    square = np.zeros_like(alpha)
    for channel, share in channels:
        for order in ((0, 1), (1, 0)):
            square += share * gaussian_filter(channel, GRADIENT_SIGMA, order=order) ** 2
    return np.log1p(np.sqrt(square) / GRADIENT_NOISE)


def find_ridges(
    image: Float[NDArray[np.float32], "H W"], sigma: float, least_value: float, least_curvature: float
) -> Ridges:
    """Points where the image is largest across the direction of its strongest curvature.

    The second-order Taylor polynomial of the smoothed image has its top across the ridge at t n, n the eigenvector
    of the most negative eigenvalue l of the Hessian, t = -(gradient . n) / l; the pixel holds a ridge point if that lies
    within it.

    Args:
        sigma: of the Gaussian derivatives, pixels.
        least_value: of the smoothed image.
        least_curvature: -l.
    """
    from scipy.ndimage import gaussian_filter

    def derivative(*order: int) -> Array:
        return np.asarray(gaussian_filter(image, sigma, order=order, output=np.float64))

    value, gx, gy = derivative(0, 0), derivative(0, 1), derivative(1, 0)
    xx, xy, yy = derivative(0, 2), derivative(1, 1), derivative(2, 0)
    least = (xx + yy) / 2 - np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    nx, ny = _eigenvector(xx, xy, yy, least)
    top = -(gx * nx + gy * ny) / np.minimum(least, -1e-9)
    ridge = (least < -least_curvature) & (value > least_value)
    ridge &= (np.abs(top * nx) <= WITHIN) & (np.abs(top * ny) <= WITHIN)
    ridge[:BORDER] = ridge[-BORDER:] = ridge[:, :BORDER] = ridge[:, -BORDER:] = False
    y, x = np.nonzero(ridge)
    points = np.stack([x + 0.5 + (top * nx)[ridge], y + 0.5 + (top * ny)[ridge]], 1)
    return Ridges(points, np.stack([nx[ridge], ny[ridge]], 1), value[ridge])


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
