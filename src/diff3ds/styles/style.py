"""What a style is: it makes marks on a page of a line; and the page as styles see it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.page.ink_outlines import Contour, Side, add_contours
from diff3ds.page.lines import Line
from diff3ds.page.union import cubics_of, pathops, united, without

# A closed outline: cubics that follow on each other, or corners.
Outline = Float[Array, "m 4 2"] | Float[Array, "n 2"]


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

    @property
    def outlines(self) -> list[Outline]:
        """For pixels: outlines that wind one way round what is covered; they may cross and overlap."""
        return [np.stack([path[k : len(path) - 3 + k : 3] for k in range(4)], 1) for path in cubics_of(self.path)]

    @property
    def taken(self) -> list[Outline]:
        """For pixels: outlines of what is left out of it."""
        return []


class InkMark(Mark):
    """A mark of contours: its path is found when it is asked for, so that sides of many lines are fitted together.

    Attributes:
        contours: that wind the same way round what they cover.
        moved: the map of pathops from where the contours are to the page, or None.
        out_of: a mark whose path without these contours is this one's; None fills the contours.
    """

    contours: Sequence[Contour]
    moved: tuple[float, ...] | None
    out_of: Mark | None

    def __init__(
        self,
        contours: Sequence[Contour],
        opacity: float = 1.0,
        multiplied: bool = False,
        *,
        moved: tuple[float, ...] | None = None,
        out_of: Mark | None = None,
    ) -> None:
        fields = {"contours": contours, "opacity": opacity, "multiplied": multiplied, "moved": moved, "out_of": out_of}
        self.__dict__.update(fields)

    @cached_property
    def path(self) -> Any:
        """As of `Mark`."""
        path = pathops().Path()
        add_contours(path, self.contours)
        found = united(path if self.moved is None else path.transform(*self.moved))
        return found if self.out_of is None else without(self.out_of.path, found)

    @property
    def outlines(self) -> list[Outline]:
        """As of `Mark`; `fit_sides` or `smooth_sides` has had the contours."""
        return self._contours if self.out_of is None else self.out_of.outlines

    @property
    def taken(self) -> list[Outline]:
        """As of `Mark`."""
        return [] if self.out_of is None else self._contours

    @property
    def _contours(self) -> list[Outline]:
        joined = [
            np.concatenate([part.cubics if isinstance(part, Side) else part for part in contour])
            for contour in self.contours
        ]
        if self.moved is not None:
            a, b, c, d, x, y = self.moved
            joined = [contour @ np.array([[a, b], [c, d]]) + [x, y] for contour in joined]
        return [contour for contour in joined if len(contour)]


class Flecks(Mark):
    """A mark of many corners, such as grains leave: its path is found when it is asked for.

    Attributes:
        corners: of each fleck; all wind the same way round.
    """

    corners: Sequence[Float[Array, "_ 2"]]

    def __init__(self, corners: Sequence[Float[Array, "_ 2"]], opacity: float) -> None:
        self.__dict__.update({"corners": corners, "opacity": opacity, "multiplied": False})

    @cached_property
    def path(self) -> Any:
        """As of `Mark`."""
        path = pathops().Path()
        for first, *others in (corners.tolist() for corners in self.corners):
            path.moveTo(*first)
            for corner in others:
                path.lineTo(*corner)
            path.close()
        return united(path)

    @property
    def outlines(self) -> list[Outline]:
        """As of `Mark`."""
        return list(self.corners)


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
