"""Cupcakes: a pleated paper cup, a swirl of icing in three tiers, a cherry."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, ball, curve, lathe, line, ring, solid


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    base, rim, cup, tier = vary(0.42, 0.5), vary(0.62, 0.72), vary(0.5, 0.6), vary(0.24, 0.3)
    parts = [ring((0, 0, 0), base), ring((0, 0, cup), rim), around(line((base, 0, 0), (rim, 0, cup)), 10)]
    parts.append(solid(lathe(line((base, 0, 0), (rim, 0, cup)), [])))
    low, wide = cup, 1.12 * rim
    for shrink in (0.74, 0.62, 0.05):
        narrow = wide * shrink
        bulge = curve(
            (wide - 0.08, 0, low),
            (1.2 * wide, 0, low + 0.3 * tier),
            (1.05 * wide, 0, low + tier),
            (narrow, 0, low + tier),
        )
        parts += [around(bulge, 4), solid(lathe(bulge, []))]
        if shrink > 0.5:
            parts.append(ring((0, 0, low + tier), narrow))
        low, wide = low + tier, narrow
    if "candle" in attributes:
        parts += [line((0, y, low), (0, y, low + 0.5)) for y in (-0.05, 0.05)]
        parts.append(line((0, -0.05, low + 0.5), (0, 0.05, low + 0.5)))
        parts += [
            curve((0, 0, low + 0.54), (0, 0.12 * s, low + 0.62), (0, 0.06 * s, low + 0.72), (0, 0, low + 0.82))
            for s in (-1, 1)
        ]
    elif "cherry" in attributes:
        parts += [ball((0, 0, low + 0.12), 0.13), *(ring((0, 0, low + 0.12), 0.13, axis) for axis in ("x", "y"))]
        parts.append(curve((0, 0, low + 0.25), (0, 0.02, low + 0.36), (0, 0.1, low + 0.42), (0, 0.18, low + 0.44)))
    return parts


CATEGORY = Category(
    "cupcake",
    _make,
    synonyms=("cup cake", "muffin", "fairy cake"),
    attributes=(
        Attribute("candle", ("with a candle",), excludes=("cherry",)),
        Attribute("cherry", ("with a cherry",)),
    ),
    parts=("icing", "frosting", "a paper cup"),
    mirror="x",
    metres=0.09,
)
