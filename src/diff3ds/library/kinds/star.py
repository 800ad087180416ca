"""Stars with five points, raised in the middle before and behind."""

import math
from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, filled, line, polyline, solid


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    inner, deep = vary(0.38, 0.46), vary(0.2, 0.32)
    count = 6 if "six points" in attributes else 5
    corners = []
    for i in range(2 * count):
        angle, r = math.pi * i / count, inner if i % 2 else 1.0
        if count == 6 and i % 2:
            r = 0.577 + 0.3 * (inner - 0.42)
        corners.append((0.0, r * math.sin(angle), r * math.cos(angle)))
    parts = [polyline(*corners, closed=True)]
    for x in (-deep, deep):
        parts += [line((x, 0, 0), corner) for corner in corners]
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True):
            parts.append(solid(filled(polyline((x, 0, 0), a, b, closed=True))))
    if "tail" in attributes:
        for y, z in ((-0.3, -0.72), (-0.62, -0.34), (-0.95, 0.1)):
            parts.append(curve((0, y - 0.1, z), (0, y - 0.5, z - 0.1), (0, y - 0.9, z - 0.4), (0, y - 1.1, z - 0.8)))
    return parts


CATEGORY = Category(
    "star",
    _make,
    synonyms=("Christmas star",),
    attributes=(
        Attribute("six points", ("with six points", "six-pointed")),
        Attribute("tail", ("with a tail", "shooting", "falling"), nouns=("comet",)),
    ),
    mirror="x",
    metres=0.3,
    aloft=True,
)
