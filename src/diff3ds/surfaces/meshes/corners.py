"""Where runs of points along edges of a mesh have corners: no fair curve goes over these."""

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Mask
from diff3ds.curves.directions import turns

# Edges that turn by more than this have a corner: rounds of ten sides and more are smooth. Radians.
SHARP = np.deg2rad(38.0)
# Where edges so much longer than the next ones turn at all, radians, a straight line goes over into a round.
UNEVEN, STRAIGHT = 3.0, np.deg2rad(1.0)


def has_corner(before: Float[Array, "N 3"], after: Float[Array, "N 3"]) -> Bool[Mask, " N"]:
    """Whether a line has a corner between two of its steps, or its straight part ends there and a round begins."""
    short, long = np.sort(np.linalg.norm(np.stack([before, after]), axis=2), axis=0)
    turn = turns(before, after)
    corner: Mask = (turn > SHARP) | ((long > UNEVEN * short) & (turn > STRAIGHT))
    return corner
