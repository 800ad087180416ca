"""Swords: a blade with a ridge, a guard, a grip and a pommel."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    lathe,
    line,
    mirror,
    polyline,
    rectangle,
    ring,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, long, guard, grip = vary(0.09, 0.14), vary(1.51, 1.99), vary(0.27, 0.43), vary(0.34, 0.46)
    if "two-handed" in attributes:
        long, grip, wide, guard = 1.1 * long, 2.2 * grip, 1.5 * wide, 1.6 * guard
    if "curved" in attributes:
        edge = curve((0, wide, 0), (0, 1.6 * wide, 0.5 * long), (0, 0.1, 0.8 * long), (0, -0.5, long))
        back = curve((0, -wide, 0), (0, -0.5 * wide, 0.5 * long), (0, -0.15, 0.75 * long), (0, -0.5, long))
        parts = [edge, back]
    else:
        tip, neck = (0, 0, long), long - 0.22
        parts = [mirror(polyline((0, wide, 0), (0, 0.85 * wide, neck), tip))]
        parts.append(mirror(polyline((0.035, 0, 0), (0.03, 0, neck), tip), "x"))
    hilt = polyline((0, -guard, -0.06), (0, guard, -0.06), (0, guard, 0), (0, -guard, 0), closed=True)
    parts.append(hilt)
    parts.append(rectangle((0, 0, -0.03), (0.14, 2 * wide)))
    parts.append(lathe(line((0.05, 0, -0.06), (0.045, 0, -grip)), [(0.045, -grip)]))
    parts += [ring((0, 0, -grip - 0.08), 0.08, axis) for axis in ("x", "y")]
    if "knuckle guard" in attributes:
        bow = curve((0, guard, -0.03), (0, guard + 0.08, -0.2), (0, guard, -grip), (0, 0.08, -grip - 0.05))
        parts.append(bow)
    return parts


CATEGORY = Category(
    "sword",
    _make,
    attributes=(
        Attribute("curved", ("curved", "with a curved blade"), nouns=("sabre", "saber"), excludes=("two-handed",)),
        Attribute("two-handed", ("two-handed", "with a long grip"), nouns=("greatsword",), excludes=("knuckle guard",)),
        Attribute("knuckle guard", ("with a knuckle guard",)),
    ),
    parts=(
        "a hilt",
        "a blade",
    ),
    mirror="x",
    metres=1.1,
)
