"""The outlines of SVG elements as contours of lines, quadratics and cubics."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from diff3ds.svg.path_data import add_path_data, number

Point = tuple[float, float]
# Commands of one element: 100,000 take seconds in a browser as well.
MOST_COMMANDS = 1_000_000
# Units of the file. Ends that lie closer are one: what files round.
SAME = 1e-5


@dataclass
class Contour:
    """Segments, each beginning where the last one ends; a closed contour does not say its first point again.

    Attributes:
        points: ends and control points in their order.
        inner: control points between the ends of each segment: 0 of a line, 1 of a quadratic, 2 of a cubic.
    """

    points: list[Point]
    inner: list[int] = field(default_factory=list)
    closed: bool = False


def contours_of(tag: str, attributes: dict[str, str]) -> list[Contour]:
    """The contours of an element that draws: path, rect, circle, ellipse, line, polyline or polygon.

    Raises:
        ValueError: what is no path data or no number.
    """
    drawn = _Drawn()
    add_path_data(drawn, as_path_data(tag, attributes), MOST_COMMANDS)
    for contour in drawn.found:
        if not contour.closed and len(contour.inner) > 1 and math.dist(contour.points[0], contour.points[-1]) < SAME:
            contour.points.pop()
            contour.closed = True
    return drawn.found


class _Drawn:
    """Takes what a pen draws, with the names that pathops has."""

    def __init__(self) -> None:
        self.found: list[Contour] = []

    def moveTo(self, x: float, y: float) -> None:  # noqa: N802
        self.found.append(Contour([(x, y)]))

    def lineTo(self, *values: float) -> None:  # noqa: N802
        self._add(*values)

    def quadTo(self, *values: float) -> None:  # noqa: N802
        self._add(*values)

    def cubicTo(self, *values: float) -> None:  # noqa: N802
        self._add(*values)

    def arcTo(self, rx: float, ry: float, turn: float, large: int, back: int, x: float, y: float) -> None:  # noqa: N802
        for cubic in _arc(self.found[-1].points[-1], (x, y), (rx, ry), math.radians(turn), bool(large), not back):
            self._add(*cubic)

    def close(self) -> None:
        contour = self.found[-1]
        if len(contour.points) > 1 and math.dist(contour.points[0], contour.points[-1]) < SAME:
            contour.points.pop()
        else:
            contour.inner.append(0)
        contour.closed = True

    def _add(self, *values: float) -> None:
        contour = self.found[-1]
        contour.points += zip(values[::2], values[1::2], strict=True)
        contour.inner.append(len(values) // 2 - 1)


def _arc(start: Point, end: Point, radii: Point, turn: float, large: bool, rising: bool) -> Iterator[tuple[float, ...]]:
    """An elliptic arc as cubics, each of a quarter at most; the notes on implementing arcs of SVG 1.1 (F.6)."""
    c, s = math.cos(turn), math.sin(turn)
    half = ((start[0] - end[0]) / 2, (start[1] - end[1]) / 2)
    x, y = c * half[0] + s * half[1], -s * half[0] + c * half[1]
    # Radii that are too small to reach are grown.
    grown = math.sqrt(max((x / radii[0]) ** 2 + (y / radii[1]) ** 2, 1.0))
    rx, ry = radii[0] * grown, radii[1] * grown
    reach = (x / rx) ** 2 + (y / ry) ** 2
    far = math.sqrt(max(1 / reach - 1, 0.0)) * (-1 if large == rising else 1)
    u, v = far * y / ry, -far * x / rx
    first = math.atan2(y / ry - v, x / rx - u)
    swept = (math.atan2(-y / ry - v, -x / rx - u) - first) % (2 * math.pi)
    swept -= 0 if rising else 2 * math.pi
    parts = max(1, math.ceil(abs(swept) / (math.pi / 2) - 1e-9))
    step = swept / parts
    handle = 4 / 3 * math.tan(step / 4)
    middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2

    def place(p: float, q: float) -> Point:
        p, q = rx * (p + u), ry * (q + v)
        return middle[0] + c * p - s * q, middle[1] + s * p + c * q

    for k in range(parts):
        a, b = first + k * step, first + (k + 1) * step
        p, q, r, t = math.cos(a), math.sin(a), math.cos(b), math.sin(b)
        last = end if k == parts - 1 else place(r, t)
        yield (*place(p - handle * q, q + handle * p), *place(r + handle * t, t - handle * r), *last)


def as_path_data(tag: str, attributes: dict[str, str]) -> str:
    """Path data of an element that draws; empty if there is nothing of it."""

    def value(name: str, default: float = 0.0) -> float:
        return number(attributes[name]) if name in attributes else default

    if tag == "path":
        return attributes.get("d", "")
    if tag in ("polygon", "polyline"):
        end = "Z" if tag == "polygon" else ""
        return "M" + attributes["points"] + end if attributes.get("points", "").strip() else ""
    if tag == "line":
        return f"M{value('x1')},{value('y1')}L{value('x2')},{value('y2')}"
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
