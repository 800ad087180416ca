"""Boxes of what is drawn, widths of strokes included."""

from collections.abc import Iterable, Sequence

import numpy as np

from diff3ds._shapes import Array, Float

# x and y of the upper left corner, then of the lower right one; pixels of a view.
Box = tuple[float, float, float, float]


def union(boxes: Iterable[Box | None]) -> Box | None:
    """The box of all; None of nothing."""
    some = np.array([box for box in boxes if box is not None])
    if not len(some):
        return None
    (x0, y0), (x1, y1) = some[:, :2].min(0).tolist(), some[:, 2:].max(0).tolist()
    return x0, y0, x1, y1


def box_of(points: Sequence[Float[Array, "_ 2"]], reach: Sequence[float]) -> Box | None:
    """The box of cubics that follow on each other, each given as a start, then three control points a cubic.

    Args:
        points: of each path.
        reach: of each half of the width that it is stroked with, round.
    """
    if not points:
        return None
    # All at once: a drawing has thousands of short ones.
    count = np.array([len(curve) for curve in points])
    every = np.concatenate(points)
    first = np.cumsum(count) - count
    cubics = (count - 1) // 3
    path = np.repeat(np.arange(len(count)), cubics)
    starts = first[path] + 3 * (np.arange(len(path)) - np.repeat(np.cumsum(cubics) - cubics, cubics))
    # A path without a cubic is a point.
    ends = np.concatenate([every[first], every[starts + 3]])
    wide = np.asarray(reach, float)
    out = np.concatenate([wide, wide[path]])[:, None]
    slow = _slow_places(every[starts[:, None] + np.arange(4)])
    out, around = np.concatenate([out, np.tile(wide[path], 2)[:, None]]), np.concatenate([ends, slow])
    (x0, y0), (x1, y1) = (around - out).min(0).tolist(), (around + out).max(0).tolist()
    return x0, y0, x1, y1


def box_of_outlines(outlines: Iterable[Float[Array, "_ 4 2"] | Float[Array, "_ 2"]]) -> Box | None:
    """The box of cubics and corners; None of nothing."""
    some = list(outlines)
    cubics = np.concatenate([np.zeros((0, 4, 2)), *(each for each in some if each.ndim == 3)])
    corners = [np.zeros((0, 2)), *(each for each in some if each.ndim == 2)]
    around = np.concatenate([*corners, cubics[:, 0], cubics[:, 3], _slow_places(cubics)])
    if not len(around):
        return None
    (x0, y0), (x1, y1) = around.min(0).tolist(), around.max(0).tolist()
    return x0, y0, x1, y1


def _slow_places(control: Float[Array, "N 4 2"]) -> Float[Array, "two_N 2"]:
    """Where a coordinate of a cubic has no slope, or its start: first one place of each cubic, then the other."""
    a, b, c, d = np.moveaxis(control, 1, 0)
    # The derivative is p t^2 + q t + r.
    p, q, r = -a + 3 * b - 3 * c + d, 2 * (a - 2 * b + c), b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(q * q - 4 * p * r)
        # Without the cancellation of the school's formula; where p is 0 one of both is the root of the line.
        half = -(q + np.copysign(root, q)) / 2
        at = np.stack([half / p, r / half])
    at = np.where((at > 0) & (at < 1), at, 0.0)
    value = (1 - at) ** 3 * a + 3 * at * (1 - at) ** 2 * b + 3 * at**2 * (1 - at) * c + at**3 * d
    return np.asarray(value.reshape(-1, 2))
