"""Mugs: a cylinder with a rim and a handle at the right."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, lathe, line, move, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    radius, height, handle = vary(0.48, 0.58), vary(1.01, 1.24), vary(0.38, 0.5)
    foot = radius * vary(0.81, 1.05)
    if "tall" in attributes:
        height *= 1.7
    parts = [
        lathe(
            line((foot, 0, 0), (radius, 0, height)), [(foot, 0), (radius, height), (0.88 * radius, height)], open=True
        )
    ]
    low, high = 0.18 * height, 0.85 * height
    for shrink in (0.0, 0.11):
        a, b = high - shrink, low + shrink
        reach = radius + (handle - shrink) * 4 / 3
        at = [foot + (radius - foot) * z / height for z in (a, b)]
        parts.append(curve((0, at[0], a), (0, reach, a + 0.05), (0, reach, b), (0, at[1], b)))
    if "saucer" in attributes:
        parts += [ring((0, 0, 0), 1.05), ring((0, 0, -0.1), 0.6), ring((0, 0, 0), 0.62)]
    if "steam" in attributes:
        wisp = curve((0, 0, height + 0.1), (0, 0.3, height + 0.35), (0, -0.3, height + 0.5), (0, 0, height + 0.75))
        parts += [move(wisp, (0, y, 0)) for y in (-0.22, 0.0, 0.22)]
    return parts


CATEGORY = Category(
    "mug",
    _make,
    synonyms=("cup", "coffee mug", "coffee cup", "teacup", "tea cup", "cup of coffee", "cup of tea", "mug of tea"),
    attributes=(
        Attribute("tall", ("tall",), excludes=("saucer",)),
        Attribute("saucer", ("with a saucer",), nouns=("cup and saucer",)),
        Attribute("steam", ("with steam", "steaming", "hot")),
    ),
    parts=("a handle",),
    mirror="x",
    metres=0.12,
)
