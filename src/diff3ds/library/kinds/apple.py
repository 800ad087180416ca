"""Apples: a round body with a hollow above and below, a stalk and a leaf."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, join, lathe, mirror, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, high, foot, dent = vary(0.74, 0.84), vary(0.72, 0.86), vary(0.24, 0.32), vary(0.14, 0.22)
    if "pear-shaped" in attributes:
        half = join(
            curve((0, 0, 0.95 * high), (0.2, 0, 1.2 * high), (0.36, 0, 0.9 * high), (0.4, 0, 0.5 * high)),
            curve((0.4, 0, 0.5 * high), (0.46, 0, 0.0), (wide, 0, -0.1 * high), (wide, 0, -0.5 * high)),
            curve((wide, 0, -0.5 * high), (wide, 0, -0.95 * high), (0.5, 0, -1.1 * high), (0, 0, -1.0 * high)),
        )
        parts = [lathe(half, [(wide, -0.5 * high)])]
        top = 0.95 * high
    else:
        half = join(
            curve((0, 0, high - dent), (0.1, 0, high + 0.06), (wide, 0, 1.25 * high), (wide, 0, 0.2 * high)),
            curve((wide, 0, 0.2 * high), (wide, 0, -0.45 * high), (1.9 * foot, 0, -1.02 * high), (foot, 0, -high)),
            curve((foot, 0, -high), (0.6 * foot, 0, -0.99 * high), (0.4 * foot, 0, -0.9 * high), (0, 0, -0.88 * high)),
        )
        parts = [lathe(half, [(wide, 0.2 * high)])]
        top = high - dent
    parts.append(curve((0, 0, top), (0, 0.02, top + 0.2), (0, 0.06, top + 0.3), (0, 0.14, top + 0.44)))
    if "bite" in attributes:
        # On the right: the edge, and how deep it is.
        top_of_it, low_of_it = (0, 0.86 * wide, 0.56 * high), (0, 0.84 * wide, -0.3 * high)
        edge = ((0.26, 0.84 * wide, 0.44 * high), (0.24, 0.9 * wide, 0.2 * high), (0.3, 0.88 * wide, -0.06 * high))
        parts.append(mirror(spline(top_of_it, *edge, low_of_it), "x"))
        parts.append(curve(top_of_it, (0, 0.44 * wide, 0.4 * high), (0, 0.44 * wide, -0.1 * high), low_of_it))
    if "leaf" in attributes:
        root, tip = (0, 0.03, top + 0.16), (0, -0.52, top + 0.42)
        parts.append(mirror(curve(root, (0.16, -0.14, top + 0.3), (0.14, -0.4, top + 0.44), tip), "x"))
        parts.append(curve(root, (0, -0.12, top + 0.44), (0, -0.36, top + 0.56), tip))
    return parts


CATEGORY = Category(
    "apple",
    _make,
    attributes=(
        Attribute("leaf", ("with a leaf",)),
        Attribute("bite", ("with a bite", "bitten", "with a bite taken out"), excludes=("pear-shaped",)),
        Attribute("pear-shaped", ("pear-shaped",), nouns=("pear",)),
    ),
    parts=("a stalk", "a stem"),
    mirror="x",
    metres=0.09,
)
