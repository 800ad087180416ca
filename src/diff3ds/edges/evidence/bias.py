"""Self-calibration of an edge detector: where its ridges lie beside the true edges, judged by the views' disagreement.

A detector's maps may be shifted by a part of a pixel, and outlines against the background lie outside the object by up
to one. Neither shows in a single view, but no 3D curve meets such ridges in all views: the shift and the offset that
leave the least disagreement, with every 3D sample free to move, are the detector's.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.support import crowded, inliers, samples
from diff3ds.parallel.in_copies import in_copies
from diff3ds.parallel.side_by_side import side_by_side

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


def all_outline_sides(ridges: Sequence[Ridges], size: tuple[int, int]) -> list[Float[Array, " _"]]:
    """`outline_sides` of every view; kept with the ridges, of which it is asked again at the end."""
    new = [ridge for ridge in ridges if "_sides" not in ridge.__dict__]
    found = in_copies(lambda k: outline_sides(new[k], size), len(new), len(new))
    for ridge, sides in zip(new, found, strict=True):
        ridge.__dict__["_sides"] = sides
    return [ridge.__dict__["_sides"] for ridge in ridges]


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
    # Each component lies in a row: sums of each sample over the views are three times as fast.
    rows, by = (np.ascontiguousarray(np.moveaxis(values, -1, 0)) for values in (moved, explained))
    for turn in range(ROUNDS):
        residual = offset - explained @ bias - np.einsum("vmk,mk->vm", moved, shift)
        scatter = FIRST_SCATTER * (SCATTER / FIRST_SCATTER) ** (turn / (ROUNDS - 1))
        weight = agree / (1 + (residual / scatter) ** 2)
        left, scatter, mixed, right, whole = _at_once(
            partial(np.einsum, "vm,vmk,vml->kl", weight, explained, explained),
            partial(_of_samples, weight * rows, rows),
            partial(_of_samples, weight * rows, by),
            partial(_of_samples, weight * rows, offset[None]),
            partial(np.einsum, "vm,vmk,vm->k", weight, explained, offset),
        )
        own, right = np.linalg.inv(scatter + pull), right[..., 0]
        left = left - np.einsum("mik,mij,mjl->kl", mixed, own, mixed)
        whole = whole - np.einsum("mik,mij,mj->k", mixed, own, right)
        bias = np.linalg.lstsq(left, whole, rcond=None)[0]
        shift = np.einsum("mij,mj->mi", own, right - np.einsum("mik,k->mi", mixed, bias))
    return bias


def _at_once(*sums: Callable[[], Array]) -> list[Array]:
    return side_by_side(lambda k: sums[k](), len(sums), len(sums))


def _of_samples(a: Float[Array, "I V M"], b: Float[Array, "J V M"]) -> Float[Array, "M I J"]:
    """Of each sample the sums over the views of all products of components."""
    return np.stack([np.stack([(one * other).sum(0) for other in b], -1) for one in a], 1)


def corrected(ridges: Sequence[Ridges], sides: Sequence[Float[Array, " _"]], bias: Bias) -> list[Ridges]:
    """The ridges where they would be without the bias."""
    shift = np.array([bias.dx, bias.dy])
    return [
        replace(r, points=r.points - shift - bias.outward * side[:, None] * r.normals)
        for r, side in zip(ridges, sides, strict=True)
    ]
