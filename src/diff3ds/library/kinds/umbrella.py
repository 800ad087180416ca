"""Umbrellas: eight ribs under a scalloped canopy and a shaft with a crook."""

import math
from collections.abc import Collection
from itertools import pairwise

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, curve, ellipse, join, line, mirror, ring, sheet, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, rise, tall, crook = vary(0.87, 1.03), vary(0.46, 0.66), vary(1.44, 1.76), vary(0.11, 0.17)
    rim = tall - rise
    shaft = [line((0, 0, 0), (0, 0, tall + 0.12)), ring((crook, 0, 0), crook, "y", 180, 360)]
    if "beach" in attributes:
        wide, rim = 1.2 * wide, tall - 0.7 * rise
        shaft = [line((0, 0, -0.5), (0, 0, tall + 0.12))]
    if "closed" in attributes:
        folds = curve((0.04, 0, 0.35), (0.3, 0, 0.5), (0.1, 0, 0.9), (0.02, 0, tall))
        hem = mirror(line((0.04, 0, 0.35), (0.112, 0.065, 0.45)))
        return [*shaft, around(join(folds, hem), 6)]
    rib = ellipse((0, 0, rim), (wide, 0, 0), (0, 0, tall - rim), 0, 90)
    # The edge hangs between two ribs, 45 degrees apart, and is drawn in the plane of the middle between them.
    x, y = wide * math.cos(math.pi / 8), wide * math.sin(math.pi / 8)
    edge = curve((x, -y, rim), (0.93 * x, -y / 3, rim + 0.1), (0.93 * x, y / 3, rim + 0.1), (x, y, rim))
    edge = turn(edge, 22.5)
    # Between two ribs the canopy is stretched straight across, from the edge up to the top.
    rows = [edge]
    for angle in (0.3, 0.6, 0.9, 1.2, math.pi / 2):
        low, z = math.cos(angle), rim + (tall - rim) * math.sin(angle)
        rows.append(turn(line((low * x, -low * y, z), (low * x, low * y, z)), 22.5))
    canopy = [sheet(a, b) for a, b in pairwise(rows)]
    parts = [*shaft, around(join(rib, edge, *canopy), 8)]
    if "stripes" in attributes:
        parts += [ring((0, 0, rim + (tall - rim) * (1 - share**2) ** 0.5), share * wide) for share in (0.45, 0.8)]
    return parts


CATEGORY = Category(
    "umbrella",
    _make,
    attributes=(
        Attribute("closed", ("closed", "folded"), excludes=("beach", "stripes")),
        Attribute("beach", ("beach", "with a straight pole"), nouns=("parasol",)),
        Attribute("stripes", ("with stripes", "striped")),
    ),
    metres=1,
)
