"""Trees: a trunk and a crown; firs, palms and bare trees too."""

import math
from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Strokes,
    around,
    curve,
    join,
    lathe,
    line,
    mirror,
    move,
    ring,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Strokes]:
    trunk, tall, crown = vary(0.1, 0.16), vary(0.84, 1.16), vary(0.61, 0.82)
    if "palm" in attributes:
        top, rise, droop = 1.4 + tall / 3, vary(0.45, 0.75), vary(0.25, 0.45)
        stem = lathe(
            curve((0.15, 0, 0), (0.08, 0, 0.5), (0.08, 0, 1.2), (0.07, 0, top)), [(0.15, 0), (0.11, 0.6), (0.08, 1.2)]
        )
        rib = curve((0.05, 0, top), (0.4, 0, top + rise), (0.9, 0, top + 0.4), (1.1, 0, top - droop))
        edge = curve((0.05, 0, top), (0.4, 0.2, top + rise - 0.2), (0.9, 0.2, top + 0.1), (1.1, 0, top - droop))
        leaf = join(rib, mirror(edge))
        return [stem, around(leaf, 6)]
    if "fir" in attributes:
        parts = [lathe(line((trunk, 0, 0), (trunk, 0, 0.35)), [(trunk, 0)])]
        for low, wide, high in ((0.35, 0.8, 1.15), (0.85, 0.62, 1.6), (1.35, 0.44, 2.1)):
            parts.append(lathe(line((wide, 0, low), (0, 0, high)), [(wide, low)], 4, 45))
        return parts
    stem = curve((1.6 * trunk, 0, 0), (0.8 * trunk, 0, 0.3), (0.9 * trunk, 0, 0.5), (0.9 * trunk, 0, tall))
    parts = [lathe(stem, [(1.6 * trunk, 0)])]
    if "bare" in attributes:
        for turned, z in ((0, 0.75), (90, 0.95), (180, 0.75), (270, 0.95)):
            bough = curve((0.05, 0, z - 0.1), (0.2, 0, z + 0.1), (0.4, 0, z + 0.3), (0.5, 0, z + 0.85))
            twigs = join(line((0.3, 0, z + 0.3), (0.75, 0, z + 0.55)), line((0.42, 0, z + 0.55), (0.2, 0, z + 0.9)))
            parts.append(turn(join(bough, twigs), turned))
        return [*parts, line((0, 0, tall - 0.1), (0, 0, 2.2))]
    # A crown of leaves is an outline of bumps, drawn in two planes that cross.
    middle = tall + 0.75 * crown
    count = 7
    rim = [
        (crown * math.sin(2 * math.pi * i / count), -crown * math.cos(2 * math.pi * i / count)) for i in range(count)
    ]
    bumps = []
    for (y0, z0), (y1, z1) in zip(rim, [*rim[1:], rim[0]], strict=True):
        bumps.append(
            curve(
                (0, y0, z0),
                (0, 1.5 * y0 + 0.05 * y1, 1.5 * z0 + 0.05 * z1),
                (0, 1.5 * y1 + 0.05 * y0, 1.5 * z1 + 0.05 * z0),
                (0, y1, z1),
            )
        )
    outline = move(join(*bumps), (0, 0, middle))
    parts += [outline, turn(outline, 90)]
    if "apples" in attributes:
        for x, y, z in ((0.45, 0.3, 0.1), (0.25, 0.35, -0.45), (0.35, 0.15, 0.5), (-0.4, 0.3, 0.25)):
            parts.append(mirror(ring((x * crown, y * crown, middle + z * crown), 0.08, "x")))
    return parts


CATEGORY = Category(
    "tree",
    _make,
    attributes=(
        Attribute(
            "fir",
            ("coniferous",),
            nouns=("fir", "fir tree", "pine tree", "Christmas tree"),
            excludes=("palm", "bare", "apples"),
        ),
        Attribute("palm", ("palm",), nouns=("palm",), excludes=("bare", "apples")),
        Attribute("bare", ("bare", "without leaves", "leafless"), excludes=("apples",)),
        Attribute("apples", ("with apples",), nouns=("apple tree",)),
    ),
)
