"""Tents: a ridge tent with an open flap, a dome or a tipi."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    curve,
    ellipse,
    extrude,
    line,
    mirror,
    polyline,
    ring,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, long, height = vary(0.76, 0.99), vary(0.84, 1.16), vary(0.94, 1.26)
    if "tipi" in attributes:
        foot, top = 0.9 * half, 1.7 * height
        poles = around(line((foot, 0, 0), (-0.13, 0, 1.15 * top)), 6)
        door = polyline((0.97 * foot, -0.22, 0), (0.42 * foot, 0, 0.58 * top), (0.97 * foot, 0.22, 0))
        parts = [poles, ring((0, 0, 0), foot), door]
        x, z = 0.0, top
    elif "dome" in attributes:
        wide, x, z = long, 0.0, 0.75 * height
        arcs = [turn(ellipse((0, 0, 0), (wide, 0, 0), (0, 0, z), 0, 180), angle) for angle in (45, -45)]
        hoop = ellipse((0, 0, 0), (0, wide, 0), (0, 0, z), 0, 180)
        door = ellipse((0.88 * wide, 0, 0), (0, 0.3, 0), (-0.4, 0, 0.65 * z), 0, 180)
        pegs = turn(around(line((wide, 0, 0), (1.15 * wide, 0, -0.05)), 4), 45)
        parts = [*arcs, hoop, ring((0, 0, 0), wide), door, pegs]
    else:
        front = polyline((long, -half, 0), (long, half, 0), (long, 0, height), closed=True)
        parts = [extrude(front, (-2 * long, 0, 0))]
        x, z = long, height
        parts.append(
            mirror(curve((long, 0, 0.95 * height), (long, 0.02, 0.5), (long, 0.1, 0.3), (long + 0.1, 0.42, 0)))
        )
        parts += [line((end, 0, height), (1.6 * end, 0, 0)) for end in (long, -long)]
    if "flag" in attributes:
        parts += [line((x, 0, z), (x, 0, z + 0.6)), polyline((x, 0, z + 0.6), (x - 0.4, 0, z + 0.47), (x, 0, z + 0.34))]
    return parts


CATEGORY = Category(
    "tent",
    _make,
    synonyms=("camping tent",),
    attributes=(
        Attribute("tipi", ("with crossed poles",), nouns=("tipi", "teepee"), excludes=("dome",)),
        Attribute("dome", ("round", "dome")),
        Attribute("flag", ("with a flag",)),
    ),
    parts=("a door",),
    metres=2.5,
)
