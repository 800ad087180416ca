"""Scissors: two blades that cross, each with a ring for the fingers."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, ellipse, filled, join, mirror, polyline, ring, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    blade, shank, finger = vary(1.04, 1.36), vary(0.47, 0.63), vary(0.23, 0.3)
    opened = vary(22, 34) if "open" in attributes else vary(8, 14)
    if "long blades" in attributes:
        blade *= 1.6
    # One half, upright around the pivot at the origin: its blade above, its ring below.
    half = [filled(polyline((0, 0.07, -0.1), (0, 0.09, 0.25), (0, -0.02, blade), (0, -0.07, 0.1), (0, -0.07, -0.1)))]
    half.append(curve((0, 0.07, -0.1), (0, 0.05, -0.25), (0, 0.1, -0.3), (0, 0.1, -shank)))
    half.append(curve((0, -0.07, -0.1), (0, -0.08, -0.25), (0, 0.0, -0.3), (0, 0.0, -shank)))
    y, z = 0.05 + 0.5 * finger, -shank - 1.2 * finger
    half += [ellipse((0, y, z), (0, size, 0), (0, 0, 1.35 * size)) for size in (finger, 0.75 * finger)]
    return [mirror(turn(join(*half), opened, "x")), ring((0, 0, 0), 0.04, "x")]


CATEGORY = Category(
    "scissors",
    _make,
    synonyms=("shears",),
    attributes=(
        Attribute("open", ("open",)),
        Attribute("long blades", ("with long blades", "long-bladed")),
    ),
    parts=("blades",),
    pair=True,
    metres=0.2,
)
