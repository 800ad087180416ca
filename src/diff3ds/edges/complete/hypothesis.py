"""The test of a proposed curve: how many views show it at its sample points, and which known curves are pieces of it.

Circles, missing lines, rounded corners and bottoms of pockets are all found like this: a curve is proposed, the views
that show it are counted at sample points, it is accepted if enough views show nearly all of them, and the curves that
lie along it go.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.straight_lines import tangents_of
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import NEAR, inliers

# [ratio, fraction; measured] So many views, relative to those that confirm an edge, have to show a sample point of what
# ends in known curves, and this fraction of the sample points has to be so shown. Of 12 whole circles in parts all had
# .87 or more, of 25 arcs of generated objects that end where they should all .82 or less.
SHOWN, COVERED = 0.7, 0.85
# [ratio; empirical] So many of the usual views have to confirm what is looked for again: what is known already can no
# longer come together by chance.
AGAIN = 0.55
# [points; empirical] Sample points of what is proposed.
SAMPLES = 24
# [px; empirical] So near lies a ridge that shows one of them.
SEEN = 1.2
# [px; empirical] Where what is known leaves few numbers of a curve open, faint edges say whether it is there: of all
# that pictures show, those so near.
NARROW = 1.2
# [natural logarithms, fraction; measured] So much they say in the mean along the curve, and for an edge on so much of
# it. On three generated parts circles that are there had 8.7 and .93 and more but for one of .90, others at most .85.
TOLD, EVERYWHERE = 7.0, 0.88
# [px, fraction; empirical] A known curve is a piece of a proposed one if this fraction of its samples lies so near to
# it.
PIECE_WITHIN, PIECE_FRACTION = 1.5, 0.8
# Spacing of the points along a proposed curve that known ones are compared with.
PATH_SPACING = PIECE_WITHIN / 3


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A proposed curve, or several with as many sample points each.

    Attributes:
        x: the sample points, in order along the curve.
        tangents: unit tangents there.
    """

    x: Float[Array, "*c S 3"]
    tangents: Float[Array, "*c S 3"]

    @staticmethod
    def through(x: Float[Array, "*c S 3"]) -> "Hypothesis":
        """The curve through sample points that lie close together."""
        return Hypothesis(x, tangents_of(x))

    def shown(self, views: EdgeViews, within: float = NEAR) -> Bool[NDArray[np.bool_], "V *c S"]:
        """Which views show which sample points: those with a ridge that runs along the curve so near, pixels."""
        found = inliers(views, self.x.reshape(-1, 3), self.tangents.reshape(-1, 3), within)
        return found.reshape(len(views), *self.x.shape[:-1])


def fraction_shown(
    shown: Bool[NDArray[np.bool_], "V *c S"], min_views: float | Float[Array, "*c S"]
) -> Float[Array, "*c"]:
    """The fraction of each curve's sample points that at least so many views show."""
    return np.asarray((shown.sum(0) >= min_views).mean(-1))


def is_told(told: Float[Array, " S"]) -> bool:
    """Whether faint edges say enough along a curve of which few numbers are open; evidence, see `Chance`."""
    return bool(told.mean() > TOLD and (told > 0).mean() >= EVERYWHERE)


def pieces_of(
    path: Float[Array, "M 3"],
    samples: Float[Array, "N S 3"],
    pixel: float,
    within: float = PIECE_WITHIN,
    fraction: float = PIECE_FRACTION,
) -> Bool[NDArray[np.bool_], " N"]:
    """Which known curves lie along a proposed one.

    Args:
        path: points along the proposed curve, `PATH_SPACING` apart or less.
        samples: points along each known curve.
        pixel: world units of a pixel.
        within: so near lies a sample that lies on the proposed curve, pixels.
        fraction: of a known curve's samples that have to lie there.
    """
    from scipy.spatial import cKDTree

    return np.asarray((cKDTree(path).query(samples)[0] < within * pixel).mean(-1) >= fraction)
