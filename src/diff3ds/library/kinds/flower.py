"""Flowers: petals around a disc on a stem with two leaves."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    curve,
    filled,
    join,
    lathe,
    line,
    move,
    reflect,
    ring,
    sheet,
    smooth,
    solid,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    tall, petal, disc, tilt = vary(1.14, 1.46), vary(0.43, 0.59), vary(0.13, 0.21), vary(38, 62)
    top = (0.1, 0, tall)
    parts = [curve((0, 0, 0), (-0.1, 0, 0.4), (-0.1, 0, 0.9), top)]
    for low in (0.15, 0.35):
        out, up = 0.55, low + 0.45
        leaf = [
            curve((-0.03, 0, low), (0, 0.25, low + 0.02), (0.05, out, up - 0.2), (0.05, out, up)),
            curve((-0.03, 0, low), (0, 0.02, up - 0.1), (0.05, 0.3, up), (0.05, out, up)),
        ]
        leaf.append(sheet(*leaf))
        parts += [reflect(part) for part in leaf] if low == 0.15 else leaf
    if "tulip" in attributes:
        side = curve((0, 0, 0), (0.55, 0, 0), (0.2, 0, 0.5), (0.42, 0, 0.72))
        edge = curve((0.42, 0, 0.72), (0.27, 0.2, 0.4), (0.2, 0.27, 0.4), (0, 0.42, 0.72))
        # The cup, without the tips between its edges.
        cup = solid(lathe(side, [], open=True))
        parts.append(move(join(around(join(side, edge), 4), cup), top))
    else:
        blade = smooth((disc, -0.04, 0), (disc + petal, -0.1, 0), (disc + petal, 0.1, 0), (disc, 0.04, 0))
        head = join(around(filled(blade), 8), filled(ring((0, 0, 0), disc)), ring((0, 0, 0), 0.5 * disc))
        parts.append(move(turn(head, -tilt, "y"), top))
    if "pot" in attributes:
        rim = lathe(line((0.3, 0, -0.55), (0.42, 0, 0)), [(0.3, -0.55), (0.42, 0)], 4, 45, open=True)
        parts.append(rim)
    return parts


CATEGORY = Category(
    "flower",
    _make,
    synonyms=("blossom", "rose", "daisy"),
    attributes=(
        Attribute("tulip", ("cup-shaped",), nouns=("tulip",)),
        Attribute("pot", ("with a pot", "potted"), nouns=("plant", "house plant", "flower pot")),
    ),
    parts=(
        "petals",
        "leaves",
        "a stem",
    ),
    mirror=None,
    metres=0.5,
)
