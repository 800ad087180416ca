"""Teapots: a round body with a lid, the spout on the left, the handle on the right."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    ellipse,
    join,
    lathe,
    move,
    ring,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    belly, height, mouth = vary(0.69, 0.85), vary(0.9, 1.15), vary(0.28, 0.38)
    if "tall" in attributes:
        belly, height = 0.58, 1.7
    side = curve((0.6 * belly, 0, 0), (1.25 * belly, 0, 0.1 * height), (1.15 * belly, 0, height), (mouth, 0, height))
    lid = curve(
        (mouth, 0, height), (0.85 * mouth, 0, height + 0.1), (0.5 * mouth, 0, height + 0.14), (0, 0, height + 0.16)
    )
    parts = [lathe(join(side, lid), [(0.6 * belly, 0), (mouth, height)]), ring((0, 0, height + 0.23), 0.07, "x")]
    y, low, high = 0.93 * belly, 0.22 * height, 0.6 * height
    tip = height + 0.05
    parts.append(curve((0, -y, low), (0, -y - 0.5, low), (0, -y - 0.25, tip), (0, -y - 0.62, tip)))
    parts.append(curve((0, -y, high), (0, -y - 0.2, high), (0, -y - 0.2, tip), (0, -y - 0.42, tip)))
    parts.append(ellipse((0, -y - 0.52, tip), (0.1, 0, 0), (0, 0.1, 0)))
    if "hoop" in attributes:
        parts += [ellipse((0, 0, 0.75 * height), (0, a, 0), (0, 0, a), 0, 180) for a in (0.88 * belly, 0.98 * belly)]
    else:
        for shrink in (0.0, 0.1):
            reach = y + 0.72 - shrink * 4 / 3
            a, b = 0.84 * height - shrink, 0.2 * height + shrink
            parts.append(curve((0, 0.88 * belly, a), (0, reach, a + 0.12), (0, reach, b), (0, y, b)))
    if "steam" in attributes:
        wisp = curve((0, 0, 0), (0, 0.25, 0.2), (0, -0.25, 0.4), (0, 0, 0.6))
        parts += [move(wisp, (0, -y - 0.52 + dy, tip + 0.1)) for dy in (-0.12, 0.1)]
    return parts


CATEGORY = Category(
    "teapot",
    _make,
    attributes=(
        Attribute("steam", ("with steam", "steaming")),
        Attribute("tall", ("tall",), nouns=("coffee pot",)),
        Attribute("hoop", ("with a handle over the top", "with a hoop handle")),
    ),
    parts=(
        "a spout",
        "a lid",
        "a handle",
    ),
    synonyms=("tea pot", "kettle", "tea kettle", "pot of tea"),
    mirror="x",
    metres=0.25,
)
