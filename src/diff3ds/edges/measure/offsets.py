"""Parameters of a bent curve by least squares of the ridges' offsets, with rims of holes recognised.

A detector pushes outlines out of the object (see `bias`). Where a hole shows the background, its rim is such an
outline, pushed into the hole; an edge map does not say where. So each part of a curve in each view is taken to lie
where it is, or to be pushed to its inner side by the known offset, whichever agrees better with the other views.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.edges.evidence.bias import SCATTER
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.ridges import AROUND
from diff3ds.edges.evidence.support import NEAR, SAMPLES

# [rounds, px; empirical] Rounds of reweighting; residuals that count half in the first of them, in the last as those of
# the bias.
ROUNDS, FIRST_SCATTER = 12, 0.5
# [samples; empirical] Pull of every parameter towards where it was, in units of one view's sample: decides what the
# views leave open.
PULL = 0.05
# [px; empirical] Least and largest scatter of a part's ridges together.
PART_SCATTER = (0.07, 0.3)
# [fraction; empirical] The fractions of parts taken for pushed at the start: few, or half of them. Most is no start:
# rims pushed everywhere look like a larger circle.
FIRST_PUSHED = (0.1, 0.5)
# [fraction; numerical] Least fraction of pushed parts that is found, and of others.
LEAST_PUSHED = 0.02
PUSHED = (LEAST_PUSHED, 1 - LEAST_PUSHED)
# [ratio; derived] The standard deviation of a normal distribution by its median absolute deviation.
FROM_MEDIAN = 1.48
# [px; numerical] So far before and after each sample point lie the points that say how a curve bends there.
STEP_ALONG = 0.5
# [fraction; empirical] Fraction of parts that show something else, evenly over the range of inliers to both sides.
STRAYS = 0.1
STRAY_RANGE = 2 * NEAR
# A smaller offset of outlines cannot be told from the ridges' scatter.
LEAST_OUTWARD = PART_SCATTER[0]

# From parameters, world units, all zero at the start, to points of the curve in between: three rows, a little before,
# at, and after each of its S sample points.
Shape = Callable[[Float[Array, " K"]], Float[Array, "3 S 3"]]


def fitted(
    shape: Shape,
    count: int,
    inside: Float[Array, " 3"],
    shown: Bool[NDArray[np.bool_], "V S"],
    views: EdgeViews,
    outward: float,
    rim: Bool[NDArray[np.bool_], "V S"] | None = None,
    joints: Bool[NDArray[np.bool_], " S"] | None = None,
) -> Float[Array, " K"]:
    """The parameters near zero that agree best with the ridges.

    Args:
        count: of the parameters.
        inside: a point on the curve's inner side.
        shown: which views show which of the sample points.
        outward: offset of outlines, pixels.
        rim: which sample points are pushed in which views if the curve is the rim of a hole through the object.
        joints: which sample points lie next to another curve, see `near_joints`; default none.
    """
    shown = shown & ~_tight(shape(np.zeros(count)), views)
    if outward <= LEAST_OUTWARD:
        return _least_squares(shape, count, inside, shown, views, outward, 0.0, joints)[1]
    pushed: list[float | Array] = [*FIRST_PUSHED]
    if rim is not None:
        pushed += [rim.astype(np.float64), np.zeros(rim.shape)]
    fits = [_least_squares(shape, count, inside, shown, views, outward, first, joints) for first in pushed]
    return min(fits, key=lambda fit: fit[0])[1]


def near_joints(x: Float[Array, "S 3"], joints: Float[Array, "J 3"], pixel: float) -> Bool[NDArray[np.bool_], " S"]:
    """Which sample points lie so near a joint of two curves that the curvature of their ridges was measured on both."""
    return np.asarray(np.linalg.norm(x[:, None] - joints, axis=2).min(1) < AROUND * pixel)


def _tight(places: Float[Array, "3 S 3"], views: EdgeViews) -> Bool[NDArray[np.bool_], "V S"]:
    """Where the curve bends so fast in a view that its ridges are off: their curvature was measured over that far."""
    before, x, after = (views.project(p)[0] for p in places)
    first, second = (after - before) / 2, after + before - 2 * x
    turn = np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])
    return np.asarray(turn * AROUND > np.linalg.norm(first, axis=-1) ** 3)


def residuals(shape: Shape, count: int, inside: Float[Array, " 3"], views: EdgeViews, outward: float) -> Array:
    """How far ridges lie (V, S) from the curve, or from where it is pushed to if that is nearer, pixels."""
    offset, _, inward = _offsets(shape(np.zeros(count)), inside, views)
    return np.minimum(np.abs(offset), np.abs(offset - inward * outward))


def _least_squares(
    shape: Shape,
    count: int,
    inside: Float[Array, " 3"],
    shown: Bool[NDArray[np.bool_], "V S"],
    views: EdgeViews,
    outward: float,
    pushed: float | Array,
    joints: Bool[NDArray[np.bool_], " S"] | None,
) -> tuple[float, Float[Array, " K"]]:
    """How unlikely what the views show is with the best parameters, and these: Gauss and Newton, reweighted.

    Args:
        pushed: the probability at first that a part is pushed inwards; or by how much of the offset each
            sample point is.
    """
    known = isinstance(pushed, np.ndarray)
    push = np.broadcast_to(pushed, shown.shape)
    value = np.zeros(count)
    pull = PULL / views.pixel**2
    for turn in range(ROUNDS):
        offset, moved, inward = _offsets(shape(value), inside, views, joints)
        scatter = FIRST_SCATTER * (SCATTER / FIRST_SCATTER) ** (turn / (ROUNDS - 1))
        if outward > LEAST_OUTWARD and turn and not known:
            push = _pushed(offset, inward * outward, shown, push)
        residual = offset - push * inward * outward
        square = (residual / scatter) ** 2
        weight = shown / (1 + square)
        step = 1e-3 * views.pixel * np.eye(count)
        slope = np.stack([shape(value + s)[1] - shape(value - s)[1] for s in step], -1) / (2e-3 * views.pixel)
        design = (moved.transpose(1, 0, 2) @ slope).transpose(2, 1, 0).reshape(count, -1)
        weighted = design * weight.ravel()
        # Sums in one order, however many threads there are.
        matrix = (weighted[:, None] * design).sum(-1) + pull * np.eye(count)
        right = (weighted * residual.ravel()).sum(-1) - pull * value
        value = value + np.linalg.solve(matrix, right)
    offset, _, inward = _offsets(shape(value), inside, views, joints)
    rest = offset - push * inward * outward if known else offset
    return _unlikely(rest, inward * outward, shown, known), value


def _unlikely(offset: Array, push: Array, shown: Bool[NDArray[np.bool_], "V S"], known: bool) -> float:
    """How unlikely the offsets of parts are, nats: each lies at zero or is pushed, by chance, or is a stray.

    A part's ridges are off by their mean together, so that they say as much as one. The fraction of pushed ones and the
    scatter are the likeliest: else half of them pushed at will would fit anything.

    Args:
        known: which are pushed is known, and taken off the offsets.
    """
    parts = (len(offset), -1, SAMPLES)
    count = shown.reshape(parts).sum(-1)
    seen = count > 0
    far = float(np.abs(push).max())
    mean = (np.where(shown, offset * np.sign(push), 0.0).reshape(parts).sum(-1) / np.maximum(count, 1))[seen]
    if not mean.size:
        return 0.0
    centers = np.array([0.0] if known else [0.0, far])
    fraction, scatter = np.full(len(centers), 1 / len(centers)), PART_SCATTER[1]
    for _ in range(ROUNDS):
        square = ((mean[:, None] - centers) / scatter) ** 2
        density = (1 - STRAYS) * fraction * np.exp(-square / 2) / (np.sqrt(2 * np.pi) * scatter)
        total = density.sum(1) + STRAYS / STRAY_RANGE
        belongs = density / total[:, None]
        weight = belongs.sum(0) + 1e-9
        fraction = weight / weight.sum()
        scatter = float(np.clip(np.sqrt((belongs * square).sum() / weight.sum()) * scatter, *PART_SCATTER))
    return -float(np.log(total).sum())


def _offsets(
    places: Float[Array, "3 S 3"],
    inside: Float[Array, " 3"],
    views: EdgeViews,
    joints: Bool[NDArray[np.bool_], " S"] | None = None,
) -> tuple[Float[Array, "V S"], Float[Array, "V S 3"], Float[Array, "V S"]]:
    """How far the ridges lie from the curve along their normals, pixels.

    The smoothing has pulled them inwards by their curvature, which was measured some way to both sides. Next to another
    curve, at the joints, the curve's own curvature is taken instead.

    Returns the offsets, what a displacement of each sample point adds to where it appears (pixels by world unit), and
    the normals' component to the inner side, 1 or -1.
    """
    before, x, after = places
    match = views.match(x)
    normal = views.normals[match.ridge]
    apart = views.points[match.ridge] - match.pixel
    # A ridge point beside the sample point: its normal has turned, so that the curve seems to bend the other way.
    ahead, back = views.project(after)[0], views.project(before)[0]
    first, second = (ahead - back) / 2, ahead + back - 2 * match.pixel
    along = (apart * first).sum(-1, keepdims=True) / ((first**2).sum(-1, keepdims=True) + 1e-12)
    offset = ((apart + 0.5 * along**2 * second) * normal).sum(-1)
    if joints is not None:
        square = (first**2).sum(-1, keepdims=True) + 1e-12
        bend = (second - (second * first).sum(-1, keepdims=True) * first / square) / square
        pulls = views.pulls[match.ridge] - views.softness * (bend * normal).sum(-1)
        offset = offset + np.where(joints, pulls, 0.0)
    scale = (views.focal[:, None] / np.maximum(match.depth, 1e-9))[..., None]
    inward = np.sign(((views.project(inside[None])[0] - match.pixel) * normal).sum(-1))
    return offset, views.planes[match.ridge][..., :3] * scale, inward


def _pushed(offset: Array, push: Array, shown: Bool[NDArray[np.bool_], "V S"], before: Array) -> Array:
    """The probability that a rim is pushed, equal in each part and view: one step of expectation and maximisation.

    A part's ridges are off by their mean together, so that they say as much as one.
    """
    parts = (len(offset), -1, SAMPLES)
    count = shown.reshape(parts).sum(-1)
    mean = np.where(shown, offset * np.sign(push), 0.0).reshape(parts).sum(-1) / np.maximum(count, 1)
    seen = count > 0
    far = np.abs(push).max()
    old = before.reshape(parts).mean(-1)
    fraction = np.clip(old[seen].mean() if seen.any() else 0.0, *PUSHED)
    residual = np.abs(mean - far * old)[seen]
    scatter = np.clip(FROM_MEDIAN * np.median(residual) if seen.any() else 1.0, *PART_SCATTER)
    more = (mean**2 - (mean - far) ** 2) / (2 * scatter**2) + np.log(fraction / (1 - fraction))
    return np.repeat(1 / (1 + np.exp(-np.clip(more, -50, 50))), SAMPLES, axis=1)
