"""Campfires: logs that lean together, flames, and stones around."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    ball,
    curve,
    ellipse,
    flesh,
    join,
    lathe,
    line,
    mirror,
    ring,
    solid,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    reach, high, wide = vary(0.62, 0.75), vary(1.0, 1.25), vary(0.26, 0.34)
    sides = line((reach, -0.07, 0), (0.05, -0.04, 0.34)), line((reach, 0.07, 0), (0.05, 0.04, 0.34))
    log = join(*sides, ring((reach, 0, 0), 0.07, "x"), flesh(*sides, 0.07, 0.04))
    parts = [around(log, 5)]
    # Two flames across each other, an outer and an inner one.
    for size in (1.0, 0.55):
        w, h = wide * size, high * size
        tongue = curve((0, 0, 0.16), (0, 2.2 * w, 0.2), (0, 1.2 * w, 0.5 * h), (0, 0, h + 0.1))
        parts.append(mirror(tongue))
        parts.append(turn(mirror(tongue), 90))
    if "stones" in attributes:
        stone = join(ellipse((1.0, 0, 0.06), (0, 0.17, 0), (0, 0, 0.12)), ball((1.0, 0, 0.06), (0.08, 0.17, 0.12)))
        parts.append(around(stone, 8))
    if "pot" in attributes:
        top = high + 0.5
        parts += [line((0, s * 1.0, 0), (0, 0, top + 0.4)) for s in (-1, 1)]
        parts += [ring((0, 0, top - 0.1), 0.26), ellipse((0, 0, top - 0.1), (0, 0.26, 0), (0, 0, 0.3), 180, 360)]
        parts.append(ellipse((0, 0, top - 0.1), (0.26, 0, 0), (0, 0, 0.3), 180, 360))
        parts.append(line((0, 0, top + 0.4), (0, 0, top - 0.1)))
        parts.append(solid(lathe(ellipse((0, 0, top - 0.1), (0.26, 0, 0), (0, 0, 0.3), 270, 360), [], open=True)))
    return parts


CATEGORY = Category(
    "campfire",
    _make,
    synonyms=("camp fire", "fire", "bonfire", "log fire"),
    attributes=(
        Attribute("stones", ("with stones", "with a ring of stones")),
        Attribute("pot", ("with a pot", "with a kettle")),
    ),
    parts=("flames", "logs", "wood"),
    metres=1.0,
)
