"""Trees: a trunk and a crown; firs, palms and bare trees too."""

import math
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
    turn,
)

# Along the outline of the leaves; odd, so that one is at the top.
BUMPS = 7


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    trunk, tall, crown = vary(0.1, 0.16), vary(0.84, 1.16), vary(0.61, 0.82)
    if "palm" in attributes:
        return _palm(1.4 + tall / 3, vary(0.45, 0.75), vary(0.25, 0.45))
    if "fir" in attributes:
        return _fir(trunk, tall, crown)
    stem = curve((1.6 * trunk, 0, 0), (0.8 * trunk, 0, 0.3), (0.9 * trunk, 0, 0.5), (0.9 * trunk, 0, tall))
    parts = [lathe(stem, [(1.6 * trunk, 0)])]
    if "bare" in attributes:
        return parts + _boughs(tall, crown)
    middle = tall + 0.75 * crown
    # A crown of leaves is an outline of bumps, drawn in two planes that cross.
    ends = [(math.sin(angle) * crown, -math.cos(angle) * crown) for angle in (0, math.tau / BUMPS)]
    (y0, z0), (y1, z1) = ends
    bump = curve((0, y0, z0), (0, 1.5 * y0, 1.5 * z0), (0, 1.5 * y1, 1.5 * z1), (0, y1, z1))
    outline = move(around(bump, BUMPS, "x"), (0, 0, middle))
    parts += [outline, turn(outline, 90)]
    if "apples" in attributes:
        for x, y, z in ((0.45, 0.3, 0.1), (0.25, 0.35, -0.45), (0.35, 0.15, 0.5), (-0.4, 0.3, 0.25)):
            parts.append(mirror(ring((x * crown, y * crown, middle + z * crown), 0.08, "x")))
    return parts


def _palm(top: float, rise: float, droop: float) -> list[Part]:
    side = curve((0.15, 0, 0), (0.08, 0, 0.5), (0.08, 0, 1.2), (0.07, 0, top))
    rib = curve((0.05, 0, top), (0.4, 0, top + rise), (0.9, 0, top + 0.4), (1.1, 0, top - droop))
    edge = curve((0.05, 0, top), (0.4, 0.2, top + rise - 0.2), (0.9, 0.2, top + 0.1), (1.1, 0, top - droop))
    return [lathe(side, [(0.15, 0), (0.11, 0.6), (0.08, 1.2)]), around(join(rib, mirror(edge)), 6)]


def _fir(trunk: float, tall: float, crown: float) -> list[Part]:
    parts = [lathe(line((trunk, 0, 0), (trunk, 0, 0.35)), [(trunk, 0)])]
    for low, high, wide in ((0.0, 0.8, 1.15), (0.5, 1.25, 0.88), (1.0, 1.75, 0.62)):
        side = line((wide * crown, 0, 0.35 + low * tall), (0, 0, 0.35 + high * tall))
        parts.append(lathe(side, [(wide * crown, 0.35 + low * tall)], 4, 45))
    return parts


def _boughs(tall: float, reach: float) -> list[Part]:
    bough = curve((0.05, 0, -0.1), (0.2, 0, 0.1), (0.4, 0, 0.3), (0.5, 0, 0.85))
    twigs = join(line((0.3, 0, 0.3), (0.75, 0, 0.55)), line((0.42, 0, 0.55), (0.2, 0, 0.9)))
    branch = stretch(join(bough, twigs), (1.4 * reach, 1, 1))
    parts = [
        move(turn(branch, angle), (0, 0, z * tall)) for angle, z in ((0, 0.75), (90, 0.95), (180, 0.75), (270, 0.95))
    ]
    return [*parts, line((0, 0, tall - 0.1), (0, 0, tall + 1.2))]


CATEGORY = Category(
    "tree",
    _make,
    synonyms=("oak", "oak tree"),
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
    parts=("a trunk",),
    metres=7,
)
