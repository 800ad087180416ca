"""Cameras refined on the edges that their pictures show: first on coarse pixels, then on finer ones."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diff3ds.camera import Cameras
from diff3ds.edges.cameras.adjust import adjusted
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


def refined_cameras(cameras: Cameras, ridges: Sequence[Ridges], report: Report = no_report) -> Cameras:
    """The cameras with which the ridges of all views agree best; their mean place, direction and spread stay.

    Poses move, and all focal lengths by one factor. Where the views show no edges that agree, nothing moves.

    Args:
        cameras: with perspective, in a frame where what they show fills the unit ball.
        ridges: of every view.
        report: told how far it is; see `watch`.
    """
    start = posed = Posed.of(cameras)
    least = confirming(sum(len(ridge) > 0 for ridge in ridges))
    for turn, side in enumerate(SIDES):
        report("cameras", turn, len(SIDES), None, 0)
        now = coarser(posed, side)
        views, sides = _views(posed.cameras(cameras), ridges, side)
        curves = first_curves(views, least * (EARLY if side > 1 else 1.0))
        if len(curves):
            found = adjusted(coarser(start, side), now, views, sides, curves)
            posed = held(replace(found, focal=start.focal, principal=start.principal, lens=_finer(found, side)), start)
    return posed.cameras(cameras)


def _finer(posed: Posed, side: int) -> np.ndarray:
    return np.asarray(posed.lens * np.array([1.0, side]))


def _views(cameras: Cameras, ridges: Sequence[Ridges], side: int) -> tuple[EdgeViews, np.ndarray]:
    """The ridges on pixels of this side, and `outline_sides` of all of them."""
    height, width = cameras.size
    lens = cameras.intrinsics / cameras.intrinsics.new_tensor([side, side, 1.0])[:, None]
    coarse = replace(cameras, intrinsics=lens, size=(-(-height // side), -(-width // side)))
    points = [replace(r, points=r.points / side, pulls=r.pulls / side) for r in ridges]
    return edge_views(coarse, points), np.concatenate([outline_sides(r, coarse.size) for r in points])
