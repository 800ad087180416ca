"""Chairs: a seat on four legs with a back; stools and rocking chairs too."""

import math
from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, between, box, curve, line, mirror, ring, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, deep, seat = vary(0.41, 0.57), vary(0.41, 0.57), vary(0.79, 1.11)
    top = seat + (vary(1.51, 1.99) if "high back" in attributes else vary(0.78, 1.18))
    lean = vary(0.08, 0.18)
    if "stool" in attributes:
        foot, height = 0.8 * half, 1.2 * seat
        legs = [
            around(turn(line((0.6 * foot, 0, height), (1.1 * foot, 0, 0)), 45), 4),
            ring((0, 0, 0.35 * height), 0.925 * foot),
        ]
        return [between(ring((0, 0, height), foot), ring((0, 0, height + 0.1), foot)), *legs]
    parts = [box((0, 0, seat), (2 * deep, 2 * half, 0.08)), mirror(line((deep, half, seat), (deep, half, 0)))]
    parts.append(mirror(line((-deep, half, seat), (-deep, half, 0))))
    parts.append(mirror(line((-deep, half, seat), (-deep - lean, half, top))))
    for share in (0.35, 0.65, 1.0):
        x, z = -deep - lean * share, seat + (top - seat) * share
        parts.append(curve((x, -half, z), (x - 0.08, -half / 3, z), (x - 0.08, half / 3, z), (x, half, z)))
    if "armrests" in attributes:
        x, z, share = 0.6 * deep, seat + 0.42, 0.42 / (top - seat)
        arm = curve((-deep - lean * share, half, z), (0, half, z + 0.06), (x, half, z + 0.04), (deep, half, z - 0.02))
        parts.append(mirror(arm))
        parts.append(mirror(line((x, half, seat), (x, half, z + 0.015))))
    if "rocking" in attributes:
        radius = 1.7
        middle = math.sqrt(radius**2 - deep**2)
        parts.append(mirror(ring((0, half, middle), radius, "y", 270 - 32, 270 + 28)))
    return parts


CATEGORY = Category(
    "chair",
    _make,
    synonyms=("seat",),
    attributes=(
        Attribute("armrests", ("with armrests", "with arms"), nouns=("armchair",)),
        Attribute("high back", ("with a high back", "high-backed", "high-back"), excludes=("stool",)),
        Attribute("stool", ("without a back",), nouns=("stool", "bar stool"), excludes=("armrests", "rocking")),
        Attribute("rocking", ("rocking", "with rockers"), nouns=("rocker",)),
    ),
    parts=(
        "legs",
        "four legs",
        "a seat",
    ),
    metres=0.95,
    carries=0.5,
    faces="table",
)
