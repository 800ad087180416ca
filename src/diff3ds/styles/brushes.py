"""Styles with a user's brush: its shape stretched along each line, or scattered on it."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.page.ink_outlines import Side, inside_bends
from diff3ds.page.lines import Line
from diff3ds.page.noise import seed_of, uniform
from diff3ds.page.union import pathops, united
from diff3ds.styles.brush_file import contours_of, load_brush
from diff3ds.styles.style import InkMark, Mark, Page

# Points of a cubic of a brush that is bent along a line: at most so many, and no more than one in so many pixels.
MOST_POINTS, SPACING = 200, 3.0


@dataclass(frozen=True)
class Stretched:
    """A brush that is stretched along the line: its left end lies on the beginning, its right end on the end.

    Attributes:
        shape: of `load_brush`.
        width: how high the brush becomes, in widths of the stroke.
    """

    shape: Any
    width: float = 4.0

    @property
    def widest(self) -> float:
        """As `Style` says."""
        return self.width

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says."""
        if len(line.points) < 2:
            return Scattered(self.shape, self.width).marks(line, page, seed)
        x0, y0, x1, y1 = self.shape.bounds
        line = line.refined(SPACING / 2)
        half_width = self.width * line.half_width
        right, left = inside_bends(line, half_width, half_width)
        places = [(cubics - [x0, (y0 + y1) / 2]) / [x1 - x0, (y1 - y0) / 2] for cubics in contours_of(self.shape)]
        return [InkMark([[Side(_bent(place, line, right, left), True)] for place in places])]


def _bent(place: Float[Array, "m 4 2"], line: Line, right: Array, left: Array) -> Float[Array, "n 2"]:
    """Points of a contour whose cubics are given as (part of the length, part of the half width)."""
    rows = []
    for cubic in place:
        extent = np.ptp(cubic, axis=0) * [line.length, float(max(right.max(), left.max()))]
        count = int(min(math.ceil(extent.max() / SPACING) + 3, MOST_POINTS))
        t = np.arange(count) / count
        v = 1 - t
        rows.append(np.stack([v**3, 3 * t * v**2, 3 * t**2 * v, t**3], -1) @ cubic)
    along, across = np.concatenate(rows).T
    along = along * line.length

    def at(values: Array) -> Array:
        return np.interp(along, line.along, values)

    angle = at(line.angle)
    normals = np.stack([-np.sin(angle), np.cos(angle)], -1)
    middle = np.stack([at(line.points[:, 0]), at(line.points[:, 1])], -1)
    return middle + (across.clip(0) * at(right) + across.clip(max=0) * at(left))[:, None] * normals


@dataclass(frozen=True)
class Scattered:
    """Copies of a brush along the line, turned with it, more or less.

    Attributes:
        shape: of `load_brush`.
        width: how high the copies are, in widths of the stroke.
        spacing: from one copy to the next, in their lengths.
        jitter: how much copies differ in size, turn and place: 0 for not at all, 1 for wildly.
    """

    shape: Any
    width: float = 4.0
    spacing: float = 1.1
    jitter: float = 0.3

    @property
    def widest(self) -> float:
        """As `Style` says."""
        x0, y0, x1, y1 = self.shape.bounds
        return self.width * (1 + self.jitter) * (1 + (x1 - x0) / (y1 - y0))

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says."""
        x0, y0, x1, y1 = self.shape.bounds
        long, high = (x1 - x0) / (y1 - y0), 2 * self.width
        if len(line.points) > 1:
            line = line.refined(SPACING)
        # Copies follow each other in steps of their own lengths, which change with the width of the line.
        steps = (self.spacing * high * long * line.half_width).clip(SPACING / 4)
        counted = np.concatenate([[0.0], (np.diff(line.along) * 2 / (steps[1:] + steps[:-1])).cumsum()])
        count = max(1, round(counted[-1]))
        size, turn, shift, aside = (self.jitter * (2 * uniform(seed_of(seed, k), count) - 1) for k in range(4))
        places = np.interp((np.arange(count) + 0.5 + 0.3 * shift) * counted[-1] / count, counted, line.along)

        def at(values: Array) -> Array:
            return np.interp(places, line.along, values)

        scales = high * at(line.half_width) * (1 + size) / (y1 - y0)
        angles, away = at(line.angle), 0.3 * high * at(line.half_width) * aside
        x, y = (at(line.points[:, 0]) - away * np.sin(angles), at(line.points[:, 1]) + away * np.cos(angles))
        path = pathops().Path()
        for scale, angle, px, py in np.stack([scales, angles + 1.2 * turn, x, y], -1).tolist():
            c, s = scale * math.cos(angle), scale * math.sin(angle)
            mx, my = (x0 + x1) / 2, (y0 + y1) / 2
            path.addPath(self.shape.transform(c, s, -s, c, px - c * mx + s * my, py - s * mx - c * my))
        return [Mark(united(path))]


def stretched(file: str | Path) -> Stretched:
    """The brush of an SVG file, stretched along lines. Errors as `load_brush`."""
    return Stretched(load_brush(file))


def scattered(file: str | Path) -> Scattered:
    """The brush of an SVG file, scattered on lines. Errors as `load_brush`."""
    return Scattered(load_brush(file))
