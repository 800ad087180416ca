"""Trucks: a high cab in front, a long box for the load, six wheels."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, box, extrude, line, mirror, polyline, rectangle, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, cab, load, high, wheel = vary(0.36, 0.42), vary(0.46, 0.56), vary(1.2, 1.5), vary(0.72, 0.9), vary(0.17, 0.2)
    floor, front = 0.3, cab
    roof = floor + 0.72
    # The cab's outline from the side has a sloping windscreen.
    side_of_it = [(0, floor), (front, floor), (front, floor + 0.32), (front - 0.16, roof), (0, roof)]
    parts = [extrude(polyline(*((x, -half, z) for x, z in side_of_it), closed=True), (0, 2 * half, 0))]
    parts.append(mirror(rectangle((0.18, half, floor + 0.5), (0.2, 0.24), "y")))
    rear = -load - 0.06
    if "tank" in attributes:
        r = 0.36
        parts += [ring((x, 0, floor + r), r, "x") for x in (-0.06, rear)]
        parts.append(mirror(line((0, 0.7 * half, floor), (rear, 0.7 * half, floor))))
        parts += [
            mirror(line((-0.06, r, floor + r), (rear, r, floor + r))),
            line((-0.06, 0, floor + 2 * r), (rear, 0, floor + 2 * r)),
        ]
    elif "tipping body" in attributes:
        edge = [(-0.06, floor + 0.1), (-0.06, floor + 0.6), (rear - 0.1, floor + 0.6), (rear, floor + 0.1)]
        parts.append(extrude(polyline(*((x, -half, z) for x, z in edge), closed=True), (0, 2 * half, 0)))
    elif "ladder" in attributes:
        parts.append(box((-0.06 - load / 2, 0, floor + 0.25), (load, 2 * half, 0.5)))
        a, b = (-load, 0.0, floor + 0.6), (0.4, 0.0, floor + 1.2)
        parts += [line((a[0], y, a[2]), (b[0], y, b[2])) for y in (-0.12, 0.12)]
        for t in (0.1, 0.3, 0.5, 0.7, 0.9):
            x, z = a[0] + t * (b[0] - a[0]), a[2] + t * (b[2] - a[2])
            parts.append(line((x, -0.12, z), (x, 0.12, z)))
    else:
        parts.append(box((-0.06 - load / 2, 0, floor + 0.06 + high / 2), (load, 2 * half, high)))
    for x in (0.26, -0.62 * load, -0.62 * load - 2.3 * wheel):
        parts.append(mirror(ring((x, half, wheel), wheel, "y")))
    parts.append(mirror(ring((front, 0.7 * half, floor + 0.12), 0.06, "x")))
    return parts


CATEGORY = Category(
    "truck",
    _make,
    synonyms=("lorry", "delivery truck", "moving van", "van"),
    attributes=(
        Attribute("tank", ("with a tank",), nouns=("tanker", "tank truck"), excludes=("tipping body", "ladder")),
        Attribute("tipping body", ("with an open body",), nouns=("dump truck", "tipper"), excludes=("ladder",)),
        Attribute("ladder", ("with a ladder",), nouns=("fire engine", "fire truck", "firetruck")),
    ),
    parts=("wheels", "six wheels", "a cab", "headlights", "windows"),
    metres=7.0,
)
