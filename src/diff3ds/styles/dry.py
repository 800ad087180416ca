"""Styles that leave grain on the paper: pencil and charcoal."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.page.ink_outlines import inside_bends, strip
from diff3ds.page.lines import Line
from diff3ds.page.noise import grain, seed_of, wander
from diff3ds.page.union import pathops, united
from diff3ds.styles.pens import tapered
from diff3ds.styles.style import InkMark, Mark, Page

# Samples a bump of the paper: four show its shape. [empirical]
SAMPLES = 1.7
# Over this part of the paper's height the ink of a strand goes from none to all of its width. [empirical]
SOFT = 0.3
# px. Strands are at least so wide; lines that are thinner, or shorter than a bump, have no grain.
THINNEST = 0.12


@dataclass(frozen=True)
class Dry:
    """A dry stick on rough paper, in strands side by side: each is inked where the paper is high.

    The paper's grain belongs to the page, so that strokes that cross leave the same hollows free.

    Attributes:
        width: of that of the stroke.
        strands: side by side.
        passes: how many times the line is drawn, each time a little beside itself.
        grain: distance of the paper's bumps, in pixels of a view 512 pixels high.
        middle: of the paper that is inked in the middle of the line.
        edge: of the paper that is inked at its edges.
        sway: how far the line leaves its curve, in its half widths.
        layers: lower ones reach deeper into the hollows: for each how much more of the paper it inks, and its opacity.
    """

    width: float
    strands: int
    passes: int
    grain: float
    middle: float
    edge: float
    sway: float
    layers: tuple[tuple[float, float], ...]

    @property
    def widest(self) -> float:
        """As `Style` says."""
        return self.width * (1 + self.sway)

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says."""
        size = self.grain * page.unit
        # Pressure and sway change over some 20 bumps, as a hand does. [empirical]
        scale = 20 * size
        line = line.refined(size / SAMPLES)
        half_width = self.width * line.half_width * tapered(line, 5 * size, 9 * size, 0.4)
        if line.length < size or half_width.max() < THINNEST:
            outline = strip(line, half_width)
            return [InkMark(outline, opacity) for _, opacity in self.layers]
        paths = [pathops().Path() for _ in self.layers]
        for k in range(self.passes):
            period = line.length / scale if line.closed else None
            hand, press = (wander(seed_of(seed, k, j), line.along / scale, period) for j in range(2))
            full = half_width * (1 + 0.25 * press)
            self._add_grains(paths, line, full, self.sway * hand, press, page)
        return [Mark(united(path), opacity) for path, (_, opacity) in zip(paths, self.layers, strict=True)]

    def _add_grains(
        self, paths: list[Any], line: Line, half_width: Array, hand: Array, press: Array, page: Page
    ) -> None:
        """Adds what one pass leaves on the high places of the paper."""
        size = self.grain * page.unit
        right, left = inside_bends(line, half_width, half_width)
        points, normals = line.points, line.normals

        def across(value: Float[Array, "s n"]) -> Float[Array, "s n 2"]:
            return points + (value.clip(0) * right + value.clip(max=0) * left)[..., None] * normals

        # Strands are a little wider than their share, so that full ones join.
        count = min(self.strands, math.ceil(float(half_width.max()) / THINNEST))
        place = ((2 * np.arange(count) + 1) / count - 1)[:, None]
        thick = 1.15 / count
        centre = place * (1 - thick / 2) + hand
        middle = across(centre)
        shown = ((middle > -size) & (middle < np.array(page.size[::-1]) + size)).all(-1)
        height = grain(page.seed, middle.reshape(-1, 2) / size).reshape(centre.shape)
        share = self.middle + (self.edge - self.middle) * np.abs(place) ** 1.5 + 0.15 * press
        for path, (more, _) in zip(paths, self.layers, strict=True):
            ink = thick * ((share + more - height) / SOFT).clip(0, 1) * shown
            for strand, one, other in zip(ink > 0, across(centre - ink), across(centre + ink), strict=True):
                for rows in _inked(strand):
                    _add_fleck(path, one[rows], other[rows])


def _inked(ink: Bool[NDArray[np.bool_], " n"]) -> list[slice]:
    """Ranges of samples with ink, with the sample before and the one after, where it has run out."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ink, [False]]).astype(int)))
    return [slice(max(a - 1, 0), b + 1) for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)]


def _add_fleck(path: Any, one: Float[Array, "n 2"], other: Float[Array, "n 2"]) -> None:
    """Adds a fleck between two sides; it has corners, as grains have."""
    path.moveTo(*one[0].tolist())
    for point in [*one[1:].tolist(), *other[::-1].tolist()]:
        path.lineTo(*point)
    path.close()


PENCIL = Dry(
    width=0.75, strands=3, passes=2, grain=1.8, middle=1.0, edge=0.6, sway=1.3, layers=((0.25, 0.35), (-0.25, 0.5))
)
CHARCOAL = Dry(
    width=3.2, strands=8, passes=1, grain=2.2, middle=0.85, edge=0.3, sway=0.1, layers=((0.35, 0.35), (-0.1, 0.7))
)
