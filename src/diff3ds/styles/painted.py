"""What a style paints of the strokes of one view: filled outlines, and the box of them all."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.page.drawn_paths import DrawnPath
from diff3ds.page.ink_outlines import Contour, fit_sides, smooth_sides
from diff3ds.page.lines import MARGIN, Line, lines_of
from diff3ds.page.noise import seed_of
from diff3ds.page.sheet.ink_boxes import Box, box_of_outlines, union
from diff3ds.page.union import cubics_of, pathops, within
from diff3ds.project import Strokes2D
from diff3ds.sketch import Sketch
from diff3ds.styles.inked_areas import Area
from diff3ds.styles.style import InkMark, Mark, Page, Style
from diff3ds.svg.layer_groups import Group

# px. Half widths below leave no ink.
THINNEST = 0.005
# Half widths of strokes, in pages: larger ones are taken for a mistake.
LARGEST = 4
# Of the way to the colour of the ground that the farthest strokes go, and of their width that they lose, with a depth
# cue of 1.
FADE, THIN = 0.8, 0.6


class Painted(NamedTuple):
    """A filled outline of a view.

    Attributes:
        path: of pathops, in pixels from the view's corner, cut at its border.
        color: RGB in [0, 1].
        opacity: in [0, 1].
        multiplied: whether its colour is multiplied with what lies below.
    """

    path: Any
    color: Sequence[float]
    opacity: float
    multiplied: bool

    @property
    def box(self) -> Box:
        """Of the outline, pixels."""
        return _box(self.path)

    def moved(self, zoom: float, x: float, y: float) -> "Painted":
        """Scaled, then shifted."""
        return self._replace(path=self.path.transform(zoom, 0, 0, zoom, x, y))

    def drawn(self, stroke: int) -> DrawnPath:
        """As cubics, as what is drawn of a stroke."""
        r, g, b = self.color
        curves, multiplied = cubics_of(self.path), self.multiplied
        return DrawnPath((stroke,), curves, True, None, (r, g, b), self.opacity, multiplied=multiplied)


class Inked(NamedTuple):
    """What `Painted` is, for pixels: outlines are neither joined nor cut.

    Attributes:
        mark: what is painted.
        page: (height, width) of the view, pixels.
        color: RGB in [0, 1].
        opacity: in [0, 1].
        move: scale, then shift, from where the mark is to the page, pixels.
    """

    mark: Mark
    page: tuple[int, int]
    color: Sequence[float]
    opacity: float
    move: tuple[float, float, float] = (1.0, 0.0, 0.0)

    @property
    def box(self) -> Box | None:
        """Of what the view shows of it, pixels, before it is moved."""
        box = box_of_outlines(self.mark.outlines)
        if box is None or _holds(self.page, box):
            return box
        path = _on_page(self.mark.path, self.page)
        return None if path is None else _box(path)

    def moved(self, zoom: float, x: float, y: float) -> "Inked":
        """Scaled, then shifted."""
        scale, u, v = self.move
        return self._replace(move=(zoom * scale, zoom * u + x, zoom * v + y))

    def area(self, corner: tuple[float, float], cut: bool) -> Area:
        """On a page on which the view begins there; cut: whether what leaves the view is left out."""
        scale, shift = self.move[0], np.add(self.move[1:], corner)
        outlines, taken = self.mark.outlines, self.mark.taken
        if scale != 1 or shift.any():
            outlines, taken = ([scale * each + shift for each in some] for some in (outlines, taken))
        frame = None
        if cut and (box := box_of_outlines(self.mark.outlines)) is not None and not _holds(self.page, box):
            height, width = self.page
            frame = shift[0], shift[1], scale * width + shift[0], scale * height + shift[1]
        return Area(outlines, self.color, self.opacity, self.mark.multiplied, taken, frame)


class Strokes(NamedTuple):
    """Strokes that are drawn in a view, which of the sketch's each is made of, and in which layer it is."""

    sketch: Sketch
    made: list[list[int]]
    groups: list[Group]


class SeenStrokes:
    """The strokes of one view as lines, of which a style makes marks."""

    def __init__(self, drawn: Strokes, strokes: Strokes2D, style: Style, page: Page, depth_cue: float) -> None:
        """Finds the lines.

        Args:
            drawn: the strokes.
            strokes: the same as they are seen.
            style: that draws them.
            page: the picture of the view.
            depth_cue: how much lighter and thinner strokes become with their depth, from 0 to 1.

        Raises:
            ValueError: a stroke is much wider than the page.
        """
        lines = lines_of(strokes, 0, page.size, style.widest)
        self.sketch, self.style, self.page = drawn.sketch, style, page
        self.depth_cue, self.far = depth_cue, _Distance(lines)
        self.lines: dict[int, list[Line]] = {}
        for line in lines:
            if line.half_width.max() < THINNEST:
                continue
            if line.half_width.max() > LARGEST * max(page.size):
                wide = 2 * float(line.half_width.max())
                stroke = min(drawn.made[line.stroke])
                raise ValueError(
                    f"stroke {stroke} is {wide:.3g} pixels wide in this view, more than {2 * LARGEST} pages: "
                    "make its width smaller, or the camera's `near` larger if it passes there"
                )
            self.lines.setdefault(line.stroke, []).append(line)

    def painted(self, ground: Sequence[float]) -> dict[int, list[Painted]]:
        """What is painted of each stroke, in the order of the lines.

        Args:
            ground: RGB of what lies below.
        """
        found = {
            stroke: [
                Painted(path, color, mark.opacity * opacity, mark.multiplied)
                for mark in marks
                if (path := _on_page(mark.path, self.page.size)) is not None
            ]
            for stroke, marks, color, opacity in self._colored(ground, fit_sides)
        }
        return {stroke: painted for stroke, painted in found.items() if painted}

    def inked(self, ground: Sequence[float]) -> dict[int, list[Inked]]:
        """As `painted`, for pixels."""
        return {
            stroke: [Inked(mark, self.page.size, color, mark.opacity * opacity) for mark in marks]
            for stroke, marks, color, opacity in self._colored(ground, smooth_sides)
        }

    def _colored(
        self, ground: Sequence[float], sides: Callable[[Iterable[Contour]], None]
    ) -> Iterator[tuple[int, list[Mark], list[float], float]]:
        """The marks of each stroke, the lowest first, with its colour and opacity."""
        made = iter(self._marks([(stroke, k) for stroke, some in self.lines.items() for k in range(len(some))], sides))
        for stroke, some in self.lines.items():
            layers = [next(made) for _ in some]
            fade = FADE * self.depth_cue * self.far.mean(some)
            color = [c + fade * (g - c) for c, g in zip(self.sketch.color[stroke].tolist(), ground, strict=True)]
            marks = [mark for marks in zip(*layers, strict=True) for mark in marks]
            yield stroke, marks, color, float(self.sketch.opacity[stroke])

    def box(self) -> Box | None:
        """The box of all that is painted, pixels: only lines that may reach its sides are drawn for it."""
        names = [(stroke, k) for stroke, some in self.lines.items() for k in range(len(some))]
        reach = np.array([self._reach(self.lines[stroke][k]) for stroke, k in names]).reshape(-1, 4)
        outwards, left, found = np.array([-1, -1, 1, 1]), np.ones(len(names), bool), None
        for count in 2 ** np.arange(len(names) + 1):
            beyond = left[:, None] & (True if found is None else outwards * reach > outwards * np.array(found))
            farthest = np.argsort(np.where(beyond, -outwards * reach, np.inf), axis=0, kind="stable")[:count]
            some = np.unique(farthest[np.take_along_axis(beyond, farthest, 0)])
            if not len(some):
                break
            left[some] = False
            marks = (mark for each in self._marks([names[row] for row in some]) for mark in each)
            paths = (_on_page(mark.path, self.page.size) for mark in marks)
            found = union([found, *(_box(path) for path in paths if path is not None)])
        return found

    def _reach(self, line: Line) -> Box:
        """A box that holds all ink of a line on the page."""
        most = MARGIN + self.style.widest * line.half_width.max()
        height, width = self.page.size
        (x0, y0), (x1, y1) = line.points.min(0) - most, line.points.max(0) + most
        return max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)

    def _marks(
        self, names: Sequence[tuple[int, int]], sides: Callable[[Iterable[Contour]], None] = fit_sides
    ) -> list[list[Mark]]:
        """The marks of lines, each given by its stroke and its number there; sides: what gives sides their cubics."""
        found = []
        for stroke, k in names:
            line = self.lines[stroke][k]
            thinned = replace(line, half_width=line.half_width * (1 - THIN * self.depth_cue * self.far(line.depth)))
            found.append(self.style.marks(thinned, self.page, seed_of(self.page.seed, stroke, k)))
        inked = [mark for marks in found for mark in marks if isinstance(mark, InkMark)]
        sides(contour for mark in inked for contour in mark.contours)
        return found


class _Distance:
    """How far depths lie between the nearest and the farthest of a view: from 0 to 1."""

    def __init__(self, lines: list[Line]) -> None:
        self.near = min((float(line.depth.min()) for line in lines), default=0.0)
        self.far = max((float(line.depth.max()) for line in lines), default=0.0)

    def __call__(self, depth: Float[Array, " n"]) -> Float[Array, " n"]:
        return (depth - self.near) / max(self.far - self.near, 1e-9)

    def mean(self, lines: list[Line]) -> float:
        """Along the lines of a stroke; of dots, their own."""
        total = sum(line.length for line in lines)
        if total <= 0:
            return float(np.mean([self(line.depth[:1])[0] for line in lines]))
        middles = [np.diff(line.along) @ self((line.depth[1:] + line.depth[:-1]) / 2) for line in lines]
        return float(sum(middles)) / total


def _holds(page: tuple[int, int], box: Box) -> bool:
    height, width = page
    x0, y0, x1, y1 = box
    return x0 >= 0 and y0 >= 0 and x1 <= width and y1 <= height


def _box(path: Any) -> Box:
    x0, y0, x1, y1 = path.bounds
    return x0, y0, x1, y1


def _on_page(path: Any, size: tuple[int, int]) -> Any:
    """A path, cut at the page's border; None if the page shows nothing of it."""
    height, width = size
    if not list(path.segments):
        return None
    if not _holds(size, path.bounds):
        page = pathops().Path()
        page.moveTo(0, 0)
        for corner in ((width, 0), (width, height), (0, height)):
            page.lineTo(*corner)
        page.close()
        path = within(path, page)
    return path if list(path.segments) else None
