"""Lighthouses: a tapered tower with a gallery, a lantern and a dome."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    curve,
    detail,
    join,
    lathe,
    line,
    mirror,
    polyline,
    ring,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    foot, head, height = vary(0.4, 0.52), vary(0.21, 0.27), vary(1.61, 2.09)
    lamp = 0.72 * head
    light = height + 0.34
    parts = [lathe(line((foot, 0, 0), (head, 0, height)), [(foot, 0), (1.4 * head, height)], 4, 45)]
    parts.append(ring((0, 0, height + 0.12), 1.4 * head))
    parts.append(around(line((1.4 * head, 0, height), (1.4 * head, 0, height + 0.12)), 6))
    roof = curve((lamp, 0, light), (lamp, 0, light + 0.15), (0.1, 0, light + 0.2), (0, 0, light + 0.32))
    parts.append(lathe(join(line((lamp, 0, height), (lamp, 0, light)), roof), [(lamp, light)], 4, 45))
    x = foot - 0.02
    parts.append(detail(polyline((x, -0.1, 0), (x, -0.1, 0.3), (x, 0.1, 0.3), (x, 0.1, 0))))
    if "stripes" in attributes:
        for share in (0.2, 0.4, 0.6, 0.8):
            parts.append(ring((0, 0, share * height), foot + (head - foot) * share))
    if "beams" in attributes:
        z = height + 0.17
        for dz in (-0.3, 0.3):
            parts.append(mirror(line((0, lamp, z + 0.2 * dz), (0, lamp + 1.0, z + dz))))
    if "rocks" in attributes:
        ground = [(0.85, 0.3), (0.5, 0.75), (0.0, 0.8), (-0.5, 0.75), (-0.85, 0.3)]
        shore = polyline(*[(x, y, -0.3) for x, y in ground], *[(x, -y, -0.3) for x, y in reversed(ground)], closed=True)
        parts += [
            shore,
            mirror(polyline((0.85, 0.3, -0.3), (0.4, 0.25, 0), (0, 0.8, -0.3), (-0.3, 0.35, 0), (-0.85, 0.3, -0.3))),
        ]
    return parts


CATEGORY = Category(
    "lighthouse",
    _make,
    attributes=(
        Attribute("stripes", ("with stripes", "striped")),
        Attribute("beams", ("with light beams", "with beams of light")),
        Attribute("rocks", ("with rocks",)),
    ),
    parts=("a door",),
    metres=25,
)
