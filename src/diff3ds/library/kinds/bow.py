"""Bows to shoot with: two limbs, a grip and a string."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    line,
    mirror,
    polyline,
    rectangle,
    sheet,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, bend, thick = vary(1.04, 1.36), vary(0.51, 0.74), vary(0.045, 0.075)
    if "recurve" in attributes:
        tip = 0.7 * bend
        shape = [(0.0, 0.0), (-0.05, 0.4), (1.7 * bend, 0.75), (0.7 * bend, 1.0)]
    else:
        tip = bend
        shape = [(0.0, 0.0), (0.05, 0.55), (0.5 * bend, 0.85), (bend, 1.0)]
    string = tip + 0.55 if "drawn" in attributes else tip
    # The limb's two edges meet at its tip.
    edges = [[(0, y - gap * (z < 1), z * half) for y, z in shape] for gap in (0.0, thick)]
    parts = [mirror(curve(*edge), "z") for edge in edges]
    parts.append(mirror(sheet(*(curve(*edge) for edge in edges)), "z"))
    parts.append(mirror(line((0, tip, half), (0, string, 0)), "z"))
    if "recurve" in attributes:
        curl = [(tip, 1.0), (0.5 * bend, 1.06), (0.3 * bend, 1.1), (0.1 * bend, 1.1)]
        parts.append(mirror(curve(*[(0, y, z * half) for y, z in curl]), "z"))
    parts += [rectangle((0, -thick / 2, 0), (2 * thick, 0.36), "y"), rectangle((0, -thick / 2, 0), (0.1, 0.36), "x")]
    if "arrow" in attributes:
        end, head = string, string - 1.5
        parts.append(line((0, end, 0), (0, head, 0)))
        parts.append(polyline((0, head + 0.18, 0.07), (0, head, 0), (0, head + 0.18, -0.07)))
        for y in (end - 0.05, end - 0.2):
            parts.append(mirror(line((0, y - 0.1, 0), (0, y, 0.1)), "z"))
    return parts


CATEGORY = Category(
    "bow",
    _make,
    synonyms=("longbow", "archery bow"),
    attributes=(
        Attribute("arrow", ("with an arrow",), nouns=("bow and arrow",)),
        Attribute("drawn", ("drawn",)),
        Attribute("recurve", ("recurve",)),
    ),
    parts=("a string",),
    mirror="x",
    metres=1.6,
)
