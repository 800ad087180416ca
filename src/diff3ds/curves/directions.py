"""Directions in any dimension: unit vectors, and by how much a curve turns: the one measure of what is smooth."""

import numpy as np

from diff3ds._shapes import Array, Float

# Added to a length before something is divided by it: a vector without a length gets none.
TINY = 1e-12


def unit(vectors: Float[Array, "*n d"]) -> Float[Array, "*n d"]:
    """The vectors at length 1."""
    return np.asarray(vectors / (np.linalg.norm(vectors, axis=-1, keepdims=True) + TINY))


def turns(before: Float[Array, "*a d"], after: Float[Array, "*b d"]) -> Float[Array, "*c"]:
    """Angles between directions, radians from 0 to π, exact for small ones too (Kahan); a right one for no direction.

    A curve is smooth where it turns by less than an angle that its caller says.
    """
    one = before * np.linalg.norm(after, axis=-1, keepdims=True)
    other = after * np.linalg.norm(before, axis=-1, keepdims=True)
    apart, together = np.linalg.norm(one - other, axis=-1), np.linalg.norm(one + other, axis=-1)
    return np.where(apart + together > 0, 2 * np.arctan2(apart, together), np.pi / 2)
