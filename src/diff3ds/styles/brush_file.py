"""The shape of a user's brush: the filled outlines of an SVG file, which is read with bounds and not trusted."""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from diff3ds._shapes import Array
from diff3ds.page.union import pathops, united
from diff3ds.styles.path_data import LARGEST, MOST_COMMANDS, add_path_data, number, numbers

# A brush is a small drawing; more is taken for a mistake or an attack.
MAX_BYTES, MAX_ELEMENTS, DEEPEST = 1 << 20, 10_000, 64
# px. The size that outlines are joined in.
FRAME = 1000.0
# How far arcs may be off, in sizes of their shape.
ROUND = 1e-4
# What holds drawn elements, what is drawn, what is never drawn by itself, and what would be drawn but is not read.
GROUPS = ("svg", "g", "a", "switch")
SHAPES = ("path", "rect", "circle", "ellipse", "polygon")
UNREAD = ("image", "text", "use", "foreignObject", "script")
OPEN = ("line", "polyline")
SPACES = ("http://www.w3.org/2000/svg", "")
# (a, b, c, d, e, f): x' = a x + c y + e, y' = b x + d y + f, as SVG and pathops have it.
Matrix = tuple[float, float, float, float, float, float]
IDENTITY: Matrix = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)


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
        reader.read(path.read_bytes())
        shape = _united(reader.shape)
    except expat.ExpatError as error:
        raise ValueError(f"{path}: not an SVG file ({error})") from error
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
    states: list[_State] = field(default_factory=lambda: [_State()])
    elements: int = 0
    commands: int = 0
    styled: bool = False

    def read(self, content: bytes) -> None:
        """Reads a whole file."""
        parser = expat.ParserCreate(namespace_separator="}")
        parser.StartElementHandler = self.start
        parser.EndElementHandler = lambda _: self.states.pop()
        parser.StartDoctypeDeclHandler = self.doctype
        parser.CharacterDataHandler = self.characters
        parser.Parse(content, True)

    def doctype(self, name: str, system: str | None, public: str | None, subset: int) -> None:
        """Refuses what could declare entities; what is outside of the file is not read."""
        if subset:
            raise ValueError("its document type declares entities, which are not read: save it as plain SVG")

    def characters(self, text: str) -> None:
        """Refuses style sheets that hide or empty shapes."""
        if self.styled and re.search(r":\s*(none|hidden|evenodd)", text):
            raise ValueError("its style sheet changes how shapes are filled: save it with presentation attributes")

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Takes an element."""
        space, _, tag = name.rpartition("}")
        state = self.states[-1]
        self.elements += 1
        if self.elements == 1 and (tag != "svg" or space not in SPACES):
            raise ValueError(f"not an SVG file: it begins with the element {tag!r}")
        if self.elements > MAX_ELEMENTS or len(self.states) > DEEPEST:
            raise ValueError(f"it has more than {MAX_ELEMENTS} elements, or some more than {DEEPEST} deep")
        self.styled = tag == "style"
        if not state.drawn or space not in SPACES or tag not in (*GROUPS, *SHAPES, *UNREAD, *OPEN):
            self.states.append(_State(drawn=False))
            return
        if tag in UNREAD:
            raise ValueError(f"it has an element {tag!r}, which is not read: make paths of pictures, text and clones")
        inner = self.inherited(state, attributes)
        self.states.append(inner)
        if tag in SHAPES and inner.drawn and inner.filled:
            self.add(tag, attributes, inner)

    def inherited(self, state: _State, attributes: dict[str, str]) -> _State:
        """The state of an element in another."""
        css = dict(re.findall(r"([\w-]+)\s*:\s*([^;]+)", attributes.get("style", "")))
        values = {**attributes, **{name: value.strip() for name, value in css.items()}}
        for name in ("clip-path", "mask"):
            if values.get(name, "none") != "none":
                raise ValueError(f"it has a {name}, which is not read: cut the shapes themselves")
        matrix = _product(state.matrix, _transform(attributes.get("transform", "")))
        filled = values["fill"] not in ("none", "transparent") if "fill" in values else state.filled
        hidden = values.get("display") == "none" or values.get("visibility") == "hidden"
        return _State(matrix, filled, values.get("fill-rule", state.rule), not hidden)

    def add(self, tag: str, attributes: dict[str, str], state: _State) -> None:
        """Adds a shape, of which nothing is left that crosses itself."""
        library = pathops()
        path = library.Path(fillType=library.FillType.EVEN_ODD if state.rule == "evenodd" else library.FillType.WINDING)
        if tag == "path":
            self.commands += add_path_data(path, attributes.get("d", ""))
        else:
            self.commands += add_path_data(path, _as_path_data(tag, attributes))
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


def _as_path_data(tag: str, attributes: dict[str, str]) -> str:
    """Path data of another shape; empty if there is nothing of it."""

    def value(name: str, default: float = 0.0) -> float:
        return number(attributes[name]) if name in attributes else default

    if tag == "polygon":
        return "M" + attributes["points"] + "Z" if attributes.get("points", "").strip() else ""
    if tag == "rect":
        x, y, width, height = (value(name) for name in ("x", "y", "width", "height"))
        rx, ry = value("rx", value("ry")), value("ry", value("rx"))
        rx, ry = min(rx, width / 2), min(ry, height / 2)
        corner = f"a{rx},{ry} 0 0 1 " if rx > 0 and ry > 0 else "l"
        rx, ry = (rx, ry) if corner != "l" else (0.0, 0.0)
        return (
            f"M{x + rx},{y}h{width - 2 * rx}{corner}{rx},{ry}v{height - 2 * ry}{corner}{-rx},{ry}"
            f"h{2 * rx - width}{corner}{-rx},{-ry}v{2 * ry - height}{corner}{rx},{-ry}Z"
        )
    x, y = value("cx"), value("cy")
    rx, ry = (value("r"), value("r")) if tag == "circle" else (value("rx"), value("ry"))
    return f"M{x + rx},{y}a{rx},{ry} 0 0 1 {-2 * rx},0a{rx},{ry} 0 0 1 {2 * rx},0Z"


def _transform(text: str) -> Matrix:
    """The product of the transforms of an attribute.

    Raises:
        ValueError: something else.
    """
    matrix = IDENTITY
    rest = text
    for found in re.finditer(r"(\w+)\s*\(([^)]*)\)\s*,?", text):
        rest = rest.replace(found[0], "", 1)
        known = _TRANSFORMS.get(found[1])
        values = numbers(found[2])
        if known is None or len(values) not in known[0]:
            raise ValueError(f"cannot read the transform {found[0]!r}")
        matrix = _product(matrix, known[1](*values))
    if rest.strip():
        raise ValueError(f"cannot read the transform {text[:80]!r}")
    return matrix


def _rotation(degrees: float, x: float = 0.0, y: float = 0.0) -> Matrix:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return c, s, -s, c, x - c * x + s * y, y - s * x - c * y


_TRANSFORMS: dict[str, tuple[tuple[int, ...], Callable[..., Matrix]]] = {
    "matrix": ((6,), lambda *v: v),
    "translate": ((1, 2), lambda x, y=0.0: (1.0, 0.0, 0.0, 1.0, x, y)),
    "scale": ((1, 2), lambda x, y=None: (x, 0.0, 0.0, x if y is None else y, 0.0, 0.0)),
    "rotate": ((1, 3), _rotation),
    "skewX": ((1,), lambda a: (1.0, 0.0, math.tan(math.radians(a)), 1.0, 0.0, 0.0)),
    "skewY": ((1,), lambda a: (1.0, math.tan(math.radians(a)), 0.0, 1.0, 0.0, 0.0)),
}


def _product(m: Matrix, n: Matrix) -> Matrix:
    """First n, then m."""
    a, b, c, d, e, f = m
    return (
        a * n[0] + c * n[1], b * n[0] + d * n[1],
        a * n[2] + c * n[3], b * n[2] + d * n[3],
        a * n[4] + c * n[5] + e, b * n[4] + d * n[5] + f,
    )  # fmt: skip


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
