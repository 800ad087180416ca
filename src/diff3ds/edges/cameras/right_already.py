"""Whether cameras are right as they were given: whether moving them gains anything on curves that had no part in it.

An adjustment always finds cameras with which its curves agree better. If it has followed the noise of their ridges, the
gain is theirs alone; if the cameras were wrong, other curves gain as much.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.cameras.adjust import SCATTER, Normal, equations, normal_equations, settled
from diff3ds.edges.cameras.lens_effect import LensEffect
from diff3ds.edges.cameras.posed import Posed
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import crowded, inliers

# [ratio; empirical] Cameras are right if moving them takes away less than this of the squared residuals of curves that
# had no part in it. Of right cameras it took away .005 of drawings, .04 to .12 of photographs of 400 pixels, .25 and
# .50 of 200; of drawings whose cameras are off by a twelfth of a pixel .91, of photographs by .4 pixels .91.
RIGHT = 0.6
# [index; derived] Of the outward offset of outlines among the numbers of cameras: it is no camera's.
OUTWARD = -2


def gain_unseen(
    start: Posed, views: EdgeViews, effect: LensEffect, curves: Curves, counting: Bool[NDArray[np.bool_], " V"]
) -> float:
    """How much of the squared residuals of one half of the curves goes if cameras are moved for the other half.

    Args:
        start: the cameras that were given.
        views: ridges, as for `adjusted`.
        effect: of the lens.
        curves: by these cameras, two or more.
        counting: the views that are asked.

    Returns:
        About 0 of right cameras, nearly 1 of wrong ones; negative where the move does harm.
    """
    posed, x, tangent, _ = settled(start, start, views, effect, curves)
    seen = posed.views(views, effect)
    shown = inliers(seen, x, tangent) & ~crowded(seen, x, tangent, at=inliers(seen, x, tangent))
    rows = equations(posed, seen, effect, x, shown, SCATTER)
    # Samples are in the order of their curves.
    half = np.arange(len(x)) * len(curves) // len(x) % 2
    weight = rows.weight * counting[:, None]
    halves = [
        normal_equations(start, posed, replace(rows, weight=weight * (half == i)), seen.pixel, tangent)
        for i in range(2)
    ]
    given = sum(one.squares(_as_given(one)) for one in halves)
    moved = sum(one.squares(other.solved()[0]) for one, other in zip(halves, halves[::-1], strict=True))
    return 1 - moved / given if given > 0 else 1.0


def _as_given(normal: Normal) -> Float[Array, " K"]:
    """The step back to the cameras as they were given, with the best offset of outlines."""
    step = normal.back.copy()
    slope = normal.right[OUTWARD] - normal.left[OUTWARD] @ step
    step[OUTWARD] += slope / max(normal.left[OUTWARD, OUTWARD], 1e-300)
    return step
