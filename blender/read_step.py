# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the curves of STEP files: lines, polylines, circles, ellipses and B-splines up to degree 3, in sets of curves.

Bodies, and curves on them, are left out: diff3ds draws these.
"""

import math
import re
from itertools import pairwise
from pathlib import Path

from .strokes import MOST_BYTES, MOST_STROKES, Stroke, Strokes, raised

# A text, a reference, a number, a word, a letter between dots, or a sign.
_TOKEN = re.compile(
    r"\s+|/\*.*?\*/|(?P<text>'(?:[^']|'')*')|(?P<ref>\#\d+)|(?P<number>[-+]?\d+\.?\d*(?:[Ee][-+]?\d+)?)"
    r"|(?P<word>[A-Za-z_]\w*)|(?P<flag>\.\w+\.)|(?P<sign>[(),*$=;])",
    re.S,
)
_ENTITY = re.compile(r"#(\d+)\s*=\s*((?:'(?:[^']|'')*'|[^';])*);", re.S)
# Lists within lists that a file may have, and curves within curves.
_DEEPEST = 32
# Widths where a file says none: of the picture's height.
_WIDTH = 0.006


class _File:
    """The entities of a file, each of which is read when it is asked for."""

    def __init__(self, text: str) -> None:
        self.texts = {int(found[1]): found[2] for found in _ENTITY.finditer(text)}
        self.read: dict = {}

    def __getitem__(self, number: int) -> dict:
        """The parts of an entity by their names, each with its arguments."""
        if number not in self.read:
            if number not in self.texts:
                raise ValueError(f"#{number} is not in the file")
            self.read[number] = _parts(self.texts[number])
        return self.read[number]

    def of(self, word: str) -> list:
        """The numbers of the entities that have a part of this name."""
        return [number for number, text in self.texts.items() if word in text and word in self[number]]


def read_step(path: str) -> Strokes:
    """Reads a file; a unit of it is a Blender unit.

    Raises:
        ValueError: it is larger than 256 MiB, or no such file, or broken.
        OSError: it cannot be read.
    """
    where = Path(path)
    if where.stat().st_size > MOST_BYTES:
        raise ValueError(f"{where.name} is larger than {MOST_BYTES >> 20} MiB")
    text = where.read_text(encoding="latin-1")
    if not text.lstrip().startswith("ISO-10303-21"):
        raise ValueError(f"{where.name} is no STEP file")
    file = _File(text)
    looks = _looks(file)
    strokes, left = [], 0
    for number in _members(file):
        try:
            cubics = _cubics(file, number, 0)
        except (KeyError, IndexError, TypeError, AttributeError, ZeroDivisionError, OverflowError):
            cubics = []
        if not cubics:
            left += 1
            continue
        color, width = looks.get(number, ((0.0, 0.0, 0.0), _WIDTH))
        name = next((args[0] for args in file[number].values() if args and isinstance(args[0], str)), "")
        closed = math.dist(cubics[0][0][:3], cubics[-1][3][:3]) < 1e-9
        strokes.append(Stroke(name, "", cubics, [[width] * 4 for _ in cubics], color, 1.0, closed))
    return Strokes(strokes, True, f"{left} curves of other kinds were left out" if left else "")


def _members(file: _File) -> list:
    """The curves that are not parts of others, each once."""
    numbers = [
        member
        for word in ("GEOMETRIC_CURVE_SET", "GEOMETRIC_SET")
        for each in file.of(word)
        for member in _numbers_of(file[each][word][1])
    ]
    if len(numbers) > MOST_STROKES:
        raise ValueError(f"the file has more than {MOST_STROKES} curves")
    return list(dict.fromkeys(numbers))


def _numbers_of(values: list) -> list:
    return [value[1] for value in values if isinstance(value, tuple)]


def _looks(file: _File) -> dict:
    """Colours and widths of styled curves."""
    found = {}
    for each in file.of("STYLED_ITEM"):
        try:
            _, styles, item = file[each]["STYLED_ITEM"][:3]
            assigned = file[styles[0][1]]["PRESENTATION_STYLE_ASSIGNMENT"][0]
            style = file[assigned[0][1]]["CURVE_STYLE"]
            color = tuple(min(max(float(v), 0.0), 1.0) for v in file[style[3][1]]["COLOUR_RGB"][1:4])
            width = next((v for v in style if isinstance(v, float)), _WIDTH)
            found[item[1]] = (color, width)
        except (KeyError, IndexError, TypeError, ValueError):
            continue
    return found


def _cubics(file: _File, number: int, depth: int) -> list:
    """A curve as rational cubics; none where it is of another kind."""
    if depth > _DEEPEST:
        raise ValueError("curves lie too deep in each other")
    parts = file[number]
    if "TRIMMED_CURVE" in parts:
        _, base, start, stop, same = parts["TRIMMED_CURVE"][:5]
        return _trimmed(file, base[1], _limit(start), _limit(stop), same == ".T.", depth)
    if "CIRCLE" in parts or "ELLIPSE" in parts:
        return _arc(file, parts, 0.0, 2 * math.pi)
    if "POLYLINE" in parts:
        corners = [_triple(file, corner) for corner in _numbers_of(parts["POLYLINE"][1])]
        return [_line(a, b) for a, b in pairwise(corners)]
    if "COMPOSITE_CURVE" in parts:
        found = []
        for segment in _numbers_of(parts["COMPOSITE_CURVE"][1]):
            _, same, inner = file[segment]["COMPOSITE_CURVE_SEGMENT"][:3]
            some = _cubics(file, inner[1], depth + 1)
            found += some if same == ".T." else [cubic[::-1] for cubic in reversed(some)]
        return found
    return _spline(file, parts)


def _limit(values: list) -> object:
    """What trims a curve: a parameter, or else a point."""
    numbers = [value for value in values if isinstance(value, float)]
    return numbers[0] if numbers else _numbers_of(values)[0]


def _trimmed(file: _File, base: int, start: object, stop: object, same: bool, depth: int) -> list:
    parts = file[base]
    if "LINE" in parts:
        _, point, vector = parts["LINE"][:3]
        origin, (_, direction, length) = _triple(file, point[1]), file[vector[1]]["VECTOR"][:3]
        along = [length * value for value in _triple(file, direction[1], unit=True)]
        ends = [
            [o + end * a for o, a in zip(origin, along, strict=True)] if isinstance(end, float) else _triple(file, end)
            for end in (start, stop)
        ]
        return [_line(*ends)]
    if "CIRCLE" in parts or "ELLIPSE" in parts:
        first, last = (_angle(file, parts, end) for end in (start, stop))
        if not same:
            return [cubic[::-1] for cubic in reversed(_arc(file, parts, last, _after(first, last)))]
        return _arc(file, parts, first, _after(last, first))
    if not isinstance(start, float) or not isinstance(stop, float):
        return []
    cubics, knots = _spline(file, parts), _distinct_knots(parts)
    # Splines are taken whole, as those who write them trim them.
    if cubics and max(abs(min(start, stop) - knots[0]), abs(max(start, stop) - knots[-1])) > 1e-9 * (
        1 + abs(knots[-1])
    ):
        return []
    return cubics if same else [cubic[::-1] for cubic in reversed(cubics)]


def _after(angle: float, other: float) -> float:
    """The same angle, more than another by up to a turn."""
    return other + ((angle - other) % (2 * math.pi) or 2 * math.pi)


def _line(a: list, b: list) -> list:
    return raised([(*a, 1.0), (*b, 1.0)])


def _angle(file: _File, parts: dict, end: object) -> float:
    if isinstance(end, float):
        return end
    center, major, minor = _axes(file, parts)
    away = [a - b for a, b in zip(_triple(file, end), center, strict=True)]
    along = [sum(a * b for a, b in zip(away, axis, strict=True)) / sum(a * a for a in axis) for axis in (major, minor)]
    return math.atan2(along[1], along[0])


def _axes(file: _File, parts: dict) -> tuple:
    """Centre, and the two half axes as vectors."""
    arguments = parts.get("CIRCLE") or parts["ELLIPSE"]
    radii = [value for value in arguments[1:] if isinstance(value, float)]
    place = file[arguments[1][1]]["AXIS2_PLACEMENT_3D"]
    center = _triple(file, place[1][1])
    axis = _triple(file, place[2][1], unit=True) if isinstance(place[2], tuple) else [0.0, 0.0, 1.0]
    toward = _triple(file, place[3][1], unit=True) if isinstance(place[3], tuple) else _across(axis)
    lean = sum(a * b for a, b in zip(axis, toward, strict=True))
    x = [t - lean * a for t, a in zip(toward, axis, strict=True)]
    size = math.hypot(*x)
    x = [value / size for value in x]
    y = [axis[i - 2] * x[i - 1] - axis[i - 1] * x[i - 2] for i in range(3)]
    return center, [radii[0] * value for value in x], [radii[-1] * value for value in y]


def _across(axis: list) -> list:
    return [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0]


def _arc(file: _File, parts: dict, start: float, stop: float) -> list:
    """Arcs of at most a quarter turn, as rational quadratics raised to cubics."""
    center, major, minor = _axes(file, parts)
    count = max(math.ceil((stop - start) / (math.pi / 2) - 1e-9), 1)
    half = (stop - start) / count / 2

    def at(angle: float, far: float = 1.0) -> list:
        c, s = far * math.cos(angle), far * math.sin(angle)
        return [o + c * a + s * b for o, a, b in zip(center, major, minor, strict=True)]

    found = []
    for n in range(count):
        angle, weight = start + 2 * n * half, math.cos(half)
        ends = (*at(angle), 1.0), (*at(angle + half, 1 / weight), weight), (*at(angle + 2 * half), 1.0)
        found.append(raised(list(ends)))
    return found


def _distinct_knots(parts: dict) -> list:
    return parts["B_SPLINE_CURVE_WITH_KNOTS"][-2 if len(parts) == 1 else 1]


def _spline(file: _File, parts: dict) -> list:
    """A B-spline whose ends are its control points, by knots put in until each part is a Bézier curve."""
    if "B_SPLINE_CURVE_WITH_KNOTS" not in parts:
        return []
    given = parts["B_SPLINE_CURVE_WITH_KNOTS"]
    if "B_SPLINE_CURVE" in parts:
        degree, points = parts["B_SPLINE_CURVE"][:2]
        counts, distinct = given[:2]
    else:
        degree, points, counts, distinct = given[1], given[2], given[-3], given[-2]
    weights = parts.get("RATIONAL_B_SPLINE_CURVE", [[1.0] * len(points)])[0]
    degree, places = int(degree), [_triple(file, number) for number in _numbers_of(points)]
    knots = [knot for knot, count in zip(distinct, counts, strict=True) for _ in range(int(count))]
    if not 1 <= degree <= 3 or len(knots) != len(places) + degree + 1 or min(weights) <= 0:
        return []
    if counts[0] != degree + 1 or counts[-1] != degree + 1:
        return []
    rows = [[*(v * w for v in place), w] for place, w in zip(places, weights, strict=True)]
    for knot, count in list(zip(distinct, counts, strict=True))[1:-1]:
        for _ in range(degree - int(count)):
            knots, rows = _with_knot(knots, rows, degree, knot)
    found = []
    for first in range(0, len(rows) - 1, degree):
        some = rows[first : first + degree + 1]
        found.append(raised([(*(v / row[3] for v in row[:3]), row[3]) for row in some]))
    return found


def _with_knot(knots: list, rows: list, degree: int, knot: float) -> tuple:
    """A knot more, by Boehm's rule."""
    span = max(i for i in range(len(knots) - 1) if knots[i] <= knot < knots[i + 1])
    new = rows[: span - degree + 1]
    for i in range(span - degree + 1, span + 1):
        share = (knot - knots[i]) / (knots[i + degree] - knots[i])
        if share > 0 or i <= span - _times(knots, knot):
            new.append([(1 - share) * a + share * b for a, b in zip(rows[i - 1], rows[i], strict=True)])
        else:
            new.append(rows[i - 1])
    return [*knots[: span + 1], knot, *knots[span + 1 :]], [*new, *rows[span:]]


def _times(knots: list, knot: float) -> int:
    return sum(each == knot for each in knots)


def _triple(file: _File, number: int, unit: bool = False) -> list:
    """The three numbers of a point or a direction; of a direction as a unit vector."""
    parts = file[number]
    values = [float(value) for value in (parts.get("CARTESIAN_POINT") or parts["DIRECTION"])[1]]
    if len(values) != 3 or not all(abs(value) < 1e30 for value in values):
        raise ValueError(f"#{number} has no three finite numbers")
    size = math.hypot(*values) if unit else 1.0
    return [value / size for value in values]


def _parts(text: str) -> dict:
    """The parts of an entity: NAME(...), or several of these in brackets."""
    tokens, at = [], 0
    while at < len(text):
        found = _TOKEN.match(text, at)
        if not found:
            raise ValueError(f"the file is broken at {text[at : at + 20]!r}")
        at = found.end()
        if found.lastgroup:
            tokens.append((found.lastgroup, found[0]))
    tokens.reverse()
    parts: dict = {}
    if tokens and tokens[-1][1] == "(":
        tokens.pop()
    while tokens and tokens[-1][0] == "word":
        name = tokens.pop()[1].upper()
        parts[name] = _list(tokens, 0)
    return parts


def _list(tokens: list, depth: int) -> list:
    """The values in brackets."""
    if depth > _DEEPEST or not tokens or tokens.pop()[1] != "(":
        raise ValueError("the file is broken: brackets are missing, or too many")
    values: list = []
    while tokens:
        kind, text = tokens[-1]
        if text == "(":
            values.append(_list(tokens, depth + 1))
            continue
        tokens.pop()
        if text == ")":
            return values
        if kind == "ref":
            values.append(("#", int(text[1:])))
        elif kind == "number":
            values.append(float(text))
        elif kind == "text":
            values.append(text[1:-1].replace("''", "'"))
        elif kind == "word":
            # A value with its kind, such as PARAMETER_VALUE(0.5).
            values += _list(tokens, depth + 1)
        elif text != ",":
            values.append(text if kind == "flag" else None)
    raise ValueError("the file is broken: a bracket is missing")
