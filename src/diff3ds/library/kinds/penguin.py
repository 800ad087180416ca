"""Penguins: an upright body like a skittle, flippers at the sides, a white front, a beak and feet."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, ball, curve, filled, line, mirror, polyline, ring, sheet, side, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    high, wide, head = vary(1.5, 1.75), vary(0.4, 0.5), vary(0.21, 0.26)
    z = high - head
    # A ball of a head, and the body from where it widens below.
    x, low = 0.8 * head, z - 0.6 * head
    parts = [ring((0, 0, z), head, axis) for axis in ("x", "y")]
    front = side((x, low), (0.27, 0.7 * high), (0.42, 0.4 * high), (0.34, 0.08), (0.1, 0.04))
    back = side((-x, low), (-0.22, 0.7 * high), (-0.32, 0.35 * high), (-0.24, 0.1), (-0.4, 0.0))
    parts += [front, back, ball((0, 0, z), head)]
    widths = (((0, low), x), ((0, 0.7 * high), 0.29), ((0.05, 0.4 * high), 0.97 * wide), ((0.05, 0.08), 0.3))
    parts.append(torso(front, back, *widths))
    parts.append(
        mirror(spline((0, x, low), (0, 0.3, 0.7 * high), (0, wide, 0.38 * high), (0, 0.3, 0.06), (0, 0.1, 0.04)))
    )
    parts.append(ring((0.03, 0, 0.38 * high), wide - 0.06))
    # The edge of the white front, the beak, the eyes.
    parts.append(
        mirror(curve((0.24, 0, 0.74 * high), (0.26, 0.3, 0.74 * high), (0.5, 0.46, 0.2 * high), (0.36, 0.0, 0.1)))
    )
    beak = (head + 0.2, 0, z - 0.02)
    parts += [line((head, 0, z + 0.06), beak), mirror(line(beak, (head - 0.02, 0.07, z)))]
    parts.append(eyes(0.14, 0.15, z + 0.09, 0.035))
    shoulder, tip = (0.02, 0.3, 0.74 * high), (-0.02, wide + 0.22, 0.26 * high)
    flipper = [
        curve(shoulder, (0.06, 0.5, 0.66 * high), (0.1, wide + 0.22, 0.4 * high), tip),
        curve(shoulder, (-0.06, 0.42, 0.6 * high), (-0.1, wide + 0.1, 0.4 * high), tip),
    ]
    parts += [mirror(part) for part in (*flipper, sheet(*flipper))]
    parts.append(mirror(filled(polyline((0.1, 0.14, 0.05), (0.44, 0.06, 0), (0.46, 0.26, 0), closed=True))))
    if "scarf" in attributes:
        parts += [ring((0, 0, z - 0.24 + dz), 0.27) for dz in (-0.04, 0.06)]
        parts.append(
            mirror(
                polyline((0.26, 0.03, z - 0.28), (0.4, 0.04, z - 0.66), (0.38, 0.18, z - 0.64), (0.22, 0.16, z - 0.28))
            )
        )
    if "hat" in attributes:
        parts += [
            ring((0, 0, high - 0.06), 0.2),
            mirror(curve((0, 0.2, high - 0.06), (0, 0.18, high + 0.2), (0, 0.06, high + 0.28), (0, 0, high + 0.3))),
        ]
        parts.append(ring((0, 0, high + 0.36), 0.07, "x"))
    return parts


CATEGORY = Category(
    "penguin",
    _make,
    attributes=(Attribute("scarf", ("with a scarf",)), Attribute("hat", ("with a hat", "with a woolly hat"))),
    parts=("a head", "flippers", "wings", "a beak", "feet", "eyes"),
    metres=0.8,
    head=(0.46, 0.95, 0.4),
)
