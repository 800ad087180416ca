"""Cameras refined on the edges that their pictures show: first on coarse pixels, then on finer ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.distortion import Distortion
from diff3ds.edges.cameras.adjust import adjusted
from diff3ds.edges.cameras.find_again import LEAST_AGREEMENT, agreement, are_lost, are_surely_lost, found_again
from diff3ds.edges.cameras.lens_effect import LensEffect, bending
from diff3ds.edges.cameras.posed import Posed, coarser, held
from diff3ds.edges.cameras.right_already import RIGHT, gain_unseen
from diff3ds.edges.evidence.bias import outline_sides
from diff3ds.edges.evidence.edge_views import EdgeViews, edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.first_curves import first_curves
from diff3ds.edges.reconstruct import confirming
from diff3ds.edges.watch import Report, Tick, no_report

# [px; empirical] Sides of the pixels that are looked at in turn, the last ones again. The edges of cameras that are off
# by 5 pixels still meet in pixels of 4; of 50 photographs of a part, off by 5 in the mean and 10 at most, a start with
# pixels of 8 lost two where one with pixels of 4 lost more, and left .6 of them instead of .9 in the median.
SIDES = (8, 4, 2, 1, 1)
# [ratio; empirical] So many of the usual views have to confirm an edge while cameras are still off.
EARLY = 0.8
# [turn; empirical] The first on whole pixels looks for distortion, and decides about it: on coarse ones it was found,
# and large, in pictures that have none and show a part in their middle.
DECIDED = SIDES.index(1)
# [fraction, px; empirical] Distortion is there if it takes away so much of the squared residuals, and moves a corner so
# far. Of photographs without it took away .002 to .008; of 50 real ones whose lens was left out .044.
LEAST_GAIN, LEAST_BENT = 0.015, 0.3


@dataclass(frozen=True, eq=False)
class Refined:
    """Refined cameras.

    Attributes:
        world_to_camera, intrinsics: of all views.
        agreement: how many times as much of the curves each view shows as chance would; nan where there are no curves.
        k1: by how much the first radial coefficient of the one lens of all views is more than it was said to be.
    """

    world_to_camera: Float[Tensor, "V 4 4"]
    intrinsics: Float[Tensor, "V 3 3"]
    agreement: Float[Array, " V"]
    k1: float = 0.0

    @property
    def lost(self) -> Bool[NDArray[np.bool_], " V"]:
        """Views that agree with the others no more, and say nothing."""
        return are_lost(self.agreement)

    def cameras(self, like: Cameras) -> Cameras:
        """As `Cameras`, with what else those before have."""
        return replace(like, world_to_camera=self.world_to_camera, intrinsics=self.intrinsics)


def refined_cameras(
    cameras: Cameras,
    ridges: Sequence[Ridges],
    report: Report = no_report,
    lens: Distortion | None = None,
    *,
    textured: bool = False,
) -> Refined:
    """The cameras with which the ridges of all views agree best; their mean place, direction and spread stay.

    Cameras that are right already stay where they are (`right_already`), but for those that are lost.

    Poses move, and all focal lengths by one factor; so does the radial distortion, where one lens has taken all
    pictures and the views leave no doubt that it is another. Where the views show no edges that agree, nothing moves.
    Views that are lost on the way are looked for again.

    Args:
        cameras: with perspective, in a frame where what they show fills the unit ball.
        ridges: of every view.
        report: told how far it is; see `watch`.
        lens: that was taken out of all pictures; None if they have several, whose distortion stays.
        textured: the views are photographs: whether cameras are right already is asked of curves that have hardly come
            together by chance.
    """
    start = posed = Posed.of(cameras)
    least = confirming(sum(len(ridge) > 0 for ridge in ridges))
    agrees = np.full(len(ridges), np.nan)

    def ticks(stage: str) -> Tick:
        return lambda done, total: report(f"cameras: {stage}", done, total, None, 0)

    views, effect = _views(cameras, start, ridges, 1, lens)
    curves = first_curves(views, least, ticks, textured=textured)
    if (kept := _as_given(cameras, start, views, effect, curves)) is not None:
        return kept
    for turn, side in enumerate(SIDES):
        report("cameras", turn, len(SIDES), None, 0)
        now = coarser(posed, side)
        views, effect = _views(cameras, posed, ridges, side, lens if side == 1 else None)
        curves = first_curves(views, least * (EARLY if side > 1 else 1.0), ticks)
        if len(curves):
            if side == 1:
                now = found_again(start, now, views, effect, curves)
            moved, gain = adjusted(coarser(start, side), now, views, effect, curves)
            if turn == DECIDED and lens is not None and not is_bent(cameras, moved, lens, gain):
                # As if it had never been looked for.
                lens = None
                moved, _ = adjusted(coarser(start, side), now, views, LensEffect.fixed(effect.sides), curves)
            now = moved
            if side == 1:
                agrees = agreement(now, views, effect, curves)
            posed = held(replace(now, focal=start.focal, principal=start.principal, lens=_finer(now, side)), start)
        elif turn == DECIDED:
            lens = None
    found = posed.cameras(cameras)
    return Refined(found.world_to_camera, found.intrinsics, agrees, float(posed.lens[2]))


def _as_given(cameras: Cameras, start: Posed, views: EdgeViews, effect: LensEffect, curves: Curves) -> Refined | None:
    """The cameras that were given, but lost ones found again, if they are right; else None."""
    if len(curves) < 2:
        return None
    agrees = agreement(start, views, effect, curves)
    lost = are_surely_lost(agrees)
    if float(np.median(agrees)) < LEAST_AGREEMENT or gain_unseen(start, views, effect, curves, ~lost) > RIGHT:
        return None
    posed = start.with_poses(found_again(start, start, views, effect, curves), lost) if lost.any() else start
    found = posed.cameras(cameras) if lost.any() else cameras
    return Refined(found.world_to_camera, found.intrinsics, agreement(posed, views, effect, curves))


def is_bent(cameras: Cameras, posed: Posed, lens: Distortion, gain: float) -> bool:
    """Whether pictures show that the lens of the cameras as given has another distortion.

    Args:
        cameras: as given.
        posed: as refined.
        lens: of the cameras as given.
        gain: of its k1 (`adjusted`).
    """
    shift = bending(cameras, posed.cameras(cameras), lens).at_corners(cameras.size, float(posed.lens[2]))
    return gain > LEAST_GAIN and shift > LEAST_BENT


def _finer(posed: Posed, side: int) -> np.ndarray:
    return np.asarray(posed.lens * np.array([1.0, side, 1.0]))


def _views(
    cameras: Cameras, posed: Posed, ridges: Sequence[Ridges], side: int, lens: Distortion | None
) -> tuple[EdgeViews, LensEffect]:
    """The ridges on pixels of this side, as the cameras so far show them, and what the lens does to them."""
    given, cameras = cameras, posed.cameras(cameras)
    height, width = cameras.size
    matrix = cameras.intrinsics / cameras.intrinsics.new_tensor([side, side, 1.0])[:, None]
    coarse = replace(cameras, intrinsics=matrix, size=(-(-height // side), -(-width // side)))
    k1, bends = float(posed.lens[2]), [np.zeros((len(r), 2)) for r in ridges]
    if lens is not None:
        straight = bending(given, cameras, lens)
        ridges = [straight.ridges(r, k1, cameras.size) for r in ridges] if k1 else ridges
        bends = [straight.bends(r.points, k1) for r in ridges]
    points = [replace(r, points=r.points / side, pulls=r.pulls / side) for r in ridges]
    sides = [outline_sides(r, coarse.size) for r in points]
    return edge_views(coarse, points), LensEffect(np.concatenate(sides), np.concatenate(bends) / side, k1)
