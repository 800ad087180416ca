"""Ice cream in a cone: a waffle cone with crossed lines, scoops on top."""

import math
from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, ball, curve, lathe, line, mirror, polyline, ring, solid


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, long, scoop = vary(0.36, 0.44), vary(1.0, 1.2), vary(1.12, 1.25)
    parts = [ring((0, 0, long), r), ring((0, 0, long - 0.14), r * (long - 0.14) / long)]
    # Narrower, for the lines of the waffle cut across its roundness.
    cone = solid(lathe(line((0, 0, 0), (0.88 * r, 0, long)), []))
    parts += [around(line((0, 0, 0), (r, 0, long)), 6), cone]
    # The waffle: two bands that wind the other way.
    for s in (-1, 1):
        coil = [(r * t * math.cos(s * 4 * t), r * t * math.sin(s * 4 * t), long * t) for t in (0.25, 0.5, 0.75, 1.0)]
        parts.append(polyline(*coil))
    size = scoop * r
    count = 3 if "three scoops" in attributes else 1
    z = long + 0.55 * size
    for _ in range(count):
        parts += [ball((0, 0, z), size), *(ring((0, 0, z), size, axis) for axis in ("x", "y"))]
        z, size = z + 1.25 * size, 0.92 * size
    top = z - 1.25 * size / 0.92 + size / 0.92
    if "cherry" in attributes:
        parts += [
            ring((0, 0, top + 0.1), 0.11, "x"),
            ball((0, 0, top + 0.1), 0.11),
            curve((0, 0, top + 0.21), (0, 0, top + 0.3), (-0.06, 0, top + 0.36), (-0.12, 0, top + 0.38)),
        ]
    if "wafer" in attributes:
        wafer = line((-0.1, 0.09, top - 0.2), (-0.4, 0.09, top + 0.5))
        parts += [
            mirror(wafer),
            *(line((x, -0.09, z), (x, 0.09, z)) for x, z in ((-0.1, top - 0.2), (-0.4, top + 0.5))),
        ]
    return parts


CATEGORY = Category(
    "ice cream",
    _make,
    synonyms=("ice cream cone", "icecream", "ice cream cornet"),
    attributes=(
        Attribute("three scoops", ("with three scoops",)),
        Attribute("cherry", ("with a cherry",)),
        Attribute("wafer", ("with a wafer", "with a flake")),
    ),
    parts=("a cone", "a scoop"),
    metres=0.2,
)
