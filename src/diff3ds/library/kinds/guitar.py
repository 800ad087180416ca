"""Guitars: a waisted body, a neck and strings; electric ones have horns."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    filled,
    join,
    line,
    mirror,
    move,
    polyline,
    rectangle,
    reflect,
    ring,
    sheet,
    smooth,
    solid,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    low, waist, high = vary(0.48, 0.6), vary(0.28, 0.36), vary(0.36, 0.46)
    neck, deep = vary(1.19, 1.51), 0.11
    half = [(0, 0), (0.75 * low, 0.08), (low, 0.42), (waist, 0.85), (high, 1.2), (0.6 * high, 1.42), (0, 1.45)]
    if "electric" in attributes:
        half = [
            (0, 0),
            (0.75 * low, 0.05),
            (low, 0.35),
            (0.85 * waist, 0.8),
            (1.1 * high, 1.35),
            (0.9 * high, 1.4),
            (0.07, 1.1),
        ]
        deep = 0.05
    side = smooth(*[(deep, y, z) for y, z in half])
    front = mirror(side)
    parts = [front, move(front, (-2 * deep, 0, 0)), line((deep, 0, 0), (-deep, 0, 0))]
    half_front = solid(filled(side))
    rear = move(join(side, half_front), (-2 * deep, 0, 0))
    parts.append(mirror(join(half_front, solid(rear), sheet(side, rear))))
    parts.append(mirror(line((deep, low, half[2][1]), (-deep, low, half[2][1]))))
    root, nut = half[-1][1], half[-1][1] + neck - (0.2 if "electric" in attributes else 0.45)
    x = deep + 0.02
    edge = polyline((x, 0.07, root), (x, 0.055, nut), (x, 0.1, nut + 0.05), (x, 0.08, nut + 0.35))
    parts += [mirror(edge), sheet(edge, reflect(edge))]
    parts.append(line((x, -0.08, nut + 0.35), (x, 0.08, nut + 0.35)))
    parts.append(line((x, -0.055, nut), (x, 0.055, nut)))
    bridge = 0.38
    parts.append(rectangle((x, 0, bridge), (0.36, 0.08), "x"))
    parts += [line((x, y, bridge), (x, 0.5 * y, nut + 0.2)) for y in (-0.06, 0.0, 0.06)]
    if "electric" in attributes:
        parts += [rectangle((x, 0, z), (0.3, 0.1), "x") for z in (0.65, 0.9)]
    else:
        parts.append(ring((x, 0, 1.0), 0.16, "x"))
    if "strap" in attributes:
        top = (0, 0.06, nut)
        parts.append(curve((0, 0, 0), (-0.3, 1.4, 0.1), (-0.3, 1.2, 1.6), top))
    return parts


CATEGORY = Category(
    "guitar",
    _make,
    synonyms=("acoustic guitar",),
    attributes=(
        Attribute("electric", ("electric",)),
        Attribute("strap", ("with a strap",)),
    ),
    parts=(
        "strings",
        "a neck",
    ),
    mirror=None,
    metres=1,
)
