"""Snowmen: three balls, a carrot for a nose and sticks for arms."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, ball, detail, lathe, line, mirror, move, polyline, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    sizes = (vary(0.52, 0.64), vary(0.39, 0.47), vary(0.26, 0.32))
    parts, top = [], 0.0
    middles = []
    for size in sizes:
        z = top + 0.9 * size
        parts += [ring((0, 0, z), size, axis) for axis in ("x", "y", "z")]
        parts.append(ball((0, 0, z), size))
        middles.append(z)
        top = z + 0.9 * size
    face, head = sizes[2], middles[2]
    parts.append(detail(mirror(line((0.98 * face, 0.05, head), (face + 0.4, 0, head - 0.06)))))
    parts.append(detail(mirror(ring((0.85 * face, 0.13, head + 0.11), 0.045, "x"))))
    parts += [detail(ring((sizes[1], 0, middles[1] + dz), 0.05, "x")) for dz in (-0.12, 0.12)]
    shoulder, z = sizes[1], middles[1]
    hand = (0, shoulder + 0.42, z + 0.35)
    parts.append(detail(mirror(line((0, shoulder, z), hand))))
    parts.append(detail(mirror(line((0, shoulder + 0.28, z + 0.23), (0, shoulder + 0.46, z + 0.2)))))
    if "hat" in attributes:
        hat = lathe(
            line((0.8 * face, 0, 0), (0.8 * face, 0, 0.45)), [(0.8 * face, 0), (0.8 * face, 0.45), (1.4 * face, 0)]
        )
        parts.append(move(hat, (0, 0, head + 0.6 * face)))
    if "scarf" in attributes:
        z = head - 0.85 * face
        parts += [ring((0, 0, z + dz), face) for dz in (-0.07, 0.07)]
        ends = [(0.9 * face, 0.1, z), (1.5 * face, 0.14, z - 0.45), (1.5 * face, 0.3, z - 0.45), (0.85 * face, 0.24, z)]
        parts.append(polyline(*ends))
    if "broom" in attributes:
        x, y, z = hand
        parts.append(line((x, y, z - 1.0), (x, y, z + 0.45)))
        bristle = line((0, y, z + 0.45), (0.16, y, z + 0.85))
        parts.append(around(bristle, 6, "z", (0, y, 0)))
    return parts


CATEGORY = Category(
    "snowman",
    _make,
    synonyms=("snow man",),
    attributes=(
        Attribute("hat", ("with a hat",)),
        Attribute("scarf", ("with a scarf",)),
        Attribute("broom", ("with a broom",)),
    ),
    parts=(
        "a carrot nose",
        "a nose",
        "eyes",
        "buttons",
        "arms",
    ),
    mirror=None,
    metres=1.7,
    head=(0.45, 0.95, 0.3),
)
