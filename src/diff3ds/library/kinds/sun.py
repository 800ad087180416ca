"""Suns: a ball with rays, as one draws it in a corner of the sky."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, ball, ellipse, line, mirror, polyline, ring, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, near, far = vary(0.46, 0.56), vary(0.62, 0.7), vary(0.95, 1.1)
    parts = [ball((0, 0, 0), r), *(ring((0, 0, 0), r, axis) for axis in ("x", "y", "z"))]
    if "pointed rays" in attributes:
        parts.append(around(polyline((0, -0.14, near), (0, 0, far), (0, 0.14, near)), 10, "x"))
        parts.append(mirror(polyline((near, 0, -0.14), (far, 0, 0), (near, 0, 0.14)), "x"))
    else:
        # In two planes, across each other; rays up and down are in both.
        ray = line((0, 0, near), (0, 0, far))
        parts.append(around(ray, 12, "x"))
        parts += [mirror(turn(ray, angle, "y"), "x") for angle in (45, 90, 135)]
    if "face" in attributes:
        parts.append(mirror(ring((0.95 * r, 0.32 * r, 0.2 * r), 0.1 * r, "x")))
        parts.append(ellipse((0.95 * r, 0, -0.1 * r), (0, 0.45 * r, 0), (0, 0, 0.35 * r), 180, 360))
    return parts


CATEGORY = Category(
    "sun",
    _make,
    synonyms=("sunshine",),
    attributes=(
        Attribute("face", ("with a face", "smiling")),
        Attribute("pointed rays", ("with pointed rays",)),
    ),
    parts=("rays",),
    metres=4.0,
    aloft=True,
)
