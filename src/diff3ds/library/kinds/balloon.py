"""Hot-air balloons: an envelope, ropes and a basket."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    between,
    curve,
    ellipse,
    join,
    lathe,
    line,
    mirror,
    polyline,
    rectangle,
    ring,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, tall, mouth = vary(0.74, 0.94), vary(1.62, 2.02), vary(0.18, 0.28)
    side = join(
        curve((mouth, 0, 0), (0.5 * wide, 0, 0.3 * tall), (wide, 0, 0.4 * tall), (wide, 0, 0.62 * tall)),
        ellipse((0, 0, 0.62 * tall), (wide, 0, 0), (0, 0, 0.38 * tall), 0, 90),
    )
    parts = [lathe(side, [(mouth, 0), (wide, 0.62 * tall)], 8)]
    basket = 0.15
    parts.append(mirror(line((basket, basket, -0.35), (0.71 * mouth, 0.71 * mouth, 0)), "x", "y"))
    parts.append(between(rectangle((0, 0, -0.35), (2 * basket, 2 * basket)), rectangle((0, 0, -0.6), (0.25, 0.25))))
    if "stripes" in attributes:
        parts += [ring((0, 0, (0.62 + 0.38 * (1 - s * s) ** 0.5) * tall), s * wide) for s in (0.6, 0.85)]
    if "flame" in attributes:
        flame = curve((0.02, 0, -0.25), (0.14, 0, -0.1), (0.02, 0, 0.05), (0, 0, 0.25))
        parts.append(around(flame, 4))
    if "flag" in attributes:
        z = tall + 0.3
        parts += [line((0, 0, tall), (0, 0, z)), polyline((0, 0, z), (-0.35, 0, z - 0.1), (0, 0, z - 0.2))]
    return parts


CATEGORY = Category(
    "hot-air balloon",
    _make,
    synonyms=("balloon",),
    attributes=(
        Attribute("stripes", ("with stripes", "striped")),
        Attribute("flame", ("with a flame",)),
        Attribute("flag", ("with a flag",)),
    ),
    parts=("a basket",),
    metres=20,
    aloft=True,
)
