"""Cameras that an adjustment has lost: looked for again, view by view, by the curves that the other views show.

An adjustment follows the nearest ridges, and of a camera that is off by farther than these lie apart they are the wrong
ones. But where the curves are known, trying tells: in the right place a view shows them, in all others only what
chance brings together.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Int
from diff3ds.camera import Cameras
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.cameras.adjust import SURE, equations, expected, narrowing, some_samples
from diff3ds.edges.cameras.lens_effect import LensEffect
from diff3ds.edges.cameras.posed import NUMBERS, Posed
from diff3ds.edges.evidence.bias import Bias, all_outline_sides, corrected
from diff3ds.edges.evidence.edge_views import EdgeViews, edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.support import inliers

# [px; empirical] Turns that are tried move the picture by up to so much to each side, in steps that leave no place
# farther than `NEAR` from one of them. Of 150 photographs of three parts, with cameras that were off by 5 pixels in the
# mean, the adjustment lost ten, by 4 to 14 pixels; eight were found again.
REACH, STEP = 15.0, 3.0
# [tries; speed] So many of the best are followed to the end.
FOLLOWED = 4
# [ratio; empirical] So many times as many samples have to lie on ridges for a camera to be moved there.
BETTER = 1.1
# [px; derived] Pictures that are moved by so much to all sides show what chance brings together: farther than what an
# adjustment leaves, nearer than where other things are shown.
WRONG = (6.0, 9.0, 12.0)
# [ratio, ratio; empirical] A view is lost where it shows less of the curves, beyond what chance would, than so large a
# part of what the median view does, unless that shows hardly more than chance either. Of the photographs above right
# cameras have .44 and more.
LOST, LEAST_AGREEMENT = 1 / 3, 1.5
# [times; empirical] A view that shows more than chance so many times may be right all the same: of small pictures with
# few edges right cameras have 2.4 times where the median is 8, one turned by 25 degrees 0, and one by 1.5 degrees 1.4.
SURELY = 2.0
# [tries; empirical] Directions to which pictures are moved for that.
AROUND = 24


def found_again(start: Posed, posed: Posed, views: EdgeViews, effect: LensEffect, curves: Curves) -> Posed:
    """The cameras, of which those that show far more of the curves from elsewhere are there.

    Args:
        start: the cameras that were given, near which they are looked for.
        posed: the cameras so far.
        views: as for `adjusted`.
        effect: the same.
        curves: by the cameras so far.
    """
    x, tangents = some_samples(curves)
    now = _shown(posed, views, effect, x, tangents)
    steps = np.arange(-REACH, REACH + STEP / 2, STEP)
    shifts = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    rotation, shift = posed.rotation.copy(), posed.shift.copy()
    for view in range(len(views)):
        given = replace(start.chosen([view]), lens=posed.lens)
        tried, seen = _turned(given, shifts), _copies(views, view, len(shifts))
        near = inliers(tried.views(seen, effect), x, tangents).sum(1)
        best = np.argsort(-near, kind="stable")[:FOLLOWED]
        seen = _copies(views, view, len(best))
        there = _followed(tried.chosen(best), seen, effect, x, tangents)
        shown = _shown(there, seen, effect, x, tangents)
        most = int(shown.argmax())
        if shown[most] > BETTER * now[view]:
            rotation[view], shift[view] = there.rotation[most], there.shift[most]
    return replace(posed, rotation=rotation, shift=shift)


def agreement(posed: Posed, views: EdgeViews, effect: LensEffect, curves: Curves) -> Float[Array, " V"]:
    """How many times as much of the curves each view shows as chance would show in it: about 1 for a lost one.

    Args:
        posed: the cameras.
        views: as for `adjusted`.
        effect: the same.
        curves: by these cameras.
    """
    x, tangents = some_samples(curves)
    angle = np.arange(AROUND) * (2 * np.pi / AROUND)
    away = np.resize(WRONG, AROUND)
    shifts = np.stack([away * np.cos(angle), away * np.sin(angle)], 1)
    now = _shown(posed, views, effect, x, tangents)
    found = np.zeros(len(views))
    for view in range(len(views)):
        wrong = _turned(posed.chosen([view]), shifts)
        chance = _shown(wrong, _copies(views, view, AROUND), effect, x, tangents).mean()
        found[view] = now[view] / max(1.0, float(chance))
    return found


def agreement_of(cameras: Cameras, ridges: Sequence[Ridges], curves: Curves, bias: Bias) -> Float[Array, " V"]:
    """As `agreement`, of cameras that nothing was changed of; nan of views without ridges, which say nothing.

    Args:
        cameras: with perspective.
        ridges: of every view.
        curves: by these cameras, not none.
        bias: of the ridges.
    """
    sides = all_outline_sides(ridges, cameras.size)
    views = edge_views(cameras, corrected(ridges, sides, bias))
    found = agreement(Posed.of(cameras), views, LensEffect.fixed(np.concatenate(sides)), curves)
    return np.where([len(ridge) > 0 for ridge in ridges], found, np.nan)


def are_lost(agreement: Float[Array, " V"]) -> Bool[NDArray[np.bool_], " V"]:
    """Which views agree with the others no more, by `agreement`."""
    known = agreement[~np.isnan(agreement)]
    middle = float(np.median(known)) if len(known) else 0.0
    return np.asarray((agreement - 1 < LOST * (middle - 1)) & (middle >= LEAST_AGREEMENT))


def are_surely_lost(agreement: Float[Array, " V"]) -> Bool[NDArray[np.bool_], " V"]:
    """Which of these do so hardly more than by chance."""
    return are_lost(agreement) & (agreement < SURELY)


def _shown(
    posed: Posed, views: EdgeViews, effect: LensEffect, x: Float[Array, "M 3"], tangents: Float[Array, "M 3"]
) -> Int[Array, " V"]:
    """How many samples of curves lie on ridges of each view."""
    return np.asarray(inliers(posed.views(views, effect), x, tangents, SURE).sum(1))


def _copies(views: EdgeViews, view: int, count: int) -> EdgeViews:
    """One view so many times, for as many cameras."""
    rows = [view] * count
    return replace(views, projection=views.projection[rows], centers=views.centers[rows], nearest=views.nearest[rows])


def _turned(posed: Posed, shifts: Float[Array, "K 2"]) -> Posed:
    """A camera turned so that its picture moves by these, pixels."""
    turns = np.stack([-shifts[:, 1] / posed.focals[0, 1], shifts[:, 0] / posed.focals[0, 0]], 1)
    steps = np.pad(turns, ((0, 0), (0, 4)))
    return posed.chosen([0] * len(shifts)).stepped(steps, np.zeros(NUMBERS))


def _followed(
    start: Posed, views: EdgeViews, effect: LensEffect, x: Float[Array, "M 3"], tangents: Float[Array, "M 3"]
) -> Posed:
    """Cameras of one view that each meet the curves, which stay, as well as from where they are."""
    posed = start
    for far, scatter in narrowing():
        seen = posed.views(views, effect)
        rows = equations(posed, seen, effect, x, inliers(seen, x, tangents, far), scatter)
        left = np.einsum("vm,vmi,vmj->vij", rows.weight, rows.pose, rows.pose)
        right = np.einsum("vm,vmi->vi", rows.weight * rows.residual, rows.pose)
        tight, back = (numbers[:-NUMBERS].reshape(-1, 6) for numbers in expected(start, posed))
        left += tight[:, :, None] * np.eye(6)
        posed = posed.stepped(np.linalg.solve(left, (right + tight * back)[..., None])[..., 0], np.zeros(NUMBERS))
    return posed
