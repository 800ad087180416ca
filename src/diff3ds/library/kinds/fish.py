"""Fish: a slender body with fins, a tail, gills and eyes."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    detail,
    ellipse,
    filled,
    flesh,
    mirror,
    polyline,
    ring,
    smooth,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, high, wide = vary(0.96, 1.19), vary(0.37, 0.53), vary(0.16, 0.26)
    if "slender" in attributes:
        high, wide = 0.55 * high, 0.7 * wide
    back = curve((long, 0, 0), (0.6 * long, 0, 1.25 * high), (-0.3 * long, 0, 1.35 * high), (-long, 0, 0.09))
    belly = curve((long, 0, 0), (0.6 * long, 0, -1.2 * high), (-0.3 * long, 0, -1.3 * high), (-long, 0, -0.09))
    side = curve((long, 0, 0), (0.6 * long, 1.3 * wide, 0), (-0.3 * long, 1.3 * wide, 0), (-long, 0, 0))
    parts = [back, belly, mirror(side), flesh(back, belly, 0, 0.73 * wide, 0.97 * wide, 0.73 * wide, 0)]
    fan = [(-long, 0.09), (-1.55 * long, 0.5), (-1.35 * long, 0.0), (-1.55 * long, -0.5), (-long, -0.09)]
    parts.append(filled(polyline(*[(x, 0, z) for x, z in fan])))
    fin = 1.0 if "big fins" in attributes else 0.5
    parts.append(
        filled(
            curve(
                (0.3 * long, 0, 0.9 * high),
                (0, 0, (1 + fin) * high),
                (-0.3 * long, 0, (1 + 1.3 * fin) * high),
                (-0.45 * long, 0, 0.76 * high),
            )
        )
    )
    pectoral = smooth((0.35 * long, wide, -0.1), (-0.05, wide + 0.25 * fin, -0.25), (0.05 * long, wide, -0.2))
    parts.append(mirror(filled(pectoral)))
    parts.append(detail(mirror(ring((0.68 * long, 0.5 * wide, 0.12), 0.05, "y"))))
    parts.append(detail(ellipse((0.4 * long, 0, 0), (0, 0.9 * wide, 0), (0, 0, 0.82 * high))))
    if "stripes" in attributes:
        for x, size in ((0.1, 0.97), (-0.2, 0.93), (-0.5, 0.72)):
            parts.append(ellipse((x * long, 0, 0), (0, 0.98 * size * wide, 0), (0, 0, size * high)))
    return parts


CATEGORY = Category(
    "fish",
    _make,
    synonyms=("goldfish",),
    attributes=(
        Attribute("stripes", ("with stripes", "striped")),
        Attribute("slender", ("slender", "long")),
        Attribute("big fins", ("with big fins", "with large fins")),
    ),
    parts=(
        "a tail",
        "fins",
        "eyes",
    ),
    metres=0.4,
    head=(0.72, 0.84, 0.4),
)
