"""Tractors: two large wheels behind, two small ones ahead, a bonnet with an exhaust, a cab."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, box, curve, filled, line, mirror, polyline, rectangle, ring, sheet


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    big, small, long = vary(0.5, 0.6), vary(0.24, 0.3), vary(0.85, 1.0)
    half, bonnet = 0.24, 0.4
    floor = big
    parts = []
    for x, r, y in ((-0.3, big, 0.5), (long - 0.12, small, 0.42)):
        parts.append(mirror(filled(ring((x, y, r), r, "y"))))
        parts.append(mirror(ring((x, y, r), 0.4 * r, "y")))
    parts += [line((-0.3, -0.5, big), (-0.3, 0.5, big)), line((long - 0.12, -0.42, small), (long - 0.12, 0.42, small))]
    parts.append(box((0.1 + long / 2, 0, floor + bonnet / 2 - 0.06), (long - 0.2, 2 * half, bonnet)))
    roof = floor + 0.95
    parts.append(filled(rectangle((-0.14, 0, roof), (0.74, 0.76))))
    parts += [
        mirror(line((x, 0.3, z), (x, 0.36, roof))) for x, z in ((0.2, floor + bonnet - 0.06), (-0.48, floor + 0.2))
    ]
    # Mudguards over the large wheels, and the exhaust.
    parts.append(
        mirror(curve((0.24, 0.3, floor), (0.24, 0.3, 2.3 * big), (-0.6, 0.3, 2.4 * big), (-0.8, 0.3, 1.3 * big)))
    )
    x = 0.62 * long
    parts += [
        line((x, 0, floor + bonnet - 0.06), (x, 0, floor + bonnet + 0.36)),
        line((x, 0, floor + bonnet + 0.36), (x - 0.08, 0, floor + bonnet + 0.42)),
    ]
    if "trailer" in attributes:
        rear = -0.3 - big - 0.1
        bed = rectangle((rear - 0.5, 0, 0.45), (1.0, 0.8)), rectangle((rear - 0.5, 0, 0.85), (1.0, 0.8))
        parts += [*bed, sheet(*bed)]
        parts += [mirror(line((x, 0.4, 0.45), (x, 0.4, 0.85))) for x in (rear, rear - 1)]
        parts += [mirror(filled(ring((rear - 0.5, 0.46, 0.25), 0.25, "y"))), line((rear, 0, 0.45), (-0.3, 0, 0.5))]
    if "shovel" in attributes:
        x = long + 0.2
        parts.append(mirror(polyline((0.5 * long, 0.3, floor + 0.2), (x, 0.3, 0.2))))
        parts += [polyline((x + 0.3, y, 0.02), (x, y, 0.05), (x, y, 0.42), (x + 0.16, y, 0.5)) for y in (-0.46, 0.46)]
        parts += [
            line((px, -0.46, pz), (px, 0.46, pz)) for px, pz in ((x + 0.3, 0.02), (x, 0.05), (x, 0.42), (x + 0.16, 0.5))
        ]
    return parts


CATEGORY = Category(
    "tractor",
    _make,
    synonyms=("farm tractor",),
    attributes=(
        Attribute("trailer", ("with a trailer",)),
        Attribute("shovel", ("with a shovel", "with a bucket"), nouns=("digger", "bulldozer", "excavator")),
    ),
    parts=("wheels", "four wheels", "big wheels", "a cab", "an exhaust"),
    metres=4.0,
)
