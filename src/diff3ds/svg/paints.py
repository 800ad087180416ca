"""Colours and gradients of SVG files."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from diff3ds.svg.matrices import Matrix, parse_transform, product
from diff3ds.svg.path_data import number

RGBA = tuple[float, float, float, float]
_FUNCTION = re.compile(r"rgba?\(\s*([^)]*)\)")
_URL = re.compile(r"url\(\s*['\"]?#([^'\")]*)['\"]?\s*\)\s*(.*)", re.DOTALL)
# Gradients that take their stops from others, one after the other.
LONGEST_CHAIN = 32


@dataclass(frozen=True)
class Gradient:
    """Colours along a line or outwards from a centre.

    Attributes:
        linear: or radial.
        ends: begin and end of a linear one, centre and radii of a radial one, on the canvas.
        offsets: of the stops, in [0, 1], rising.
        colors: of the stops, straight RGBA.
    """

    linear: bool
    ends: tuple[float, float, float, float]
    offsets: tuple[float, ...]
    colors: tuple[RGBA, ...]


Paint = RGBA | Gradient


def parse_color(text: str) -> RGBA | None:
    """A colour; None for none.

    Raises:
        ValueError: text that is no colour.
    """
    from PIL import ImageColor

    text = text.strip().lower()
    if text in ("none", "transparent"):
        return None
    function = _FUNCTION.fullmatch(text)
    if not function:
        known = (*ImageColor.getrgb(text), 255)
        return known[0] / 255, known[1] / 255, known[2] / 255, known[3] / 255
    parts = [part for part in re.split(r"[\s,/]+", function[1]) if part]
    if len(parts) not in (3, 4):
        raise ValueError(f"cannot read the colour {text[:40]!r}")
    red, green, blue = (_share(part, 255) for part in parts[:3])
    return red, green, blue, _share(parts[3], 1) if len(parts) == 4 else 1.0


def reference(text: str) -> tuple[str, str] | None:
    """The id that a paint refers to, and what stands for it where that is missing; None if it does not refer."""
    found = _URL.fullmatch(text.strip())
    return (found[1], found[2].strip()) if found else None


def faded(paint: Paint, opacity: float) -> Paint:
    """A paint with its alpha times an opacity."""
    if isinstance(paint, Gradient):
        colors = tuple((r, g, b, a * opacity) for r, g, b, a in paint.colors)
        return Gradient(paint.linear, paint.ends, paint.offsets, colors)
    return paint[0], paint[1], paint[2], paint[3] * opacity


def opacity_of(text: str) -> float:
    """An opacity, a number or a percentage, within [0, 1]."""
    return _share(text, 1)


def _share(text: str, whole: float) -> float:
    value = number(text[:-1]) / 100 if text.strip().endswith("%") else number(text) / whole
    return min(max(value, 0.0), 1.0)


def placed_gradient(
    linear: bool,
    values: Mapping[str, str],
    matrix: Matrix,
    box: tuple[float, float, float, float],
    length: Callable[[str, str], float],
    stops: list[tuple[float, RGBA]],
) -> tuple[Gradient, list[str]]:
    """A gradient on the canvas.

    Args:
        values: its attributes, its own and those of gradients that it refers to.
        matrix: of the element that it paints.
        box: x, y, width and height of that element, in its own coordinates.
        length: of a text, along "x", "y" or neither (""), in user units.
        stops: offsets and colours.

    Returns:
        The gradient, and what it could not have.
    """
    of_box = values.get("gradientUnits", "objectBoundingBox") != "userSpaceOnUse"
    if of_box:
        matrix = product(matrix, (box[2], 0.0, 0.0, box[3], box[0], box[1]))
    matrix = product(matrix, parse_transform(values.get("gradientTransform", "")))

    def value(name: str, otherwise: str, along: str) -> float:
        text = values.get(name, otherwise)
        return _plain(text) if of_box else length(text, along)

    lacks = [f"spreadMethod={values['spreadMethod']!r}"] if values.get("spreadMethod", "pad") != "pad" else []
    offsets, colors = zip(*_rising(stops), strict=True)
    if linear:
        begin = value("x1", "0%", "x"), value("y1", "0%", "y")
        end = value("x2", "100%", "x"), value("y2", "0%", "y")
        return Gradient(True, _line(matrix, begin, end), offsets, colors), lacks
    center, radius = (value("cx", "50%", "x"), value("cy", "50%", "y")), value("r", "50%", "")
    focus = value("fx", str(center[0]), "x"), value("fy", str(center[1]), "y")
    if math.dist(focus, center) > 1e-3 * radius:
        lacks.append("the focus of a radial gradient beside its centre")
    a, b, c, d, e, f = product(matrix, (radius, 0.0, 0.0, radius, center[0], center[1]))
    rx, ry = math.hypot(a, c), math.hypot(b, d)
    if abs(a * b + c * d) > 1e-3 * rx * ry:
        lacks.append("the slant of a radial gradient")
    return Gradient(False, (e, f, rx, ry), offsets, colors), lacks


def _plain(text: str) -> float:
    return number(text[:-1]) / 100 if text.endswith("%") else number(text)


def _rising(stops: list[tuple[float, RGBA]]) -> list[tuple[float, RGBA]]:
    """Stops whose offsets do not fall: each is at least that before it."""
    risen, last = [], 0.0
    for offset, color in stops:
        last = max(last, offset)
        risen.append((last, color))
    return risen


def _line(m: Matrix, begin: tuple[float, float], end: tuple[float, float]) -> tuple[float, float, float, float]:
    """A linear gradient after a transform: its axis stays at right angles to lines of one colour."""
    a, b, c, d, e, f = m
    x, y = end[0] - begin[0], end[1] - begin[1]
    start = a * begin[0] + c * begin[1] + e, b * begin[0] + d * begin[1] + f
    # A step along a line of one colour, (-y, x), after the transform; what is square to it leads to the last colour.
    p, q = -(b * -y + d * x), a * -y + c * x
    square = p * p + q * q
    reach = ((a * x + c * y) * p + (b * x + d * y) * q) / square if square > 0 else 0.0
    return *start, start[0] + reach * p, start[1] + reach * q
