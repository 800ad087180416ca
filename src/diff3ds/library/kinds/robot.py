"""Robots: a box of a trunk, a box of a head with round eyes and an aerial, jointed arms and legs."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, box, curve, line, mirror, rectangle, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, high, head, leg = vary(0.6, 0.75), vary(0.68, 0.85), vary(0.42, 0.52), vary(0.4, 0.6)
    deep = 0.42
    chest, top = leg + high, leg + high + 0.1
    parts = [
        box((0, 0, leg + high / 2), (deep, wide, high)),
        box((0, 0, top + 0.38 * head), (0.8 * head, head, 0.76 * head)),
    ]
    parts.append(mirror(line((0, 0.07, chest), (0, 0.07, top))))
    face = 0.4 * head
    parts.append(mirror(ring((face, 0.24 * head, top + 0.5 * head), 0.11 * head, "x")))
    parts.append(line((face, -0.25 * head, top + 0.2 * head), (face, 0.25 * head, top + 0.2 * head)))
    crown = top + 0.76 * head
    parts += [line((0, 0, crown), (0, 0, crown + 0.18)), ring((0, 0, crown + 0.23), 0.05, "x")]
    # Arms with claws, legs with feet.
    y, z = wide / 2 + 0.1, chest - 0.12
    parts.append(mirror(line((0, wide / 2, z), (0, y + 0.1, z - 0.06))))
    parts.append(mirror(line((0, y + 0.1, z - 0.06), (0.2, y + 0.12, z - 0.44))))
    parts.append(
        mirror(
            curve((0.24, y + 0.02, z - 0.62), (0.1, y, z - 0.4), (0.3, y + 0.24, z - 0.4), (0.3, y + 0.22, z - 0.62))
        )
    )
    parts += [mirror(line((0, 0.28 * wide + s * 0.06, leg), (0, 0.28 * wide + s * 0.06, 0))) for s in (-1, 1)]
    if "wheels" in attributes:
        parts.append(mirror(ring((0, 0.28 * wide, 0), 0.2, "y")))
    else:
        parts.append(mirror(rectangle((0.06, 0.28 * wide, 0.0), (0.4, 0.24))))
    if "buttons" in attributes:
        parts.append(mirror(ring((deep / 2, 0.14, leg + 0.34 * high), 0.06, "x")))
        parts.append(rectangle((deep / 2, 0, leg + 0.74 * high), (0.6 * wide, 0.24 * high), "x"))
    return parts


CATEGORY = Category(
    "robot",
    _make,
    synonyms=("android", "toy robot"),
    attributes=(
        Attribute("buttons", ("with buttons", "with a screen")),
        Attribute("wheels", ("with wheels",)),
    ),
    parts=("arms", "legs", "an antenna", "an aerial", "eyes"),
    metres=1.6,
    head=(0.4, 0.85, 0.32),
)
