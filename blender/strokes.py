# SPDX-License-Identifier: GPL-3.0-or-later
"""Strokes as plain numbers: chains of rational cubics with radii, and what files may hold of them."""

import math
from typing import NamedTuple

# Files that are larger are not read, nor more strokes.
MOST_BYTES = 1 << 28
MOST_STROKES = 1_000_000
# The binomial coefficients of a cubic.
CHOOSE = (1, 3, 3, 1)


class Stroke(NamedTuple):
    """A chain of rational cubics.

    Attributes:
        name: of the stroke, or empty.
        kind: such as crease, contour or hatching, or empty.
        segments: of each cubic its four control points (x, y, z, weight).
        widths: of each cubic its full widths, four Bernstein coefficients.
        color: sRGB, from 0 to 1.
        opacity: from 0 to 1.
        closed: whether it ends where it begins.
    """

    name: str
    kind: str
    segments: list
    widths: list
    color: tuple
    opacity: float
    closed: bool

    @property
    def bent(self) -> bool:
        """Whether a weight differs from the others of its cubic."""
        return any(abs(point[3] / cubic[0][3] - 1) > 1e-6 for cubic in self.segments for point in cubic)


class Strokes(NamedTuple):
    """The strokes of a file, whether their widths are shares of a picture's height, and what was left out."""

    strokes: list
    of_picture: bool
    left_out: str = ""


def middle_and_radius(strokes: list) -> tuple:
    """Of a ball that holds all control points; radius 1 where there is none."""
    points = [point[:3] for stroke in strokes for cubic in stroke.segments for point in cubic]
    if not points:
        return (0.0, 0.0, 0.0), 1.0
    middle = tuple((min(axis) + max(axis)) / 2 for axis in zip(*points, strict=True))
    return middle, max(math.dist(point, middle) for point in points) or 1.0


def raised(control: list) -> list:
    """Control points (x, y, z, weight) of a rational curve of degree 1, 2 or 3 as those of a cubic."""
    rows = [[*(value * point[3] for value in point[:3]), point[3]] for point in control]
    while len(rows) < 4:
        count = len(rows)
        middle = [
            [(i * a + (count - i) * b) / count for a, b in zip(rows[i - 1], rows[i], strict=True)]
            for i in range(1, count)
        ]
        rows = [rows[0], *middle, rows[-1]]
    return [(*(value / row[3] for value in row[:3]), row[3]) for row in rows]


def weighed(widths: list, cubic: list) -> list:
    """Values at control points that, weighed as those are, go through a polynomial's at 0, 1/3, 2/3 and 1."""
    weights = [point[3] for point in cubic]

    def at(values: list, t: float) -> float:
        return sum(n * (1 - t) ** (3 - i) * t**i * v for i, (n, v) in enumerate(zip(CHOOSE, values, strict=True)))

    a, b, c, d = (at(widths, t) * at(weights, t) for t in (0.0, 1 / 3, 2 / 3, 1.0))
    through = (a, (-5 * a + 18 * b - 9 * c + 2 * d) / 6, (2 * a - 9 * b + 18 * c - 5 * d) / 6, d)
    return [max(value / weight, 0.0) for value, weight in zip(through, weights, strict=True)]
