"""Where runs of points along edges of a mesh have corners: no fair curve goes over these."""

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Mask

# Edges that turn by more than this have a corner: rounds of ten sides and more are smooth. Degrees.
SHARP = 38.0
# Where edges so much longer than the next ones turn at all, degrees, a straight line goes over into a round.
UNEVEN, STRAIGHT = 3.0, 1.0


def has_corner(before: Float[Array, "N 3"], after: Float[Array, "N 3"]) -> Bool[Mask, " N"]:
    """Whether a line has a corner between two of its steps, or its straight part ends there and a round begins."""
    short, long = np.sort(np.linalg.norm(np.stack([before, after]), axis=2), axis=0)
    turn = turns(before, after)
    corner: Mask = (turn > SHARP) | ((long > UNEVEN * short) & (turn > STRAIGHT))
    return corner


def turns(before: Float[Array, "N 3"], after: Float[Array, "N 3"]) -> Float[Array, " N"]:
    """By how much a line turns between two of its steps, degrees."""
    sine = np.linalg.norm(np.cross(before, after), axis=1)
    return np.asarray(np.rad2deg(np.arctan2(sine, np.einsum("si,si->s", before, after))))
