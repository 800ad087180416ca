"""Cakes: one round on another, with icing that runs down, and candles."""

import math
from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, curve, join, lathe, line, mirror, move, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, high = vary(0.8, 0.95), vary(0.5, 0.64)
    parts = [ring((0, 0, 0), 1.25 * r), lathe(line((r, 0, 0.04), (r, 0, high)), [(r, 0.04), (r, high)])]
    drip = high - 0.16
    # Icing hangs down in eight bows, each around an eighth of the cake: a cubic with such handles is on the circle.
    c, handle = math.sqrt(0.5), 4 / 3 * math.tan(math.pi / 16)
    bow = curve(
        (r, 0, drip),
        (r, handle * r, drip - 0.2),
        ((1 + handle) * c * r, (1 - handle) * c * r, drip - 0.2),
        (c * r, c * r, drip),
    )
    parts.append(around(bow, 8))
    top = high
    if "two tiers" in attributes:
        parts.append(
            move(lathe(line((0.6 * r, 0, 0), (0.6 * r, 0, 0.9 * high)), [(0.6 * r, 0.9 * high)]), (0, 0, high))
        )
        parts.append(ring((0, 0, high), 0.6 * r))
        top = 1.9 * high
    if "candles" in attributes:
        stick = join(
            line((0, 0, 0), (0, 0, 0.4)),
            curve((0, 0, 0.42), (0, 0.12, 0.5), (0, 0.02, 0.6), (0, 0, 0.66)),
            curve((0, 0, 0.42), (0, -0.12, 0.5), (0, -0.02, 0.6), (0, 0, 0.66)),
        )
        for x, y in ((0.28, 0.28), (0.28, -0.28), (-0.28, 0.28), (-0.28, -0.28), (0, 0)):
            parts.append(move(stick, (x * r, y * r, top)))
    if "cherries" in attributes:
        parts.append(mirror(ring((0.4 * r, 0.3 * r, top + 0.09), 0.09, "x"), "x", "y"))
    return parts


CATEGORY = Category(
    "cake",
    _make,
    synonyms=("birthday cake", "chocolate cake", "pie"),
    attributes=(
        Attribute("candles", ("with candles", "with burning candles")),
        Attribute("two tiers", ("with two tiers", "two-tier"), nouns=("wedding cake",)),
        Attribute("cherries", ("with cherries", "with strawberries")),
    ),
    parts=("icing", "frosting"),
    metres=0.3,
)
