"""Lines of hatching as strokes with width along them."""

import numpy as np
import torch

from diff3ds._shapes import Array, Float
from diff3ds.chains import Chains
from diff3ds.page.picture import Picture
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hatching.hatch_lines import HatchChains
from diff3ds.surfaces.lines.fit_picture import FittedChains, fit_chains

# Of the strokes from the lines, pixels: a little more than of contours, since lines of triangles are not quite smooth.
TOLERANCE = 0.3
# So many points on, at most, a cubic ends: its width has four numbers.
POINTS = 32


def hatch_strokes(found: HatchChains, picture: Picture) -> tuple[Sketch, FittedChains]:
    """Strokes along lines, black, float64, of widths in image heights, and how they are fitted."""
    number = np.arange(len(found.points)) - np.repeat(found.first[:-1], np.diff(found.first))
    fitted = fit_chains(found.points, found.first, np.flatnonzero(number % POINTS == 0), picture, TOLERANCE)
    weights = fitted.control[..., 3]
    points = torch.from_numpy(fitted.control[..., :3] / weights[..., None])
    closed = (found.points[found.first[:-1]] == found.points[found.first[1:] - 1]).all(1)
    chains = Chains.of(np.bincount(fitted.chain, minlength=len(closed)).tolist(), closed.tolist())
    width = torch.from_numpy(_widths(fitted, found.width)) / picture.size[0]
    return Sketch(points, torch.from_numpy(weights / weights[:, :1]), width=width, chains=chains), fitted


def _widths(fitted: FittedChains, width: Float[Array, " M"]) -> Float[Array, "C 4"]:
    """Bernstein coefficients of cubics through the widths at both ends and two places between."""
    axis, place = fitted.places
    if not len(axis):
        return np.zeros((0, 4))
    at = np.interp((np.arange(len(fitted.start))[:, None] + np.array([1 / 3, 2 / 3])).ravel(), axis, place)
    between = np.interp(at, np.arange(len(width)), width).reshape(-1, 2)
    values = np.column_stack([width[fitted.start], between, width[fitted.stop]])
    inner = np.array([[-5 / 6, 3, -3 / 2, 1 / 3], [1 / 3, -3 / 2, 3, -5 / 6]])
    values[:, 1:3] = values @ inner.T
    return np.maximum(values, 0)
