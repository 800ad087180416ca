"""Presents: a box with a ribbon around it and a bow on top."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, box, curve, line, mirror, rectangle


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    x, y, z = vary(0.6, 0.75), vary(0.6, 0.8), vary(0.45, 0.65)
    if "tall" in attributes:
        x, y, z = 0.5 * x, 0.5 * y, 1.2
    parts = [box((0, 0, z), (2 * x, 2 * y, 2 * z))]
    # A ribbon both ways, over the top and down the sides.
    parts.append(mirror(line((x, 0, 0), (x, 0, 2 * z)), "x"))
    parts.append(mirror(line((0, y, 0), (0, y, 2 * z))))
    parts += [line((-x, 0, 2 * z), (x, 0, 2 * z)), line((0, -y, 2 * z), (0, y, 2 * z))]
    top, size = 2 * z, 0.5 * min(x, y) + 0.14
    loop = curve((0, 0, top), (0.1, 0.5 * size, top + 1.1 * size), (0.2, 1.9 * size, top + 1.0 * size), (0, 0, top))
    other = curve((0, 0, top), (-0.1, 0.5 * size, top + 1.1 * size), (-0.2, 1.9 * size, top + 0.9 * size), (0, 0, top))
    parts += [mirror(loop), mirror(other)]
    parts.append(
        mirror(
            curve(
                (0, 0, top),
                (0.1, 0.2 * size, top + 0.1),
                (0.4 * x, 0.4 * size, top + 0.16),
                (0.6 * x, 0.6 * size, top + 0.02),
            )
        )
    )
    if "label" in attributes:
        parts += [line((0, 0, top), (x + 0.05, 0, top - 0.2)), rectangle((x + 0.05, 0, top - 0.38), (0.24, 0.36), "x")]
    return parts


CATEGORY = Category(
    "present",
    _make,
    synonyms=("gift", "gift box", "birthday present", "Christmas present", "parcel"),
    attributes=(Attribute("tall", ("tall",)), Attribute("label", ("with a label", "with a card"))),
    parts=("a ribbon", "a bow"),
    metres=0.35,
)
