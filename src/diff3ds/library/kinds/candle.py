"""Candles: a cylinder, a wick and a flame."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    curve,
    join,
    lathe,
    line,
    mirror,
    move,
    ring,
    stretch,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    radius, tall = vary(0.18, 0.27), vary(1.04, 1.36)
    wick = [line((0, 0, tall), (0, 0, tall + 0.14))]
    if "unlit" not in attributes:
        z, high = tall + 0.08, vary(0.47, 0.63)
        side = curve((0, 0, z), (0.28, 0, z + 0.05), (0.12, 0, z + 0.3), (0, 0, z + high))
        wick.append(around(side, 4))
    candle = join(lathe(line((radius, 0, 0), (radius, 0, tall)), [(radius, 0), (radius, tall)]), *wick)
    if "arms" in attributes:
        small = stretch(candle, (0.5, 0.5, 0.6))
        arm = curve((0, 0, 0.45), (0, 0.35, 0.2), (0, 0.7, 0.3), (0, 0.7, 0.7))
        parts = [move(small, (0, 0, 0.9)), mirror(move(small, (0, 0.7, 0.7))), mirror(arm)]
        return [*parts, line((0, 0, 0), (0, 0, 0.9)), lathe(line((0.4, 0, 0), (0.05, 0, 0.12)), [(0.4, 0.0)])]
    parts = [candle]
    if "holder" in attributes:
        parts += [ring((0, 0, 0.08), 0.62), ring((0, 0, 0), 0.45), ring((0, 0, 0.3), 1.25 * radius)]
        parts.append(around(line((1.25 * radius, 0, 0.3), (1.25 * radius, 0, 0.02)), 4))
        parts.append(ring((0, 0.8, 0.16), 0.18, "x"))
    return parts


CATEGORY = Category(
    "candle",
    _make,
    attributes=(
        Attribute("unlit", ("without a flame", "unlit")),
        Attribute("holder", ("with a holder", "with a candle holder"), excludes=("arms",)),
        Attribute("arms", ("with three arms",), nouns=("candelabra", "candelabrum")),
    ),
    parts=("a wick",),
    mirror="x",
    metres=0.2,
)
