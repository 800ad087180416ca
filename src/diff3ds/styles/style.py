"""What a style is: it makes marks on a page of a line; and the page as styles see it."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from diff3ds.page.lines import Line


@dataclass(frozen=True)
class Page:
    """The page that lines lie on.

    Attributes:
        size: (height, width) of a view, pixels.
        pixels_per_mm: on paper.
        seed: of all that is random on it.
    """

    size: tuple[int, int]
    pixels_per_mm: float
    seed: int

    @property
    def unit(self) -> float:
        """Pixels of a view 512 pixels high that one of this page is as large as: for what belongs to the paper."""
        return self.size[0] / 512


@dataclass(frozen=True)
class Mark:
    """One filled outline.

    Attributes:
        path: of pathops, which neither crosses nor overlaps itself.
        opacity: times that of the stroke.
        multiplied: whether its colour is multiplied with what lies below, as transparent paint does.
    """

    path: Any
    opacity: float = 1.0
    multiplied: bool = False


@runtime_checkable
class Style(Protocol):
    """A way to draw lines: a frozen dataclass with this."""

    @property
    def widest(self) -> float:
        """How many half widths of the stroke its ink may reach from the line."""

    def marks(self, line: Line, page: Page, seed: int) -> list[Mark]:
        """The marks of one line, the lowest first.

        Args:
            seed: of this line.
        """
