"""Bundle adjustment on edges: cameras, a lens and the points of curves, so that curves meet the ridges of all views.

A sample point of a curve lies beside a ridge in each view that shows it; how far is known across the ridge, and not
along it. Poses of all views, one factor of all focal lengths, the outward offset of outlines, a radial distortion and a
displacement of every sample point are solved for together, in Gauss-Newton steps with weights that fall off for ridges
that fit badly. Displacements are eliminated point by point, as in `evidence.bias`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.cameras.lens_effect import LensEffect
from diff3ds.edges.cameras.posed import NUMBERS, Posed, rotation_vectors
from diff3ds.edges.evidence.bias import ACROSS, ALONG
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import NEAR, crowded, inliers, samples

# [rounds, px, px; empirical] Gauss-Newton steps, and the residuals that count half in the first and the last of them.
ROUNDS, FIRST_SCATTER, SCATTER = 15, 1.5, 0.3
# Ridges so far away may be those of a curve in the first round, pixels; in the last those that are inliers.
FAR = 2 * NEAR
# [px; empirical] A view that shows fewer ridges so near than before stays where it was.
SURE = 1.0
# [samples; speed] Sample points that are looked at, at most: evenly chosen ones, of long curves as of short ones.
MOST_SAMPLES = 3000
# [rad, ratio, px, 1; empirical] Of the pull towards the cameras that were given: so much of a turn, of a move
# relative to the distance, of the focal length, of outlines and of k1 counts as one sample point that is a pixel off,
# next to nothing, but where the ridges say nothing.
TURNED, MOVED, OUTWARD, BENT = 0.001, 0.002, 0.2, 0.1
# [times; empirical] Cameras so many times as far from what was given are pulled half as much: what is lost by far was
# not given well.
DOUBTED = 10.0
# [views; derived] Fewer views than this fix no sample point and no camera at once.
LEAST_VIEWS = 3


def adjusted(start: Posed, posed: Posed, views: EdgeViews, effect: LensEffect, curves: Curves) -> tuple[Posed, float]:
    """The cameras with which the curves, free to move, meet the ridges best, and what k1 gains (`Normal.gain`).

    Args:
        start: the cameras that were given, near which they stay where the ridges say nothing.
        posed: the cameras so far.
        views: ridges as the pictures show them; their cameras do not count.
        effect: of the lens, on all ridge points.
        curves: near the edges, by the cameras so far.
    """
    moved, x, tangent, normal = settled(start, posed, views, effect, curves)
    # A view that has lost its way shows less than before.
    now, before = (inliers(p.views(views, effect), x, tangent, SURE).sum(1) for p in (moved, posed))
    return moved.with_poses(posed, now < before), normal.gain(float(moved.lens[2]))


def settled(
    start: Posed, posed: Posed, views: EdgeViews, effect: LensEffect, curves: Curves
) -> tuple[Posed, Float[Array, "M 3"], Float[Array, "M 3"], "Normal"]:
    """The cameras after all steps, the sample points and their tangents, and the equations of the last step.

    Args:
        start: as for `adjusted`, and so all others.
    """
    x, tangent = some_samples(curves)
    seen = posed.views(views, effect)
    alone = ~crowded(seen, x, tangent, at=inliers(seen, x, tangent, FAR))
    for far, scatter in narrowing():
        shown = inliers(seen, x, tangent, far) & alone
        shown &= shown.sum(0) >= LEAST_VIEWS
        normal = normal_equations(start, posed, equations(posed, seen, effect, x, shown, scatter), seen.pixel, tangent)
        step, away = normal.solved()
        posed, x = posed.stepped(step[:-NUMBERS].reshape(-1, 6), step[-NUMBERS:]), x + away
        seen = posed.views(views, effect)
    return posed, x, tangent, normal


def some_samples(curves: Curves) -> tuple[Float[Array, "M 3"], Float[Array, "M 3"]]:
    """As `samples`, but no more than `MOST_SAMPLES`."""
    x, tangent = samples(curves)
    if len(x) > MOST_SAMPLES:
        chosen = np.arange(MOST_SAMPLES) * len(x) // MOST_SAMPLES
        x, tangent = x[chosen], tangent[chosen]
    return x, tangent


def narrowing() -> Iterator[tuple[float, float]]:
    """For each Gauss-Newton step how far ridges may lie, and which residuals count half, pixels."""
    for turn in range(ROUNDS):
        fraction = turn / (ROUNDS - 1)
        yield FAR * (NEAR / FAR) ** fraction, FIRST_SCATTER * (SCATTER / FIRST_SCATTER) ** fraction


@dataclass(frozen=True)
class Equations:
    """Linear equations of the residuals, one for each view and sample point."""

    residual: Float[Array, "V M"]
    weight: Float[Array, "V M"]
    pose: Float[Array, "V M 6"]
    lens: Float[Array, "V M 3"]
    place: Float[Array, "V M 3"]


def equations(
    posed: Posed,
    seen: EdgeViews,
    effect: LensEffect,
    x: Float[Array, "M 3"],
    shown: Bool[NDArray[np.bool_], "V M"],
    scatter: float,
) -> Equations:
    """How the offsets of ridges from the points, across them, change with poses, lens and places."""
    match = seen.match(x)
    normal = seen.normals[match.ridge]
    residual = ((seen.points[match.ridge] - match.pixel) * normal).sum(-1)
    local = x @ posed.rotation.transpose(0, 2, 1) + posed.shift[:, None]
    depth = np.where(np.abs(local[..., 2]) < 1e-9, 1e-9, local[..., 2])
    off = match.pixel - posed.principal[:, None]
    focal = posed.focals[:, None]
    # Of n . u, u the pixel: its derivative by the point before the camera.
    flat = normal * focal / depth[..., None]
    before = np.concatenate([flat, -(normal * off).sum(-1, keepdims=True) / depth[..., None]], -1)
    pose = np.concatenate([np.cross(local, before), before], -1)
    # Ridges that lie farther outside are those of curves that lie less far.
    bent = -(normal * effect.bends[match.ridge]).sum(-1)
    lens = np.stack([(normal * off).sum(-1), effect.sides[match.ridge], bent], -1)
    weight = shown / (1 + (residual / scatter) ** 2)
    return Equations(residual, weight, pose, lens, before @ posed.rotation)


@dataclass(frozen=True, eq=False)
class Normal:
    """The normal equations of one Gauss-Newton step, for K numbers of cameras, without displacements.

    Attributes:
        rows: the equations, with displacements in pixels at the middle of the scene, as their pulls are.
        pixel: in world units.
        left, right: of the numbers of cameras.
        tight, back: what is expected of them (`expected`).
        square: the inverse of each displacement's own equations.
        both, offset: of displacements by numbers of cameras, and by residuals.
    """

    rows: Equations
    pixel: float
    left: Float[Array, "K K"]
    right: Float[Array, " K"]
    tight: Float[Array, " K"]
    back: Float[Array, " K"]
    square: Float[Array, "M 3 3"]
    both: Float[Array, "M 3 K"]
    offset: Float[Array, "M 3"]

    def solved(self) -> tuple[Float[Array, " K"], Float[Array, "M 3"]]:
        """The step of cameras, and that of points in world units."""
        whole = self.left + np.diag(self.tight)
        step = np.asarray(np.linalg.solve(whole, self.right + self.tight * self.back), dtype=np.float64)
        return step, (self.square @ (self.offset - self.both @ step)[..., None])[..., 0] * self.pixel

    def squares(self, step: Float[Array, " K"]) -> float:
        """The sum of the squared residuals, weighted, after a step of the cameras, with the points free to move."""
        here = (self.rows.weight * self.rows.residual**2).sum()
        here -= np.einsum("mi,mij,mj->", self.offset, self.square, self.offset)
        return float(here - 2 * self.right @ step + step @ self.left @ step)

    def gain(self, k1: float) -> float:
        """What of the sum of the squared residuals, weighted, k1 takes away, all other numbers free to move.

        The extra sum of squares of regression: the sum grows by k1 squared over its entry of the inverse without it.
        """
        entry = np.linalg.solve(self.left + np.diag(self.tight), np.eye(len(self.right))[-1])[-1]
        extra = k1**2 / entry
        return float(extra / max(extra + (self.rows.weight * self.rows.residual**2).sum(), 1e-300))


def normal_equations(start: Posed, posed: Posed, rows: Equations, pixel: float, tangent: Float[Array, "M 3"]) -> Normal:
    """Of these equations."""
    count, poses = len(posed.rotation), 6 * len(posed.rotation)
    rows = replace(rows, place=rows.place * pixel)
    weighted = rows.weight[..., None]
    left, right = np.zeros((poses + NUMBERS, poses + NUMBERS)), np.zeros(poses + NUMBERS)
    own = np.einsum("vmi,vmj->vij", weighted * rows.pose, rows.pose)
    mixed = np.einsum("vmi,vmj->vij", weighted * rows.pose, rows.lens)
    for view in range(count):
        at = slice(6 * view, 6 * view + 6)
        left[at, at], left[at, poses:], left[poses:, at] = own[view], mixed[view], mixed[view].T
    left[poses:, poses:] = np.einsum("vmi,vmj->ij", weighted * rows.lens, rows.lens)
    right[:poses] = np.einsum("vm,vmi->vi", rows.weight * rows.residual, rows.pose).ravel()
    right[poses:] = np.einsum("vm,vmi->i", rows.weight * rows.residual, rows.lens)
    pull = ALONG * np.einsum("mi,mj->mij", tangent, tangent) + ACROSS * np.eye(3)
    square = np.linalg.inv(np.einsum("vmi,vmj->mij", weighted * rows.place, rows.place) + pull)
    both = np.concatenate(
        [
            np.einsum("vmi,vmj->mivj", weighted * rows.place, rows.pose).reshape(-1, 3, poses),
            np.einsum("vmi,vmj->mij", weighted * rows.place, rows.lens),
        ],
        -1,
    )
    offset = np.einsum("vm,vmi->mi", rows.weight * rows.residual, rows.place)
    root = np.linalg.cholesky(square).transpose(0, 2, 1)
    halves = (root @ both).reshape(-1, poses + NUMBERS)
    left -= halves.T @ halves
    right -= halves.T @ (root @ offset[..., None]).ravel()
    return Normal(rows, pixel, left, right, *expected(start, posed), square, both, offset)


def expected(start: Posed, posed: Posed) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Weights of what is expected of the numbers, and the steps that lead back to it."""
    turned = rotation_vectors(start.rotation @ posed.rotation.transpose(0, 2, 1))
    aside = np.einsum("vij,vj->vi", posed.rotation, posed.centers - start.centers)
    distance = np.linalg.norm(start.centers, axis=1)
    off = (turned / TURNED) ** 2 + (aside / (MOVED * distance[:, None])) ** 2
    believed = 1 / (1 + off.sum(1, keepdims=True) / DOUBTED**2)
    tight = np.concatenate([np.full((len(distance), 3), TURNED**-2), np.tile((MOVED * distance[:, None]) ** -2, 3)], 1)
    tight = believed * tight
    lens = np.array([MOVED, OUTWARD, BENT]) ** -2
    back = np.concatenate([np.concatenate([turned, aside], 1).ravel(), -posed.lens])
    return np.concatenate([tight.ravel(), lens]), back
