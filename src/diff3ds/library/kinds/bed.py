"""Beds: a mattress with pillows before a headboard."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    box,
    join,
    line,
    mirror,
    move,
    polyline,
    rectangle,
    smooth,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, long, low, high = vary(0.52, 0.68), vary(0.9, 1.15), vary(0.26, 0.38), vary(0.48, 0.58)
    board = high + vary(0.32, 0.53)
    parts = [box((0, 0, (low + high) / 2), (2 * long, 2 * half, high - low))]
    pillow = [(-long + 0.1, 0.1), (-long + 0.1, half - 0.07), (-long + 0.45, half - 0.07), (-long + 0.45, 0.1)]
    parts.append(mirror(smooth(*[(x, y, high + 0.06) for x, y in pillow], closed=True)))
    if "bunk" in attributes:
        rise = 0.85
        parts.append(move(join(*parts), (0, 0, rise)))
        parts.append(mirror(line((long, half, 0), (long, half, high + rise + 0.2)), "x", "y"))
        parts.append(mirror(line((long, 0.2, 0), (long, 0.2, high + rise))))
        parts += [line((long, -0.2, z), (long, 0.2, z)) for z in (0.25, 0.55, 0.85, 1.15)]
        return parts
    top = 1.9 if "canopy" in attributes else board
    parts.append(mirror(line((-long, half, 0), (-long, half, top))))
    parts.append(line((-long, -half, board), (-long, half, board)))
    parts.append(mirror(line((long, half, 0), (long, half, top if "canopy" in attributes else low))))
    if "canopy" in attributes:
        parts.append(rectangle((0, 0, top), (2 * long, 2 * half)))
    if "footboard" in attributes:
        parts.append(
            polyline((long, -half, low), (long, -half, high + 0.18), (long, half, high + 0.18), (long, half, low))
        )
    return parts


CATEGORY = Category(
    "bed",
    _make,
    attributes=(
        Attribute("canopy", ("with a canopy", "four-poster"), excludes=("bunk",)),
        Attribute("bunk", ("with two bunks",), nouns=("bunk bed",), excludes=("footboard",)),
        Attribute("footboard", ("with a footboard",)),
    ),
    parts=("pillows",),
    metres=2.1,
    carries=0.5,
)
