"""Ends of strokes that come near each other, or near another stroke, moved there."""

import math

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import closest_point
from diff3ds.curves.directions import turns
from diff3ds.sketch import Sketch

# A stroke goes on in another where both turn by less than this, radians, into the gap between them. Empirical.
TURN = math.radians(30)


def close_gaps(sketch: Sketch, distance: float) -> Sketch:
    """Moves ends together that lie within a distance of each other, and other ends onto strokes that pass so near.

    Where a stroke goes on in another one the gap may be twice as wide.

    A stroke follows its ends: every control point moves by the fraction of both movements that lies at its place, which
    for weights of 1 adds a straight line to the curve.

    Args:
        sketch: of any degree.
        distance: world units; shorter than the strokes, so that none collapses.
    """
    if len(sketch) < 2:
        return sketch
    ends = sketch.points[:, [0, -1]].detach()
    wanted = _met(ends.reshape(-1, 3), distance).reshape_as(ends)
    for further in (_continued(sketch, ends, 2 * distance), _onto_strokes(sketch, ends, distance)):
        alone = (wanted == ends).all(-1)
        wanted[alone] = further[alone]
    moved = wanted - ends
    fraction = torch.linspace(0, 1, sketch.points.shape[1], dtype=ends.dtype)[:, None]
    return sketch.replace(points=sketch.points + (1 - fraction) * moved[:, :1] + fraction * moved[:, 1:])


def _met(ends: Float[Tensor, "E 3"], distance: float) -> Float[Tensor, "E 3"]:
    """Ends in groups of which all lie within the distance of each other, at the mean of their group."""
    from scipy.cluster.hierarchy import fcluster, linkage

    groups = fcluster(linkage(ends.double().numpy(), "complete"), distance, "distance") - 1
    index = torch.from_numpy(groups.astype(np.int64))
    sums = ends.new_zeros(int(index.max()) + 1, 3).index_add_(0, index, ends)
    counts = torch.bincount(index)
    means = (sums / counts[:, None])[index]
    return torch.where(counts[index][:, None] > 1, means, ends)


def _continued(sketch: Sketch, ends: Float[Tensor, "N 2 3"], distance: float) -> Float[Tensor, "N 2 3"]:
    """Ends that face each other, each the other's nearest, half way between."""
    flat = ends.reshape(-1, 3)
    # Out of the stroke, along the chord to the control point that is not in the same place.
    inner = sketch.points.detach()[:, [1, -2]]
    outward = (ends - inner).reshape(-1, 3)
    gap = flat[None] - flat[:, None]
    length = gap.norm(dim=-1)
    facing = torch.from_numpy(turns(outward[:, None].double().numpy(), gap.double().numpy()) < TURN)
    fits = facing & facing.T & (length > 0) & (length < distance)
    away = length.masked_fill(~fits, torch.inf)
    other = away.argmin(1)
    pairs = fits.any(1) & (other[other] == torch.arange(len(flat)))
    return torch.where(pairs[:, None], (flat + flat[other]) / 2, flat).reshape_as(ends)


def _onto_strokes(sketch: Sketch, ends: Float[Tensor, "N 2 3"], distance: float) -> Float[Tensor, "N 2 3"]:
    """Ends at the nearest point of any other stroke, where that is near enough."""
    count = len(sketch)
    queries = ends.reshape(1, -1, 3).expand(count, -1, 3)
    found = closest_point(sketch.points.detach(), sketch.weights.detach(), queries)
    own = torch.arange(count).repeat_interleave(2)
    away = found.distance.clone()
    away[own, torch.arange(2 * count)] = torch.inf
    nearest = away.argmin(0)
    place = found.point[nearest, torch.arange(2 * count)]
    near = away.amin(0) < distance
    return torch.where(near[:, None], place, ends.reshape(-1, 3)).reshape_as(ends)
