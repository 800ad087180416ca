"""A whole SVG drawing: what is drawn, in its order, with outlines, transforms and paints; read with bounds."""

import math
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from diff3ds._checks import users_level
from diff3ds._files import check_there
from diff3ds.svg.cascade import StyleSheet
from diff3ds.svg.element_outlines import Contour, contours_of
from diff3ds.svg.elements import Element, read_elements
from diff3ds.svg.matrices import IDENTITY, Matrix, parse_transform, product
from diff3ds.svg.paints import (
    LONGEST_CHAIN,
    RGBA,
    Paint,
    faded,
    opacity_of,
    parse_color,
    placed_gradient,
    reference,
)
from diff3ds.svg.path_data import number

# Larger is no drawing that can be optimised, or an attack.
MAX_BYTES, MAX_ELEMENTS, MAX_CLONED, DEEPEST = 1 << 26, 500_000, 20_000, 128
SHAPES = ("path", "rect", "circle", "ellipse", "polygon", "polyline", "line")
GROUPS = ("svg", "g", "a", "switch", "symbol")
# What would be drawn by itself, or changes what is, but is not read.
UNREAD = ("image", "text", "foreignObject")
UNREAD_PROPERTIES = ("clip-path", "mask", "filter", "stroke-dasharray", "marker-start", "marker-mid", "marker-end")
INHERITED = (
    "color", "fill", "fill-opacity", "fill-rule", "stroke", "stroke-opacity", "stroke-width", "visibility",
    "stroke-dasharray", "marker-start", "marker-mid", "marker-end",
)  # fmt: skip
# px of a unit of CSS, of an em at the browsers' size of letters.
UNITS = {
    "px": 1.0,
    "pt": 4 / 3,
    "pc": 16.0,
    "mm": 96 / 25.4,
    "cm": 960 / 25.4,
    "in": 96.0,
    "em": 16.0,
    "ex": 8.0,
    "": 1.0,
}
_LENGTH = re.compile(r"\s*([^a-z%\s]*(?:e[+-]?\d+)?)\s*([a-z]*|%)\s*", re.IGNORECASE)
# Attributes that are lengths, by what their percentages are of.
_ALONG = {
    **dict.fromkeys(("x", "x1", "x2", "cx", "rx", "width"), "x"),
    **dict.fromkeys(("y", "y1", "y2", "cy", "ry", "height"), "y"),
    "r": "",
}
# Without these nothing is drawn.
_SIZES = {"rect": ("width", "height"), "circle": ("r",), "ellipse": ("rx", "ry")}


@dataclass(frozen=True)
class Drawn:
    """An element that is drawn.

    Attributes:
        tag: path, rect, circle, ellipse, polygon, polyline or line.
        name: its id, or "".
        around: the ids of the groups that it is in, the outermost first.
        label: what Inkscape or Illustrator call it, or "".
        values: its lengths as numbers.
        contours: its outline, in its own coordinates.
        matrix: from these to the canvas.
        fill: what it is filled with, gradients on the canvas; None for nothing.
        even_odd: the rule of its filling.
        stroke: as `fill`.
        width: of its stroke, in its own coordinates.
    """

    tag: str
    name: str
    around: tuple[str, ...]
    label: str
    values: dict[str, float]
    contours: list[Contour]
    matrix: Matrix
    fill: Paint | None
    even_odd: bool
    stroke: Paint | None
    width: float


@dataclass(frozen=True)
class Drawing:
    """What is drawn on a canvas of this size, from the bottom to the top, and the attributes of the file's root."""

    width: float
    height: float
    drawn: list[Drawn]
    told: dict[str, str]


@dataclass(frozen=True)
class _State:
    """What elements hand down."""

    matrix: Matrix = IDENTITY
    values: dict[str, str] = field(default_factory=dict)
    opacity: float = 1.0
    depth: int = 0
    cloned: bool = False
    around: tuple[str, ...] = ()


def read_drawing(path: Path) -> Drawing:
    """Reads an SVG file; a warning says what is left out of it.

    Raises:
        ValueError: no such file, or a broken or too large one; values that cannot be read. It names the path.
        OSError: it cannot be read.
    """
    check_there(path, "a drawing, a file such as drawing.svg", MAX_BYTES)
    try:
        reader = _Reader(read_elements(path.read_bytes(), MAX_ELEMENTS, entities=True))
        drawing = reader.read()
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    if reader.left_out:
        some = ", ".join(sorted(reader.left_out)[:8]) + (", ..." if len(reader.left_out) > 8 else "")
        warnings.warn(f"{path}: left out are {some}", stacklevel=users_level())
    return drawing


class _Reader:
    """Walks through the elements of a file."""

    def __init__(self, root: Element) -> None:
        self.root = root
        self.sheet = StyleSheet()
        self.named: dict[str, Element] = {}
        self.left_out: set[str] = set()
        self.drawn: list[Drawn] = []
        self.size = (0.0, 0.0)
        self.cloned = 0

    def read(self) -> Drawing:
        """The drawing of the root."""
        for element in _all(self.root):
            self.named.setdefault(element.attributes.get("id", ""), element)
            if element.tag == "style":
                self.sheet.add(element.text)
        if self.sheet.unread:
            self.left_out.add(f"style rules such as {self.sheet.unread[0][:30]!r}")
        x, y = self._canvas()
        self._walk(self.root, _State((1.0, 0.0, 0.0, 1.0, -x, -y)), top=True)
        return Drawing(*self.size, self.drawn, self.root.attributes)

    def _canvas(self) -> tuple[float, float]:
        """Sets the size of the canvas, and gives its corner: that of the view box, or else the size of the file."""
        box = _view_box(self.root)
        if box:
            self.size = box[2], box[3]
            return box[0], box[1]
        sides = [self.root.attributes.get(name, "") for name in ("width", "height")]
        if not all(sides) or any(side.strip().endswith("%") for side in sides):
            raise ValueError("it says no size: give its root a viewBox, or a width and a height")
        self.size = self.length(sides[0], "x"), self.length(sides[1], "y")
        if min(self.size) <= 0:
            raise ValueError(f"its width and height must be positive, got {sides[0]!r} and {sides[1]!r}")
        return 0.0, 0.0

    def length(self, text: str, along: str) -> float:
        """A length in user units; percentages are of the canvas."""
        found = _LENGTH.fullmatch(text)
        if not found or found[2].lower() not in (*UNITS, "%"):
            raise ValueError(f"expected a length, got {text[:40]!r}")
        value = number(found[1])
        if found[2] != "%":
            return value * UNITS[found[2].lower()]
        width, height = self.size
        return value / 100 * {"x": width, "y": height, "": math.hypot(width, height) / math.sqrt(2)}[along]

    def _walk(self, element: Element, state: _State, top: bool = False) -> None:
        """Takes an element and those in it."""
        self.cloned += state.cloned
        if self.cloned > MAX_CLONED or state.depth > DEEPEST:
            raise ValueError(f"its clones draw more than {MAX_CLONED} elements, or some more than {DEEPEST} deep")
        if element.tag in UNREAD:
            self.left_out.add(f"{element.tag} elements")
        if element.tag not in (*GROUPS, *SHAPES, "use") or (element.tag == "symbol" and not top):
            return
        values = self.sheet.of(element)
        if values.get("display") == "none":
            return
        self.left_out |= {name for name in UNREAD_PROPERTIES if values.get(name, "none") != "none"}
        inner = self._inherited(state, values)
        if element.tag in SHAPES:
            self._draw(element, values, inner)
        elif element.tag == "use":
            self._clone(element, inner)
        else:
            if not top:
                around = (*inner.around, element.attributes.get("id", ""))
                inner = replace(inner, matrix=product(inner.matrix, self._nested(element)), around=around)
            children = element.children[:1] if element.tag == "switch" else element.children
            for child in children:
                self._walk(child, inner)

    def _inherited(self, state: _State, values: dict[str, str]) -> _State:
        own = {name: values[name] for name in INHERITED if values.get(name, "inherit") != "inherit"}
        opacity = opacity_of(values["opacity"]) if "opacity" in values else 1.0
        matrix = product(state.matrix, parse_transform(values.get("transform", "")))
        return _State(
            matrix, {**state.values, **own}, state.opacity * opacity, state.depth + 1, state.cloned, state.around
        )

    def _nested(self, element: Element) -> Matrix:
        """From the coordinates in an inner svg or symbol to those around it, fitted into its middle."""
        if element.tag not in ("svg", "symbol"):
            return IDENTITY
        x, y = (self.length(element.attributes.get(name, "0"), name) for name in "xy")
        box = _view_box(element)
        if not box:
            return 1.0, 0.0, 0.0, 1.0, x, y
        width, height = (
            self.length(element.attributes.get(n, "100%"), a) for n, a in (("width", "x"), ("height", "y"))
        )
        scale = min(width / box[2], height / box[3])
        left, up = x + (width - scale * box[2]) / 2, y + (height - scale * box[3]) / 2
        return scale, 0.0, 0.0, scale, left - scale * box[0], up - scale * box[1]

    def _clone(self, element: Element, state: _State) -> None:
        found = self.named.get(element.attributes.get("href", "").lstrip("#"))
        if found is None:
            self.left_out.add("clones of what is not there")
            return
        x, y = (self.length(element.attributes.get(name, "0"), name) for name in "xy")
        state = replace(state, matrix=product(state.matrix, (1.0, 0.0, 0.0, 1.0, x, y)), cloned=True)
        if found.tag not in ("svg", "symbol"):
            self._walk(found, state)
            return
        # The clone says how large what it shows is.
        size = {name: element.attributes[name] for name in ("width", "height") if name in element.attributes}
        inner = self._inherited(state, self.sheet.of(found))
        inner = replace(
            inner, matrix=product(inner.matrix, self._nested(replace(found, attributes=found.attributes | size)))
        )
        for child in found.children:
            self._walk(child, inner)

    def _draw(self, element: Element, values: dict[str, str], state: _State) -> None:
        given = state.values
        if given.get("visibility", "visible") != "visible":
            return
        lengths = {
            name: self.length(text, _ALONG[name]) for name, text in values.items() if name in _ALONG and text != "auto"
        }
        if element.tag == "ellipse":
            lengths = {"rx": lengths.get("ry", 0.0), "ry": lengths.get("rx", 0.0)} | lengths
        if any(lengths.get(name, 0.0) <= 0 for name in _SIZES.get(element.tag, ())):
            return
        plain = {name: f"{value:.17g}" for name, value in lengths.items()}
        texts = {name: values[name] for name in ("d", "points") if name in values}
        contours = contours_of(element.tag, plain | texts)
        if not contours:
            return
        width = self.length(given.get("stroke-width", "1"), "")
        paints: list[Paint | None] = []
        for name, otherwise in (("fill", "black"), ("stroke", "none")):
            opacity = state.opacity * opacity_of(given.get(f"{name}-opacity", "1"))
            paint = self._paint(given.get(name, otherwise), state, contours)
            paints.append(None if paint is None else faded(paint, opacity))
        fill, stroke = paints
        if width <= 0 or stroke is None:
            stroke = None
        if fill is not None or stroke is not None:
            name, even_odd = element.attributes.get("id", ""), given.get("fill-rule") == "evenodd"
            label = element.attributes.get("label") or element.attributes.get("data-name", "")
            looks: Any = {"fill": fill, "even_odd": even_odd, "stroke": stroke, "width": width}
            drawn = Drawn(element.tag, name, state.around, label, lengths, contours, state.matrix, **looks)
            self.drawn.append(drawn)

    def _paint(self, text: str, state: _State, contours: list[Contour]) -> Paint | None:
        url = reference(text)
        if url is None:
            return self._color(text, state.values)
        found = self.named.get(url[0])
        if found is None or found.tag not in ("linearGradient", "radialGradient"):
            self.left_out.add("paints that are no gradients")
            return self._color(url[1], state.values) if url[1] else None
        values, stops = self._gradient(found)
        if len(stops) < 2:
            return stops[0][1] if stops else None
        x, y = zip(*(point for contour in contours for point in contour.points), strict=True)
        box = min(x), min(y), max(x) - min(x), max(y) - min(y)
        linear = found.tag == "linearGradient"
        gradient, lacks = placed_gradient(linear, values, state.matrix, box, self.length, stops)
        self.left_out.update(lacks)
        return gradient

    def _color(self, text: str, given: dict[str, str]) -> RGBA | None:
        text = given.get("color", "black") if text.lower() == "currentcolor" else text
        try:
            return parse_color(text)
        except ValueError:
            self.left_out.add(f"paints such as {text[:30]!r}")
            return None

    def _gradient(self, element: Element) -> tuple[dict[str, str], list[tuple[float, RGBA]]]:
        """The attributes and stops of a gradient, its own or else those of gradients that it refers to."""
        values: dict[str, str] = {}
        stops: list[tuple[float, RGBA]] = []
        for _ in range(LONGEST_CHAIN):
            values = element.attributes | values
            stops = stops or [self._stop(child) for child in element.children if child.tag == "stop"]
            following = self.named.get(element.attributes.get("href", "").lstrip("#"))
            if following is None or "href" not in element.attributes:
                break
            element = following
        return values, stops

    def _stop(self, element: Element) -> tuple[float, RGBA]:
        values = self.sheet.of(element)
        color = self._color(values.get("stop-color", "black"), values) or (0.0, 0.0, 0.0, 0.0)
        alpha = color[3] * opacity_of(values.get("stop-opacity", "1"))
        return opacity_of(values.get("offset", "0")), (*color[:3], alpha)


def _all(element: Element) -> Iterator[Element]:
    yield element
    for child in element.children:
        yield from _all(child)


def _view_box(element: Element) -> tuple[float, float, float, float] | None:
    """The view box of an element.

    Raises:
        ValueError: one that is none.
    """
    text = element.attributes.get("viewBox", "").strip()
    if not text:
        return None
    values = [number(part) for part in re.split(r"[\s,]+", text)]
    if len(values) != 4 or values[2] <= 0 or values[3] <= 0:
        raise ValueError(f"a viewBox has a corner and a positive size, got {text[:60]!r}")
    return values[0], values[1], values[2], values[3]
