"""Smooth random numbers by place: the same seed and place give the same number, on every machine."""

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Index, Int

_Words = NDArray[np.uint64]


def seed_of(*numbers: int) -> int:
    """One seed of several whole numbers, such as that of a page and the number of a stroke."""
    word = np.zeros(1, np.uint64)
    for number in numbers:
        word = _mixed(word ^ np.array([number & 0xFFFFFFFFFFFFFFFF], np.uint64))
    return int(word[0])


def uniform(seed: int, count: int) -> Float[Array, " count"]:
    """Random numbers in [0, 1)."""
    return _unit(_mixed(np.uint64(seed) ^ _mixed(np.arange(count, dtype=np.uint64))))


def uniform_at(seed: int, *places: Int[Index, " n"]) -> Float[Array, " n"]:
    """Random numbers in [0, 1), each of whole numbers that say its place."""
    words = np.full(len(places[0]), seed, np.uint64)
    for place in places:
        words = _mixed(words ^ place.astype(np.uint64))
    return _unit(words)


def wander(seed: int, x: Float[Array, " n"], period: float | None = None) -> Float[Array, " n"]:
    """A smooth random function in [-1, 1] that changes over a distance of about 1.

    Args:
        period: after which it repeats; it is rounded to a whole number of cells, which change in size as much.
    """
    if period is not None:
        cells = max(1, round(period))
        x = x * (cells / period) if period > 0 else x
    cell = np.floor(x)
    u = x - cell
    first = cell.astype(np.int64)
    second = first + 1
    if period is not None:
        first, second = first % cells, second % cells
    a, b = _unit(_mixed(np.uint64(seed) ^ _mixed(np.stack([first, second]).astype(np.uint64))))
    return 2 * (a + (b - a) * u**3 * (u * (6 * u - 15) + 10)) - 1


def grain(seed: int, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
    """The height of rough paper at points, in [0, 1], with bumps at a distance of about 1."""
    cell = np.floor(points)
    u = points - cell
    u = u * u * (3 - 2 * u)
    corners = cell.astype(np.int64) + np.array([[[i, j]] for j in (0, 1) for i in (0, 1)])
    corner = uniform_at(seed, *corners.reshape(-1, 2).T).reshape(4, -1)
    top = corner[0] + (corner[1] - corner[0]) * u[:, 0]
    bottom = corner[2] + (corner[3] - corner[2]) * u[:, 0]
    # Means of four numbers keep to the middle: spread out again.
    return (0.5 + 1.5 * (top + (bottom - top) * u[:, 1] - 0.5)).clip(0, 1)


def _mixed(words: _Words) -> _Words:
    """The finaliser of SplitMix64 (Steele et al., 2014): all bits of the result depend on all of the word."""
    words = words + np.uint64(0x9E3779B97F4A7C15)
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))


def _unit(words: _Words) -> Array:
    return (words >> np.uint64(11)).astype(np.float64) * 2.0**-53
