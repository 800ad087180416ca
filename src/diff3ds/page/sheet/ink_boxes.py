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


def box_of(points: Sequence[Float[Array, "_ 2"]], reach: float = 0.0) -> Box | None:
    """The box of cubics that follow on each other, each given as a start, then three control points a cubic.

    Args:
        points: of each path.
        reach: half of the width that they are stroked with, round.
    """
    found = [_cubic_box(curve) for curve in points if len(curve)]
    whole = union(found)
    return whole and (whole[0] - reach, whole[1] - reach, whole[2] + reach, whole[3] + reach)


def _cubic_box(curve: Float[Array, "n 2"]) -> Box:
    """Of the ends, and of the places where a coordinate of a cubic has no slope."""
    ends = curve[::3]
    starts = 3 * np.arange(len(ends) - 1)[:, None] + np.arange(4)
    a, b, c, d = np.moveaxis(curve[starts], 1, 0)
    # The derivative is p t^2 + q t + r.
    p, q, r = -a + 3 * b - 3 * c + d, 2 * (a - 2 * b + c), b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(q * q - 4 * p * r)
        # Without the cancellation of the school's formula; where p is 0 one of both is the root of the line.
        half = -(q + np.copysign(root, q)) / 2
        at = np.stack([half / p, r / half])
    at = np.where((at > 0) & (at < 1), at, 0.0)
    value = (1 - at) ** 3 * a + 3 * at * (1 - at) ** 2 * b + 3 * at**2 * (1 - at) * c + at**3 * d
    every = np.concatenate([ends, value.reshape(-1, 2)])
    (x0, y0), (x1, y1) = every.min(0).tolist(), every.max(0).tolist()
    return x0, y0, x1, y1
