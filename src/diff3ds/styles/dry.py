"""Styles that leave grain on the paper: pencil and charcoal."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.page.ink_outlines import inside_bends, strip
from diff3ds.page.lines import Line
from diff3ds.page.noise import grain, seed_of, wander
from diff3ds.styles.pens import tapered
from diff3ds.styles.style import Flecks, InkMark, Mark, Page

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
        period = line.length / scale if line.closed else None
        hand, press = (
            np.stack([wander(seed_of(seed, k, j), line.along / scale, period) for k in range(self.passes)])
            for j in range(2)
        )
        grains = self._grains(line, half_width * (1 + 0.25 * press), self.sway * hand, press, page)
        return [Flecks(flecks, opacity) for flecks, (_, opacity) in zip(grains, self.layers, strict=True)]

    def _grains(
        self,
        line: Line,
        half_width: Float[Array, "p n"],
        hand: Float[Array, "p n"],
        press: Float[Array, "p n"],
        page: Page,
    ) -> Iterator[list[Float[Array, "_ 2"]]]:
        """What all passes leave on the high places of the paper, of each layer."""
        size = self.grain * page.unit
        right, left = (
            np.stack(side)[:, None] for side in zip(*(inside_bends(line, w, w) for w in half_width), strict=True)
        )
        points, normals = line.points, line.normals

        def across(value: Float[Array, "p s n"]) -> Float[Array, "p s n 2"]:
            return points + (value.clip(0) * right + value.clip(max=0) * left)[..., None] * normals

        # Strands are a little wider than their share, so that full ones join.
        count = min(self.strands, math.ceil(float(half_width.max()) / THINNEST))
        place = ((2 * np.arange(count) + 1) / count - 1)[:, None]
        thick = 1.15 / count
        centre = place * (1 - thick / 2) + hand[:, None]
        middle = across(centre)
        shown = ((middle > -size) & (middle < np.array(page.size[::-1]) + size)).all(-1)
        height = grain(page.seed, middle.reshape(-1, 2) / size).reshape(centre.shape)
        share = self.middle + (self.edge - self.middle) * np.abs(place) ** 1.5 + 0.15 * press[:, None]
        for more, _ in self.layers:
            ink = thick * ((share + more - height) / SOFT).clip(0, 1) * shown
            one, other = (across(side).reshape(-1, len(points), 2) for side in (centre - ink, centre + ink))
            # Between two sides, with corners, as grains have them.
            yield [
                np.concatenate([one[strand, first:last], other[strand, first:last][::-1]])
                for strand, first, last in _inked(ink.reshape(-1, len(points)) > 0)
            ]


def _inked(ink: Bool[NDArray[np.bool_], "s n"]) -> Iterator[tuple[int, int, int]]:
    """Runs of samples with ink: the strand, and where they start and stop with a sample on both sides without."""
    flags = np.pad(ink, ((0, 0), (1, 1))).ravel()
    strands, samples = (some.tolist() for some in np.divmod(np.flatnonzero(flags[1:] != flags[:-1]), ink.shape[1] + 2))
    for strand, first, last in zip(strands[::2], samples[::2], samples[1::2], strict=True):
        yield strand, max(first - 1, 0), last + 1


PENCIL = Dry(
    width=0.75, strands=3, passes=2, grain=1.8, middle=1.0, edge=0.6, sway=1.3, layers=((0.25, 0.35), (-0.25, 0.5))
)
CHARCOAL = Dry(
    width=3.2, strands=8, passes=1, grain=2.2, middle=0.85, edge=0.3, sway=0.1, layers=((0.35, 0.35), (-0.1, 0.7))
)
