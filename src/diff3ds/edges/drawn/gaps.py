"""Gaps between curves: whether the pictures contradict a line across one."""

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import unit
from diff3ds.edges.evidence.chance import Chance

# [px; empirical] Over gaps this short pictures are not asked: ridges end a little before lines do, or after them.
UNASKED = 6.0
# [px; numerical] Spacing of the points that are asked about.
SPACING = 1.5
# [probability; empirical] So often a view sees the gap between what others show.
SEEN = 0.5
# [views; empirical] So many views say enough.
FEWEST = 3
# [natural logarithms a view; empirical] Pictures contradict a line that is so much less likely than chance.
CONTRADICTED = -0.12


def contradicted(chance: Chance, start: Float[Array, " 3"], stop: Float[Array, " 3"]) -> bool:
    """Whether the pictures say that no line runs from here to there.

    A line that is hidden in some views is not contradicted by these alone: that is in the odds of evidence.
    """
    way = stop - start
    share = np.linspace(0, 1, int(np.linalg.norm(way) / (SPACING * chance.views.pixel)) + 2)[:, None]
    points = start + share * way
    pixel = chance.views.project(points)[0]
    off = [np.linalg.norm(pixel - pixel[:, [end]], axis=-1) for end in (0, -1)]
    # In views along the gap its ends hide that it is there.
    asked = np.minimum(*off) > UNASKED / 2
    count = int(asked.sum())
    if count < FEWEST * len(points):
        return False
    told = chance.evidence(points, np.broadcast_to(unit(way), points.shape), asked, SEEN)
    return float(told.sum()) < CONTRADICTED * count
