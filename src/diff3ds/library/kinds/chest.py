"""Treasure chests: a box with a vaulted lid, bands of iron and a lock."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    box,
    ellipse,
    filled,
    join,
    line,
    mirror,
    move,
    rectangle,
    ring,
    sheet,
    solid,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, deep, high, vault = vary(0.85, 1.0), vary(0.5, 0.62), vary(0.6, 0.72), vary(0.34, 0.46)
    parts = [box((0, 0, high / 2), (2 * deep, 2 * wide, high))]
    arc = ellipse((0, 0, high), (deep, 0, 0), (0, 0, vault), 0, 180)
    lid = join(*(move(arc, (0, y, 0)) for y in (-wide, -0.6 * wide, 0.6 * wide, wide)))
    lid = join(lid, line((0, -wide, high + vault), (0, wide, high + vault)))
    # The vault, and what closes it at both sides.
    ends = move(arc, (0, -wide, 0)), move(arc, (0, wide, 0))
    lid = join(lid, sheet(*ends), *(solid(filled(end)) for end in ends))
    if "open" in attributes:
        edge = line((deep, -wide, high), (deep, wide, high))
        parts.append(turn(join(lid, edge), 62, "y", (-deep, 0, high)))
        for y, r in ((-0.5, 0.14), (0, 0.17), (0.5, 0.14)):
            parts.append(ring((0, y * wide, high + 0.05), r, "x"))
    else:
        parts.append(lid)
    parts.append(mirror(line((deep, 0.6 * wide, 0), (deep, 0.6 * wide, high))))
    parts.append(rectangle((deep, 0, high - 0.08), (0.22, 0.26), "x"))
    parts.append(ring((deep, 0, high - 0.08), 0.045, "x"))
    return parts


CATEGORY = Category(
    "treasure chest",
    _make,
    synonyms=("chest", "pirate chest", "treasure"),
    attributes=(
        Attribute(
            "open",
            ("open", "with treasure", "full"),
            nouns=("treasure chest full of gold", "chest full of gold", "chest of gold"),
        ),
    ),
    parts=("a lock", "a lid"),
    metres=0.9,
)
