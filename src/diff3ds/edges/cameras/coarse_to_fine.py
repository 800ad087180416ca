"""Cameras refined on the edges that their pictures show: first on coarse pixels, then on finer ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.edges.cameras.adjust import adjusted
from diff3ds.edges.cameras.find_again import agreement, found_again
from diff3ds.edges.cameras.posed import Posed, coarser, held
from diff3ds.edges.evidence.bias import outline_sides
from diff3ds.edges.evidence.edge_views import EdgeViews, edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.reconstruct import confirming, first_curves
from diff3ds.edges.watch import Report, no_report

# [px; empirical] Sides of the pixels that are looked at in turn, the last ones again. The edges of cameras that are off
# by 5 pixels still meet in pixels of 4; of 50 photographs of a part, off by 5 in the mean and 10 at most, a start with
# pixels of 8 lost two where one with pixels of 4 lost more, and left .6 of them instead of .9 in the median.
SIDES = (8, 4, 2, 1, 1)
# [ratio; empirical] So many of the usual views have to confirm an edge while cameras are still off.
EARLY = 0.8
# [ratio, ratio; empirical] A view is lost where it shows less of the curves, beyond what chance would, than so large a
# part of what the median view does, unless that shows hardly more than chance either. Of the photographs of
# `find_again` right cameras have .44 and more.
LOST, LEAST_AGREEMENT = 1 / 3, 1.5


@dataclass(frozen=True, eq=False)
class Refined:
    """Refined cameras.

    Attributes:
        world_to_camera, intrinsics: of all views.
        agreement: how many times as much of the curves each view shows as chance would; nan where there are no curves.
    """

    world_to_camera: Float[Tensor, "V 4 4"]
    intrinsics: Float[Tensor, "V 3 3"]
    agreement: Float[Array, " V"]

    @property
    def lost(self) -> Bool[NDArray[np.bool_], " V"]:
        """Views that agree with the others no more, and say nothing."""
        middle = float(np.median(self.agreement))
        lost = self.agreement - 1 < LOST * (middle - 1)
        return np.asarray(lost & (middle >= LEAST_AGREEMENT))

    def cameras(self, like: Cameras) -> Cameras:
        """As `Cameras`, with what else those before have."""
        return replace(like, world_to_camera=self.world_to_camera, intrinsics=self.intrinsics)


def refined_cameras(cameras: Cameras, ridges: Sequence[Ridges], report: Report = no_report) -> Refined:
    """The cameras with which the ridges of all views agree best; their mean place, direction and spread stay.

    Poses move, and all focal lengths by one factor. Where the views show no edges that agree, nothing moves. Views that
    are lost on the way are looked for again.

    Args:
        cameras: with perspective, in a frame where what they show fills the unit ball.
        ridges: of every view.
        report: told how far it is; see `watch`.
    """
    start = posed = Posed.of(cameras)
    least = confirming(sum(len(ridge) > 0 for ridge in ridges))
    agrees = np.full(len(ridges), np.nan)
    for turn, side in enumerate(SIDES):
        report("cameras", turn, len(SIDES), None, 0)
        now = coarser(posed, side)
        views, sides = _views(posed.cameras(cameras), ridges, side)
        curves = first_curves(views, least * (EARLY if side > 1 else 1.0))
        if len(curves):
            if side == 1:
                now = found_again(start, now, views, sides, curves)
            now = adjusted(coarser(start, side), now, views, sides, curves)
            if side == 1:
                agrees = agreement(now, views, sides, curves)
            posed = held(replace(now, focal=start.focal, principal=start.principal, lens=_finer(now, side)), start)
    found = posed.cameras(cameras)
    return Refined(found.world_to_camera, found.intrinsics, agrees)


def _finer(posed: Posed, side: int) -> np.ndarray:
    return np.asarray(posed.lens * np.array([1.0, side]))


def _views(cameras: Cameras, ridges: Sequence[Ridges], side: int) -> tuple[EdgeViews, np.ndarray]:
    """The ridges on pixels of this side, and `outline_sides` of all of them."""
    height, width = cameras.size
    lens = cameras.intrinsics / cameras.intrinsics.new_tensor([side, side, 1.0])[:, None]
    coarse = replace(cameras, intrinsics=lens, size=(-(-height // side), -(-width // side)))
    points = [replace(r, points=r.points / side, pulls=r.pulls / side) for r in ridges]
    return edge_views(coarse, points), np.concatenate([outline_sides(r, coarse.size) for r in points])
