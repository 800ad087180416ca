"""Bowls: half a ball on a foot."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, ellipse, lathe, line, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    foot, rim, deep = vary(0.34, 0.44), vary(0.9, 1.05), vary(0.55, 0.72)
    if "round" in attributes:
        wall = curve((foot, 0, 0.06), (1.05, 0, 0.1), (1.15, 0, 1.1), (0.66, 0, 1.3))
        parts = [lathe(wall, [(foot, 0.06), (0.66, 1.3)])]
        rim, deep = 0.66, 1.3
        parts.append(ring((0, 0, 1.36), 0.72))
        parts.append(ring((0, 0, 0.62), (foot + 3 * 1.05 + 3 * 1.15 + 0.66) / 8))
    else:
        wall = curve((foot, 0, 0.1), (0.75 * rim, 0, 0.12), (0.98 * rim, 0, 0.5 * deep), (rim, 0, deep))
        parts = [
            lathe(wall, [(foot, 0.1), (rim, deep), (0.94 * rim, deep)], open=True),
            lathe(line((0.9 * foot, 0, 0), (foot, 0, 0.1)), [(0.9 * foot, 0)]),
        ]
    if "spoon" in attributes:
        parts.append(ellipse((0, 0.3 * rim, 0.5 * deep), (0.16, 0, 0), (0, 0.22, -0.1)))
        parts.append(line((0, 0.3 * rim + 0.22, 0.5 * deep + 0.1), (0, 1.5 * rim, deep + 0.5)))
    if "fruit" in attributes:
        for y, r in ((-0.5, 0.28), (0.0, 0.34), (0.5, 0.28)):
            parts += [ring((0, y * rim, deep + 0.3 * r), r * rim, axis) for axis in ("x", "y")]
    if "steam" in attributes:
        parts += [
            curve((0, y, deep + 0.1), (0, y + 0.2, deep + 0.3), (0, y - 0.2, deep + 0.5), (0, y, deep + 0.7))
            for y in (-0.3, 0, 0.3)
        ]
    return parts


CATEGORY = Category(
    "bowl",
    _make,
    synonyms=("soup bowl", "salad bowl", "bowl of soup", "dish"),
    attributes=(
        Attribute("round", ("round",), nouns=("fish bowl", "fishbowl")),
        Attribute("spoon", ("with a spoon",)),
        Attribute("fruit", ("with fruit",), nouns=("bowl of fruit", "fruit bowl"), excludes=("round",)),
        Attribute("steam", ("with steam", "steaming", "hot")),
    ),
    parts=("a foot", "a rim"),
    mirror="x",
    metres=0.3,
    carries=0.15,
)
