"""Self-calibration of an edge detector: where its ridges lie beside the true edges, judged by the views' disagreement.

A detector's maps may be shifted by a part of a pixel, and outlines against the background lie outside the object by up
to one. Neither shows in a single view, but no 3D curve meets such ridges in all views: the shift and the offset that
leave the least disagreement, with every 3D sample free to move, are the detector's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.support import crowded, inliers, samples

# [rounds, px, px; empirical] Rounds of reweighting, and the residuals that count half in the first and the last of
# them. Few fit at the end: an edge beside an outline, taken for it, always lies on its inner side.
ROUNDS, FIRST_SCATTER, SCATTER = 25, 1.0, 0.15
# [px; empirical] Ridges within this distance of the filled drawing's border are outline; they lie BAND within it.
OUTLINE, BAND = 7.0, 3.0
# [px; empirical] What a disc of one of these radii cannot leave without crossing a ridge is inside: outlines have gaps,
# of up to twice the last.
CLOSED = (BAND, 5.0, 8.0, 12.0)
# [samples; empirical] Pull of a sample point towards where it is, in units of one view's: along the curve it cannot be
# seen at all.
ALONG, ACROSS = 0.1, 0.01
# [samples; speed] So many say enough of three numbers.
MOST_SAMPLES = 4000


@dataclass(frozen=True)
class Bias:
    """Where ridges lie, relative to the edges.

    Attributes:
        dx, dy: of all ridges, pixels.
        outward: of outlines, away from the object, pixels.
    """

    dx: float
    dy: float
    outward: float


def outline_sides(ridges: Ridges, size: tuple[int, int]) -> Float[Array, " M"]:
    """1 or -1 for ridge points on the object's outline, as their normals point away from or into it; else 0."""
    from scipy.ndimage import distance_transform_edt

    if not len(ridges):
        return np.zeros(0)
    column, row = np.floor(ridges.points).astype(int).T
    filled = _filled(row, column, size)
    depth = np.where(filled, distance_transform_edt(filled), -distance_transform_edt(~filled))
    gy, gx = np.gradient(depth)
    outward = -(gx[row, column] * ridges.normals[:, 0] + gy[row, column] * ridges.normals[:, 1])
    return np.where((depth[row, column] < OUTLINE) & (np.abs(outward) > 0.5), np.sign(outward), 0.0)


def _filled(row: NDArray[np.int64], column: NDArray[np.int64], size: tuple[int, int]) -> Bool[NDArray[np.bool_], "H W"]:
    """The largest part of what the drawn pixels enclose, and a band around them."""
    from scipy.ndimage import distance_transform_edt, label

    blank = np.ones(size, bool)
    blank[row, column] = False
    distance = distance_transform_edt(blank)
    filled = distance <= BAND
    for radius in CLOSED:
        parts, count = label(distance > radius)
        border = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
        open_air = np.isin(np.arange(count + 1), border)
        open_air[0] = True
        if not open_air.all():
            filled |= distance_transform_edt(open_air[parts]) <= radius
    parts, _ = label(filled)
    return np.asarray(parts == 1 + np.argmax(np.bincount(parts.ravel())[1:]))


def estimate_bias(views: EdgeViews, sides: Float[Array, " R"], curves: Curves) -> Bias:
    """The bias that explains most of the disagreement between the views.

    Args:
        sides: `outline_sides` of all ridge points.
        curves: near the edges.
    """
    x, tangent = samples(curves)
    shown = inliers(views, x, tangent)
    # All of them crowd those that are asked.
    asked = slice(None, None, max(1, -(-len(x) // MOST_SAMPLES)))
    some = np.zeros(len(x), bool)
    some[asked] = True
    agree = (shown & ~crowded(views, x, tangent, at=shown & some))[:, asked]
    x, tangent = x[asked], tangent[asked]
    match = views.match(x)
    normal = views.normals[match.ridge]
    offset = ((views.points[match.ridge] - match.pixel) * normal).sum(-1)
    # The offset along the normal is explained by the bias and by a displacement of the sample.
    explained = np.concatenate([normal, sides[match.ridge][..., None]], -1)
    moved = views.planes[match.ridge][..., :3] * (views.focal[:, None] / np.maximum(match.depth, 1e-9))[..., None]
    values = _solved(offset, explained, moved * views.pixel, agree, tangent)
    return Bias(*values.tolist())


def _solved(offset: Array, explained: Array, moved: Array, agree: NDArray[np.bool_], tangent: Array) -> Array:
    """Reweighted least squares of offset = explained . bias + moved . displacement, displacements eliminated."""
    bias = np.zeros(explained.shape[-1])
    shift = np.zeros_like(tangent)
    pull = ALONG * np.einsum("mi,mj->mij", tangent, tangent) + ACROSS * np.eye(3)
    for turn in range(ROUNDS):
        residual = offset - explained @ bias - np.einsum("vmk,mk->vm", moved, shift)
        scatter = FIRST_SCATTER * (SCATTER / FIRST_SCATTER) ** (turn / (ROUNDS - 1))
        weight = agree / (1 + (residual / scatter) ** 2)
        own = np.linalg.inv(np.einsum("vm,vmi,vmj->mij", weight, moved, moved) + pull)
        mixed = np.einsum("vm,vmi,vmk->mik", weight, moved, explained)
        right = np.einsum("vm,vmi,vm->mi", weight, moved, offset)
        left = np.einsum("vm,vmk,vml->kl", weight, explained, explained)
        left = left - np.einsum("mik,mij,mjl->kl", mixed, own, mixed)
        whole = np.einsum("vm,vmk,vm->k", weight, explained, offset) - np.einsum("mik,mij,mj->k", mixed, own, right)
        bias = np.linalg.lstsq(left, whole, rcond=None)[0]
        shift = np.einsum("mij,mj->mi", own, right - np.einsum("mik,k->mi", mixed, bias))
    return bias


def corrected(ridges: Sequence[Ridges], sides: Sequence[Float[Array, " _"]], bias: Bias) -> list[Ridges]:
    """The ridges where they would be without the bias."""
    shift = np.array([bias.dx, bias.dy])
    return [
        replace(r, points=r.points - shift - bias.outward * side[:, None] * r.normals)
        for r, side in zip(ridges, sides, strict=True)
    ]
