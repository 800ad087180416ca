"""Tables: a top, rectangular unless said otherwise, on four legs; folding ones stand on crossed legs."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, between, box, line, mirror, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, deep, height = vary(0.89, 1.21), vary(0.46, 0.66), vary(0.79, 1.11)
    thick, inset = 0.09, 0.07
    if "square" in attributes:
        half = deep = 0.75
    if "round" in attributes:
        half = deep = vary(0.7, 0.94)
        inset = 0.42 * half
        parts = [between(ring((0, 0, height), half), ring((0, 0, height - thick), half))]
    else:
        parts = [box((0, 0, height - thick / 2), (2 * deep, 2 * half, thick))]
    x, y, z = deep - inset, half - inset, height - thick
    if "folding" in attributes:
        parts.append(mirror(line((x, y, z), (x, -y, 0)), "y", "x"))
        parts.append(mirror(line((x, y, 0), (-x, y, 0))))
    else:
        parts.append(mirror(line((x, y, z), (x, y, 0)), "x", "y"))
    return parts


CATEGORY = Category(
    "table",
    _make,
    synonyms=("dining table", "coffee table", "kitchen table", "desk"),
    attributes=(
        Attribute("round", ("round", "circular"), excludes=("square",)),
        Attribute("square", ("square",)),
        Attribute("folding", ("folding", "with crossed legs")),
    ),
    parts=(
        "legs",
        "four legs",
    ),
    metres=1.4,
)
