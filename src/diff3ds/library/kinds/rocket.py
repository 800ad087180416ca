"""Rockets: a turned hull that ends in a point, with fins and a window."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, curve, join, lathe, line, mirror, move, polyline, ring, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    body, base, waist, top = vary(0.3, 0.42), vary(0.18, 0.28), vary(1.04, 1.36), vary(2.01, 2.49)
    span, sweep = vary(0.38, 0.59), vary(0.15, 0.3)
    tail = curve((base, 0, 0), (body, 0, 0.3), (body, 0, 0.8), (body, 0, waist))
    nose = curve((body, 0, waist), (body, 0, waist + 0.4), (0.5 * body, 0, top - 0.25), (0, 0, top))
    parts = [lathe(join(tail, nose), [(base, 0.0), (body, waist)], start=45)]
    fin = polyline((0.85 * body, 0, 0.75), (body + span, 0, 0.2), (body + span, 0, -sweep), (base, 0, 0.05))
    parts.append(turn(around(fin, 4), 45 if "boosters" in attributes else 0))
    parts.append(ring((body, 0, waist - 0.2), 0.13, "x"))
    if "flame" in attributes:
        flame = curve((0.7 * base, 0, -0.05), (1.5 * base, 0, -0.35), (0.2 * base, 0, -0.6), (0, 0, -0.95))
        parts.append(around(flame, 4))
    if "boosters" in attributes:
        tube = join(line((0.15, 0, 0), (0.15, 0, 0.9)), line((0.15, 0, 0.9), (0, 0, 1.2)))
        parts.append(mirror(move(lathe(tube, [(0.15, 0.0), (0.15, 0.9)]), (0, body + 0.15, 0.1))))
    return parts


CATEGORY = Category(
    "rocket",
    _make,
    synonyms=("spaceship", "space rocket", "space ship", "rocket ship"),
    attributes=(
        Attribute("flame", ("with a flame", "flying")),
        Attribute("boosters", ("with boosters",)),
    ),
    parts=(
        "fins",
        "a window",
    ),
    metres=40,
)
