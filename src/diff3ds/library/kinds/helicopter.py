"""Helicopters: a drop of a cabin, a tail boom with a small rotor, the large rotor and skids."""

from collections.abc import Collection

from diff3ds.library.animals import torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, curve, ellipse, filled, line, mirror, polyline, rectangle, ring, side


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    high, wide, blade, boom = vary(0.4, 0.48), vary(0.34, 0.42), vary(1.05, 1.25), vary(1.2, 1.45)
    parts = [side((0.72, -0.08), (0.5, 0.26), (0.16, high), (-0.2, 0.34), (-0.5, 0.14), (-boom, 0.16))]
    parts.append(side((0.72, -0.08), (0.5, -0.34), (0.1, -high), (-0.3, -0.24), (-0.5, -0.02), (-boom, 0.08)))
    cabin = (((0.7, -0.08), 0.04), ((0.5, -0.04), 0.75 * wide), ((0.1, 0), 0.97 * wide), ((-0.2, 0.05), 0.7 * wide))
    parts.append(torso(parts[0], parts[1], *cabin, ((-0.5, 0.06), 0.08), ((-boom, 0.12), 0.03)))
    parts.append(mirror(curve((0.72, 0, -0.08), (0.66, 1.3 * wide, -0.06), (-0.1, 1.25 * wide, 0), (-0.5, 0.08, 0.06))))
    parts += [ellipse((0.1, 0, 0), (0, wide, 0), (0, 0, high)), ring((-0.5, 0, 0.06), 0.08, "x")]
    parts.append(mirror(line((-0.5, 0.08, 0.06), (-boom, 0.03, 0.12))))
    # The tail: a fin and the small rotor.
    fin = polyline((-boom + 0.14, 0, 0.15), (-boom - 0.12, 0, 0.48), (-boom - 0.2, 0, 0.46), (-boom, 0, 0.08))
    parts.append(filled(fin))
    hub = (-boom - 0.02, 0, 0.22)
    parts.append(around(line((hub[0] - 0.24, hub[1], hub[2]), (hub[0] + 0.24, hub[1], hub[2])), 4, "y", hub)[:2])
    # The mast and the blades, each a narrow strip.
    top = high + 0.18
    parts.append(line((0.1, 0, high), (0.1, 0, top)))
    strip = filled(polyline((0.16, 0, top), (0.1 + blade, 0.06, top), (0.1 + blade, -0.06, top), closed=True))
    count = 3 if "three blades" in attributes else 4
    parts.append(around(strip, count, "z", (0.1, 0, 0)))
    ground = -high - 0.22
    parts.append(
        mirror(curve((0.72, wide, ground + 0.12), (0.64, wide, ground), (0.5, wide, ground), (0.4, wide, ground)))
    )
    parts.append(mirror(line((0.4, wide, ground), (-0.5, wide, ground))))
    parts += [mirror(line((x, wide, ground), (x, 0.4 * wide, -0.85 * high))) for x in (0.3, -0.2)]
    if "door" in attributes:
        parts.append(mirror(rectangle((0.12, 1.02 * wide, -0.01), (0.36, 0.5), "y")))
    if "rope ladder" in attributes:
        parts += [line((0.1, y, -high), (0.1, y, -high - 0.9)) for y in (-0.1, 0.1)]
        parts += [line((0.1, -0.1, -high - dz), (0.1, 0.1, -high - dz)) for dz in (0.25, 0.45, 0.65, 0.85)]
    return parts


CATEGORY = Category(
    "helicopter",
    _make,
    synonyms=("chopper",),
    attributes=(
        Attribute("three blades", ("with three blades",)),
        Attribute("door", ("with a door", "with doors")),
        Attribute("rope ladder", ("with a rope ladder", "with a ladder")),
    ),
    parts=("a rotor", "rotors", "a tail", "skids"),
    metres=11.0,
    aloft=True,
)
