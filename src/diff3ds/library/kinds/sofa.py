"""Sofas: a seat and a back between two arms."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    box,
    line,
    mirror,
    polyline,
    smooth,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, deep, arm = vary(0.9, 1.15), vary(0.4, 0.52), vary(0.14, 0.24)
    seat, rest, top = vary(0.38, 0.48), vary(0.62, 0.74), vary(0.9, 1.15)
    if "three seats" in attributes:
        half *= 1.35
    side = [(deep, 0), (deep, seat), (-0.45 * deep, seat), (-0.6 * deep, top), (-deep, top), (-deep, 0)]
    parts = [mirror(polyline(*[(x, half, z) for x, z in side]))]
    parts += [line((x, -half, z), (x, half, z)) for x, z in side]
    parts.append(mirror(box((0.04, half + arm / 2, rest / 2), (2 * deep, arm, rest))))
    seams = (-half / 3, half / 3) if "three seats" in attributes else (0.0,)
    parts += [polyline(*[(x, y, z) for x, z in side[1:4]]) for y in seams]
    if "legs" in attributes:
        parts.append(mirror(line((0.9 * deep, half, 0), (0.95 * deep, half + 0.05, -0.25)), "x", "y"))
    if "cushions" in attributes:
        x, y, z, w = -0.3 * deep, half - 0.34, seat + 0.26, 0.22
        parts.append(
            mirror(smooth((x, y - w, z - w), (x, y + w, z - w), (x, y + w, z + w), (x, y - w, z + w), closed=True))
        )
    return parts


CATEGORY = Category(
    "sofa",
    _make,
    synonyms=("couch", "settee", "loveseat"),
    attributes=(
        Attribute("three seats", ("with three seats", "three-seat", "long")),
        Attribute("legs", ("with legs",)),
        Attribute("cushions", ("with cushions", "with pillows")),
    ),
    parts=(
        "armrests",
        "arms",
        "a back",
    ),
    metres=2,
    carries=0.5,
)
