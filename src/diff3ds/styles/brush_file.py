"""The shape of a user's brush: the filled outlines of an SVG file, which is read with bounds and not trusted."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from diff3ds._shapes import Array
from diff3ds.page.union import pathops, united
from diff3ds.svg.cascade import declarations
from diff3ds.svg.element_outlines import as_path_data
from diff3ds.svg.elements import Element, read_elements
from diff3ds.svg.matrices import IDENTITY, Matrix, parse_transform, product
from diff3ds.svg.path_data import add_path_data

# A brush is a small drawing; more is taken for a mistake or an attack.
MAX_BYTES, MAX_ELEMENTS, MOST_COMMANDS = 1 << 20, 10_000, 20_000
# Coordinates beyond are taken for a mistake: float32 has no thousandths there.
LARGEST = 1e4
# px. The size that outlines are joined in.
FRAME = 1000.0
# How far arcs may be off, in sizes of their shape.
ROUND = 1e-4
# What holds drawn elements, what is drawn, what is never drawn by itself, and what would be drawn but is not read.
GROUPS = ("svg", "g", "a", "switch")
SHAPES = ("path", "rect", "circle", "ellipse", "polygon")
UNREAD = ("image", "text", "use", "foreignObject", "script")
OPEN = ("line", "polyline")


def load_brush(path: str | Path) -> Any:
    """The filled shapes of an SVG file as one outline (a path of pathops), in the file's units.

    Colours are not kept, a brush has that of its stroke. Groups, transforms, paths, rectangles, circles, ellipses and
    polygons are read; lines without a filling are left out.

    Raises:
        ValueError: not such a file, or a broken or too large one; one with a document type that declares something, or
            with elements that are not read (pictures, text, clones, clips); one without a filled shape.
        ImportError: the extra `styles` is not installed.
        OSError: the file cannot be read.
    """
    path = Path(path)
    if (size := path.stat().st_size) > MAX_BYTES:
        raise ValueError(f"{path}: {size} bytes are more than the {MAX_BYTES} of a brush")
    reader = _Reader(pathops().Path())
    try:
        reader.read(read_elements(path.read_bytes(), MAX_ELEMENTS), _State())
        shape = _united(reader.shape)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    if not len(list(shape.segments)):
        raise ValueError(f"{path}: there is no filled shape in it: make paths of its lines, text and clones first")
    return shape


@dataclass
class _State:
    """What an element hands down to those in it."""

    matrix: Matrix = IDENTITY
    filled: bool = True
    rule: str = "nonzero"
    drawn: bool = True


@dataclass
class _Reader:
    """Adds the shapes of elements as they are read."""

    shape: Any
    commands: int = 0

    def read(self, element: Element, state: _State) -> None:
        """Takes an element and those in it."""
        if element.tag == "style" and re.search(r":\s*(none|hidden|evenodd)", element.text):
            raise ValueError("its style sheet changes how shapes are filled: save it with presentation attributes")
        if element.tag in UNREAD and state.drawn:
            raise ValueError(
                f"it has an element {element.tag!r}, which is not read: make paths of pictures, text and clones"
            )
        inner = _State(drawn=False)
        if state.drawn and element.tag in (*GROUPS, *SHAPES, *OPEN):
            inner = self.inherited(state, element.attributes)
        if element.tag in SHAPES and inner.drawn and inner.filled:
            self.add(element.tag, element.attributes, inner)
        for child in element.children:
            self.read(child, inner)

    def inherited(self, state: _State, attributes: dict[str, str]) -> _State:
        """The state of an element in another."""
        values = {**attributes, **declarations(attributes.get("style", ""))}
        for name in ("clip-path", "mask"):
            if values.get(name, "none") != "none":
                raise ValueError(f"it has a {name}, which is not read: cut the shapes themselves")
        matrix = product(state.matrix, parse_transform(attributes.get("transform", "")))
        filled = values["fill"] not in ("none", "transparent") if "fill" in values else state.filled
        hidden = values.get("display") == "none" or values.get("visibility") == "hidden"
        return _State(matrix, filled, values.get("fill-rule", state.rule), not hidden)

    def add(self, tag: str, attributes: dict[str, str], state: _State) -> None:
        """Adds a shape, of which nothing is left that crosses itself."""
        library = pathops()
        path = library.Path(fillType=library.FillType.EVEN_ODD if state.rule == "evenodd" else library.FillType.WINDING)
        self.commands += add_path_data(path, as_path_data(tag, attributes), MOST_COMMANDS, LARGEST, filled=True)
        if self.commands > MOST_COMMANDS:
            raise ValueError(f"it has more than {MOST_COMMANDS} path commands: simplify it")
        x0, y0, x1, y1 = path.controlPointBounds
        path.convertConicsToQuads(ROUND * max(x1 - x0, y1 - y0, 1e-6))
        path = path.transform(*state.matrix)
        # The transforms of groups multiply.
        if not all(abs(value) <= LARGEST for value in path.controlPointBounds or (math.inf,)):
            raise ValueError(f"it has coordinates beyond {LARGEST:g}: make it smaller")
        self.shape.addPath(_united(path))


def _united(path: Any) -> Any:
    """The outline of what a path covers, found in a frame in which it is as large as a page: brushes may be tiny."""
    x0, y0, x1, y1 = path.controlPointBounds
    extent = max(x1 - x0, y1 - y0)
    if extent <= 0:
        return pathops().Path()
    scale = FRAME / extent
    grown = path.transform(scale, 0, 0, scale, -scale * x0, -scale * y0)
    return united(grown).transform(1 / scale, 0, 0, 1 / scale, x0, y0)


def contours_of(path: Any) -> Iterator[Array]:
    """The contours of a path of pathops, (m, 4, 2) cubics each."""
    verb = pathops().PathVerb
    cubics: list[list[Any]] = []
    for kind, points in path:
        if kind == verb.MOVE:
            if cubics:
                yield np.array(cubics)
            cubics, first, last = [], np.array(points[0]), np.array(points[0])
            continue
        p = [last, *map(np.array, points)]
        if kind == verb.CLOSE:
            p = [last, first]
        if len(p) == 2:
            cubics.append([p[0], p[0] + (p[1] - p[0]) / 3, p[1] - (p[1] - p[0]) / 3, p[1]])
        elif len(p) == 3:
            cubics.append([p[0], p[0] + 2 / 3 * (p[1] - p[0]), p[2] + 2 / 3 * (p[1] - p[2]), p[2]])
        else:
            cubics.append(p)
        last = p[-1]
    if cubics:
        yield np.array(cubics)
