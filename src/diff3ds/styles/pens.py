"""Styles of pens with sharp edges: ink with pressure, a calligraphic nib, technical pens, and dashes."""

import math
from dataclasses import dataclass, replace

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.page.ink_outlines import strip
from diff3ds.page.lines import Line
from diff3ds.page.noise import wander
from diff3ds.styles.style import InkMark, Mark, Page

# Line widths of ISO 128-2, millimetres: each is the square root of 2 times the one before.
ISO_WIDTHS = (0.13, 0.18, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
# px. Of a dash with its gap that is shorter nobody sees more than a gray line.
SHORTEST = 1.0


@dataclass(frozen=True)
class Ink:
    """A pointed brush or pen: the line swells with the pressure and runs out at its ends.

    Attributes:
        width: of that of the stroke, where the pressure is full.
        pressure: how much of the width comes and goes along the line, from 0 to 1.
        taper: lengths of the thin ends, at the beginning and at the end, in full widths of the line.
        tip: of the width that is left at the very ends.
    """

    width: float = 1.7
    pressure: float = 0.35
    taper: tuple[float, float] = (7.0, 14.0)
    tip: float = 0.12

    @property
    def widest(self) -> float:
        """As `Style` says."""
        return self.width

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says."""
        mean = float(self.width * line.half_width.mean())
        # Pressure changes over some 25 widths of a line, as the strokes of a wrist do. [empirical]
        scale = 50 * max(mean, 0.1)
        line = line.refined(max(scale / 12, mean / 2))
        period = line.length / scale if line.closed else None
        lifted = self.pressure * (0.5 + 0.5 * wander(seed, line.along / scale, period))
        first, last = self.taper
        ends = tapered(line, 2 * mean * first, 2 * mean * last, self.tip)
        return [InkMark(strip(line, self.width * line.half_width * (1 - lifted) * ends))]


def tapered(line: Line, first: float, last: float, tip: float) -> Float[Array, " n"]:
    """Widths as parts of the full one: they grow evenly at the beginning and shrink at the end.

    Where a line is cut, by the page or where it closes, it keeps its width. Of a line that is shorter than both
    together as much is left of them, and of a dot all of the width.

    Args:
        first: length of the thin beginning, pixels.
        last: of the thin end.
        tip: of the width that is left at the very ends.
    """
    share = np.ones(len(line.points))
    room = first * line.begins + last * line.ends
    if line.closed or room <= 0:
        return share
    part = min(1.0, line.length / room)
    tip += (1 - tip) * (1 - part)
    ends = (line.along, first, line.begins), (line.length - line.along, last, line.ends)
    for distance, length, whole in ends:
        if whole and length > 0 and part > 0:
            share = np.minimum(share, tip + (1 - tip) * (distance / (length * part)).clip(0, 1))
    return share


@dataclass(frozen=True)
class Nib:
    """A broad nib held at one angle, an ellipse: lines along it are thin, those across it broad.

    Attributes:
        width: of the nib, in widths of the stroke.
        thickness: of the nib, in its widths.
        angle: of the nib against the horizontal, degrees counter-clockwise.
    """

    width: float = 3.2
    thickness: float = 0.16
    angle: float = 40.0

    @property
    def widest(self) -> float:
        """As `Style` says."""
        return self.width

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says: in a frame in which the nib is round, its outline is that of an even line."""
        turn, thin = math.radians(-self.angle), self.thickness
        cosine, sine = math.cos(turn), math.sin(turn)
        # Turned so that the nib lies along x, then stretched across it.
        to_round = np.array([[cosine, sine], [-sine / thin, cosine / thin]])
        back = np.linalg.inv(to_round)
        round_line = _mapped(line, to_round)
        moved = (back[0, 0], back[1, 0], back[0, 1], back[1, 1], 0, 0)
        return [InkMark(strip(round_line, self.width * round_line.half_width), moved=moved)]


def _mapped(line: Line, matrix: Float[Array, "2 2"]) -> Line:
    """The line after a linear map that mirrors nothing, with the half widths that it had."""
    if len(line.points) < 2:
        return replace(line, points=line.points @ matrix.T)
    # Stretched bends turn faster: samples enough that each still turns little.
    line = line.refined(max(line.length / 400, 0.5 * float(line.half_width.mean()) + 0.25))
    direction = np.stack([np.cos(line.angle), np.sin(line.angle)], -1) @ matrix.T
    angle = np.unwrap(np.arctan2(direction[:, 1], direction[:, 0]))
    points = line.points @ matrix.T
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return replace(line, points=points, angle=angle, along=np.concatenate([[0.0], step.cumsum()]))


@dataclass(frozen=True)
class Technical:
    """A technical pen: even lines, each of the next width of ISO 128-2, from 0.13 to 2 mm on paper.

    Attributes:
        width: of that of the stroke, before the next of the series is taken.
    """

    width: float = 1.0

    @property
    def widest(self) -> float:
        """As `Style` says."""
        return math.sqrt(2) * self.width

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says."""
        return [InkMark(strip(line, np.full(len(line.points), self.half_width(line, page))))]

    def half_width(self, line: Line, page: Page) -> float:
        """Pixels."""
        wanted = 2 * self.width * float(line.half_width.mean()) / page.pixels_per_mm
        nearest = min(ISO_WIDTHS, key=lambda width: abs(math.log(width / max(wanted, 1e-9))))
        return nearest * page.pixels_per_mm / 2


@dataclass(frozen=True)
class Dashed:
    """A dashed line as ISO 128-21 has them: gaps of one length, and dashes that let the line begin and end with one.

    Attributes:
        width: of that of the stroke.
        dash: about how long dashes are, in widths of the line: they change so that they fill the line.
        gap: how long gaps are, exactly.
    """

    width: float = 1.0
    dash: float = 12.0
    gap: float = 3.0

    @property
    def widest(self) -> float:
        """As `Style` says."""
        return self.width

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says."""
        half_width = self.width * float(line.half_width.mean())
        dashes = self.dashes(line, 2 * half_width)
        strips = [strip(part, np.full(len(part.points), half_width), cap="flat") for part in dashes]
        return [InkMark([contour for some in strips for contour in some])]

    def dashes(self, line: Line, width: float) -> list[Line]:
        """The dashes of a line of this width, in pixels."""
        dash, gap = self.dash * width, self.gap * width
        count = round(line.length / (dash + gap)) if line.closed else round((line.length - dash) / (dash + gap)) + 1
        if count < 2 or dash + gap < SHORTEST:
            return [line]
        gaps = count if line.closed else count - 1
        dash = (line.length - gaps * gap) / count
        starts = [k * (dash + gap) for k in range(count)]
        return [line.part(start, min(start + dash, line.length)) for start in starts]
