"""Outlines of smooth surfaces told apart from edges: an outline wanders over the surface as the view turns.

Seen along a curve, each view that shows it gives the direction n of its plane's normal and the offset e of its ridge
along n. An edge stays where it is: e = d . n for one displacement d. The outline of a surface whose section is a circle
of radius r moves with the normal: e = d . n + r. Such an outline also passes for one curve only in views that look
along the surface, so that the normals hardly spread; an edge is seen from a quarter of all directions or more.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Tensor
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.straight_lines import polyline_length
from diff3ds.edges.evidence.edge_views import OUTSIDE, EdgeViews
from diff3ds.edges.evidence.support import SAMPLES, crowded, inliers, owners, samples
from diff3ds.parallel.in_copies import in_copies

# [px, standard deviations; measured] The section's radius that tells an outline, pixels, and how many standard
# deviations it has to be from zero: between those of 396 edges and 55 outlines of generated objects, as is the spread
# below.
RADIUS, CERTAIN = 2.8, 5.0
# [px; measured] A radius certain to be below this, pixels, is that of an edge.
SHARP = 2.5
# [ratio, ratio, px; measured] Ratio of the normals' scatter along two directions. Views spread evenly over ± a about
# one direction give (1 - s) / (1 + s), s = sin 2a / 2a: .22 over the quarter turn that shows a square inner edge, less
# where a part of those views is blocked. Short pieces of less come together by chance; long ones, in pixels, hardly
# do.
SPREAD, LEAST_SPREAD, CHANCE = 0.13, 0.07, 15.0
# [ratio; derived] (a - sin a) / (a + sin a) for a = 2 pi / 5, a fifth of a turn, a little more than SPREAD. Where the
# cameras themselves are spread less, it says nothing: two rings as of a turntable have .2 for what is level.
FIFTH_TURN = 0.138
# [views, px, rounds; empirical] Views of a part that say anything, residual in pixels that counts half, rounds of
# reweighting.
FEWEST, SCATTER, ROUNDS = 10, 0.5, 8
# [curves; speed] So many are worth a copy of the process.
A_COPY = 40


def smooth_outlines(views: EdgeViews, curves: Curves, doubt: bool = False) -> Bool[Tensor, " N"]:
    """Which curves are outlines of smooth surfaces rather than edges.

    Args:
        doubt: take what may be either for an outline.
    """
    x, tangents = samples(curves)
    shown = inliers(views, x, tangents)
    owner = owners(curves)
    each = [np.nonzero(owner == i)[0] for i in range(len(curves))]

    def told(i: int) -> tuple[bool, bool]:
        """Whether a curve wanders, and whether the normals hardly spread though the cameras do."""
        on = each[i]
        inside, normals, offsets = _planes_along(views, x[on], tangents[on])
        least = SPREAD if polyline_length(x[on]) / views.pixel < CHANCE else LEAST_SPREAD
        narrow = _spread(shown[:, on], normals) < least
        if narrow:
            narrow = _spread(inside, unit(np.cross(x[on] - views.centers[:, None], tangents[on]))) > FIFTH_TURN
        return _wanders(shown[:, on], normals, offsets, doubt), narrow

    found, narrow = np.array(in_copies(told, len(each), max(1, len(each) // A_COPY)), bool).reshape(-1, 2).T
    # Where an edge beside it disturbs the ridges, an edge may look like an outline.
    clear = shown & ~crowded(views, x, tangents, by=~found[owner], at=shown & found[owner])
    for i in np.nonzero(found)[0].tolist():
        found[i] = _wanders(clear[:, each[i]], *_planes_along(views, x[each[i]], tangents[each[i]])[1:], doubt)
    return torch.from_numpy(found | narrow)


def _planes_along(
    views: EdgeViews, x: Float[Array, "S 3"], tangents: Float[Array, "S 3"]
) -> tuple[Bool[NDArray[np.bool_], "V S"], Float[Array, "V S 3"], Float[Array, "V S"]]:
    """Which views contain points of a curve, normals of the ridges' planes across it, and how far off these are,
    pixels.
    """
    match = views.match(x)
    planes = views.planes[match.ridge]
    normals = unit(planes[..., :3] - (planes[..., :3] * tangents).sum(-1, keepdims=True) * tangents)
    return match.distance < OUTSIDE, normals, -((planes[..., :3] * x).sum(-1) + planes[..., 3]) / views.pixel


def _parts(shown: Bool[NDArray[np.bool_], "V S"]) -> list[tuple[slice, Bool[NDArray[np.bool_], "V P"]]]:
    """Slices of the parts that enough views show, and these views."""
    parts = [slice(i, i + SAMPLES) for i in range(0, shown.shape[1], SAMPLES)]
    return [(p, shown[:, p]) for p in parts if shown[:, p].sum() >= FEWEST]


def _spread(shown: Bool[NDArray[np.bool_], "V S"], normals: Float[Array, "V S 3"]) -> float:
    """Ratio of the normals' scatter in two directions along a curve, mean over its parts; 1 if nothing is known."""
    scatter = np.einsum("vmi,vmj->mij", normals * shown[..., None], normals).reshape(-1, SAMPLES, 3, 3).sum(1)
    enough = shown.sum(0).reshape(-1, SAMPLES).sum(1) >= FEWEST
    values = np.linalg.eigvalsh(scatter[enough])
    return float((values[:, 1] / values[:, 2]).mean()) if enough.any() else 1.0


def _wanders(
    shown: Bool[NDArray[np.bool_], "V S"], normals: Float[Array, "V S 3"], offsets: Float[Array, "V S"], doubt: bool
) -> bool:
    """Whether the ridges move as a surface's outline does; in doubt, whether it is not certain that they do not."""
    told = [_without_displacement(normals[:, part][views], offsets[:, part][views]) for part, views in _parts(shown)]
    if not told:
        return doubt
    radius, deviation = _radius(*(np.concatenate(values) for values in zip(*told, strict=True)))
    if doubt:
        return abs(radius) + 2 * deviation >= SHARP
    return abs(radius) > RADIUS and abs(radius) > CERTAIN * deviation


def _without_displacement(normals: Float[Array, "M 3"], offsets: Float[Array, " M"]) -> tuple[Array, Array]:
    """What a displacement of the curve leaves of a constant and of the offsets."""
    _, vectors = np.linalg.eigh(normals.T @ normals)
    main, side = normals @ vectors[:, 2], normals @ vectors[:, 1]
    # The sign of a normal is open: those of an outline point out of the surface.
    sign = np.where(main < 0, -1.0, 1.0)
    basis = np.linalg.qr(np.stack([main * sign, side * sign], 1))[0]
    constant, left = (v - basis @ (basis.T @ v) for v in (np.ones(len(normals)), offsets * sign))
    return constant, left


def _radius(constant: Float[Array, " M"], left: Float[Array, " M"]) -> tuple[float, float]:
    """The radius of least squares, reweighted, and its standard deviation; samples of a part count as one."""
    weights: NDArray[np.float64] = np.ones(len(left))
    radius, residual = 0.0, left
    for turn in range(ROUNDS):
        radius = float((weights * constant * left).sum() / ((weights * constant**2).sum() + 1e-12))
        residual = left - radius * constant
        far = (residual / SCATTER) ** 2
        # At last, what does not fit says nothing: other lines, close to this one, where it is seen from the side.
        weights = 1 / (1 + far) if turn < ROUNDS // 2 else np.exp(-far / 2)
    variance = (weights * residual**2).sum() / weights.sum()
    return radius, float(np.sqrt(variance / ((weights * constant**2).sum() + 1e-12) * SAMPLES))
