"""Styles of transparent colour: marker and watercolour."""

from dataclasses import dataclass

from diff3ds._shapes import Array, Float
from diff3ds.page.ink_outlines import strip
from diff3ds.page.lines import Line
from diff3ds.page.noise import seed_of, wander
from diff3ds.styles.pens import tapered
from diff3ds.styles.style import InkMark, Mark, Page


@dataclass(frozen=True)
class Marker:
    """A felt marker: a broad even band with straight ends that lets through what is below.

    Attributes:
        width: of that of the stroke.
        opacity: of the band.
    """

    width: float = 3.6
    opacity: float = 0.6

    @property
    def widest(self) -> float:
        """As `Style` says."""
        return 1.1 * self.width

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says."""
        half_width = self.width * float(line.half_width.mean())
        line = line.refined(max(half_width, 1.0))
        widths = _wavering(line, seed, self.width * line.half_width, 0.05, 4 * half_width)
        return [InkMark(strip(line, widths[0], cap="flat", left=widths[1]), self.opacity, multiplied=True)]


@dataclass(frozen=True)
class Watercolour:
    """A wet brush: a pale wash with uneven edges, along which the colour gathers as it dries.

    Attributes:
        width: of that of the stroke.
        wash: opacity of the wash; half as much again lies on its middle.
        rim: opacity of the edge, on top.
        rim_width: of the edge, in half widths of the wash.
    """

    width: float = 5.0
    wash: float = 0.32
    rim: float = 0.4
    rim_width: float = 0.16

    @property
    def widest(self) -> float:
        """As `Style` says."""
        return 1.4 * self.width

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """As `Style` says."""
        half_width = max(self.width * float(line.half_width.mean()), 0.1)
        line = line.refined(max(0.7 * half_width, 0.5))
        brush = self.width * line.half_width * tapered(line, 3 * half_width, 5 * half_width, 0.55)
        right, left = _wavering(line, seed, brush, 0.3, 2.5 * half_width)
        wash = InkMark(strip(line, right, left=left), self.wash, multiplied=True)
        rim = self.rim_width * half_width
        inner = strip(line, (right - rim).clip(0), left=(left - rim).clip(0))
        blot = _wavering(line, seed_of(seed, 9), 0.6 * brush, 0.5, 4 * half_width)
        return [
            wash,
            InkMark(strip(line, blot[0], left=blot[1]), self.wash / 2, multiplied=True),
            InkMark(inner, self.rim, multiplied=True, out_of=wash),
        ]


def _wavering(
    line: Line, seed: int, half_width: Float[Array, " n"], amount: float, scale: float
) -> tuple[Array, Array]:
    """Half widths to the right and to the left that waver by so much of themselves, over such a distance in pixels."""
    period = line.length / scale if line.closed else None
    sides = (wander(seed_of(seed, side), line.along / scale, period) for side in (1, 2))
    right, left = (half_width * (1 + amount * side) for side in sides)
    return right, left
