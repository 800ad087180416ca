"""Directions in any dimension: unit vectors, by how much a curve turns (the one measure of what is smooth), corners."""

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Mask

# Added to a length before something is divided by it: a vector without a length gets none.
TINY = 1e-12
# Edges of a mesh that turn by more than this have a corner: rounds of ten sides and more are smooth. Radians.
SHARP = np.deg2rad(38.0)
# Where edges so much longer than the next ones turn at all, radians, a straight line goes over into a round.
UNEVEN, STRAIGHT = 3.0, np.deg2rad(1.0)


def dot(one: Float[Array, "*a d"], other: Float[Array, "*b d"]) -> Float[Array, "*c"]:
    """Products of few components, added one after the other: numpy is slow along short axes."""
    total = one[..., 0] * other[..., 0]
    for k in range(1, one.shape[-1]):
        total = total + one[..., k] * other[..., k]
    return np.asarray(total)


def cross(one: Float[Array, "*a 3"], other: Float[Array, "*b 3"]) -> Float[Array, "*c 3"]:
    """The cross products of `np.cross`, to the last bit, which is slow for few vectors."""
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    out = np.empty(np.broadcast_shapes(one.shape, other.shape))
    out[..., 0], out[..., 1], out[..., 2] = b * z - c * y, c * x - a * z, a * y - b * x
    return out


def unit(vectors: Float[Array, "*n d"]) -> Float[Array, "*n d"]:
    """The vectors at length 1."""
    return np.asarray(vectors / (np.sqrt(dot(vectors, vectors)) + TINY)[..., None])


def turns(before: Float[Array, "*a d"], after: Float[Array, "*b d"]) -> Float[Array, "*c"]:
    """Angles between directions, radians from 0 to π, exact for small ones too (Kahan); a right one for no direction.

    A curve is smooth where it turns by less than an angle that its caller says.
    """
    one = before * np.linalg.norm(after, axis=-1, keepdims=True)
    other = after * np.linalg.norm(before, axis=-1, keepdims=True)
    apart, together = np.linalg.norm(one - other, axis=-1), np.linalg.norm(one + other, axis=-1)
    return np.where(apart + together > 0, 2 * np.arctan2(apart, together), np.pi / 2)


def has_corner(before: Float[Array, "N 3"], after: Float[Array, "N 3"]) -> Bool[Mask, " N"]:
    """Whether a line has a corner between two of its steps, or its straight part ends there and a round begins."""
    short, long = np.sort(np.linalg.norm(np.stack([before, after]), axis=2), axis=0)
    turn = turns(before, after)
    corner: Mask = (turn > SHARP) | ((long > UNEVEN * short) & (turn > STRAIGHT))
    return corner


def all_around(count: int) -> Float[Array, "N 3"]:
    """Directions that are spread evenly over the sphere, on a spiral of the golden angle: unit vectors."""
    k = np.arange(count) + 0.5
    height, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    around = np.sqrt(1 - height**2)
    return np.stack([around * np.cos(turn), around * np.sin(turn), height], 1)
