"""Outlines of smooth surfaces told apart from edges: an outline wanders over the surface as the view turns.

Seen along a curve, each view that shows it gives the direction n of its plane's normal and the offset e of its ridge
along n. An edge stays where it is: e = d . n for one displacement d. The outline of a surface whose section is a circle
of radius r moves with the normal: e = d . n + r. Such an outline also passes for one curve only in views that look
along the surface, so that the normals hardly spread; an edge is seen from a quarter of all directions or more.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.edges.curves import Curves
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.ridges import Array
from diff3ds.edges.support import PARTS, SAMPLES, agreement

# The section's radius that tells an outline, pixels, and how many standard deviations it has to be from zero: between
# those of 396 edges and 55 outlines of generated objects, as is the spread below.
RADIUS, CERTAIN = 2.8, 5.0
# A radius certain to be below this, pixels, is that of an edge.
SHARP = 1.2
# Ratio of the normals' scatter along two directions. Views spread evenly over ± a about one direction give
# (1 - s) / (1 + s), s = sin 2a / 2a: .22 over the quarter turn that shows a square inner edge, less where a part of
# those views is blocked.
SPREAD = 0.13
# Views of a part that say anything, residual in pixels that counts half, rounds of reweighting.
FEWEST, SCATTER, ROUNDS = 10, 0.5, 5


def smooth_outlines(views: EdgeViews, curves: Curves, doubt: bool = False) -> Bool[Tensor, " N"]:
    """Which curves are outlines of smooth surfaces rather than edges.

    Args:
        doubt: take what may be either for an outline.
    """
    count = PARTS * SAMPLES
    t = (torch.arange(count) + 0.5) / count
    x = curves.at(t).double().numpy()
    tangents = np.gradient(x, axis=1)
    tangents /= np.linalg.norm(tangents, axis=2, keepdims=True) + 1e-12
    return torch.tensor([_is_outline(views, *curve, doubt) for curve in zip(x, tangents, strict=True)], dtype=torch.bool)


def _is_outline(views: EdgeViews, x: Float[Array, "S 3"], tangents: Float[Array, "S 3"], doubt: bool) -> bool:
    shown = agreement(views, x, tangents)
    planes = views.planes[views.match(x).ridge]
    normals = planes[..., :3] - (planes[..., :3] * tangents).sum(-1, keepdims=True) * tangents
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True) + 1e-12
    offsets = -((planes[..., :3] * x).sum(-1) + planes[..., 3]) / views.pixel
    parts = [slice(i * SAMPLES, (i + 1) * SAMPLES) for i in range(PARTS)]
    seen = [_part(normals[:, p][shown[:, p]], offsets[:, p][shown[:, p]]) for p in parts]
    told = [part for part in seen if part is not None]
    if not told:
        return doubt
    radius, deviation = _radius(np.concatenate([p[0] for p in told]), np.concatenate([p[1] for p in told]))
    if abs(radius) + 2 * deviation < SHARP:
        return False
    wanders = abs(radius) > RADIUS and abs(radius) > CERTAIN * deviation
    return doubt or wanders or bool(np.mean([p[2] for p in told]) < SPREAD)


def _part(normals: Float[Array, "M 3"], offsets: Float[Array, " M"]) -> tuple[Array, Array, float] | None:
    """What the displacement leaves of a constant and of the offsets, and the spread of the normals."""
    if len(normals) < FEWEST:
        return None
    values, vectors = np.linalg.eigh(normals.T @ normals)
    main, side = normals @ vectors[:, 2], normals @ vectors[:, 1]
    # The sign of a normal is open: those of an outline point out of the surface.
    sign = np.where(main < 0, -1.0, 1.0)
    basis = np.linalg.qr(np.stack([main * sign, side * sign], 1))[0]
    constant, left = (v - basis @ (basis.T @ v) for v in (np.ones(len(normals)), offsets * sign))
    return constant, left, float(values[1] / values[2])


def _radius(constant: Float[Array, " M"], left: Float[Array, " M"]) -> tuple[float, float]:
    """The radius of least squares, reweighted, and its standard deviation; samples of a part count as one."""
    weights: NDArray[np.float64] = np.ones(len(left))
    radius, residual = 0.0, left
    for _ in range(ROUNDS):
        radius = float((weights * constant * left).sum() / ((weights * constant**2).sum() + 1e-12))
        residual = left - radius * constant
        weights = 1 / (1 + (residual / SCATTER) ** 2)
    variance = (weights * residual**2).sum() / weights.sum()
    return radius, float(np.sqrt(variance / ((weights * constant**2).sum() + 1e-12) * SAMPLES))
