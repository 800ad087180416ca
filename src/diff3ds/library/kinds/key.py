"""Keys: a bow to hold, a shaft and a bit with teeth."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    join,
    lathe,
    line,
    move,
    polyline,
    rectangle,
    ring,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    bow, long, thick, bit = vary(0.28, 0.38), vary(1.24, 1.56), vary(0.045, 0.07), vary(0.26, 0.36)
    top = bow + long
    parts = []
    if "trefoil" in attributes:
        leaf = ring((0, 0, 0.62 * bow), 0.5 * bow, "x")
        parts += [turn(leaf, angle, "x") for angle in (0, 120, 240)]
        parts = [move(turn(join(*parts), 180, "x"), (0, 0, top))]
    elif "square" in attributes:
        parts += [rectangle((0, 0, top), (2 * size, 2 * size), "x") for size in (bow, 0.7 * bow)]
    else:
        parts += [ring((0, 0, top), size, "x") for size in (bow, 0.7 * bow)]
    shaft = lathe(line((thick, 0, 0), (thick, 0, long)), [(thick, 0), (thick, long), (1.6 * thick, long - 0.1)])
    parts.append(shaft)
    low, step = 0.08, 0.12
    teeth = [(thick, low), (bit, low), (bit, low + step), (0.55 * bit, low + step), (0.55 * bit, low + 2 * step)]
    teeth += [(bit, low + 2 * step), (bit, low + 3 * step), (thick, low + 3 * step)]
    parts.append(polyline(*[(0, y, z) for y, z in teeth]))
    if "loop" in attributes:
        parts.append(ring((0, 0, top + 1.3 * bow), 0.75 * bow, "y"))
    return parts


CATEGORY = Category(
    "key",
    _make,
    attributes=(
        Attribute("trefoil", ("ornate", "with a trefoil bow"), excludes=("square",)),
        Attribute("square", ("square", "with a square bow")),
        Attribute("loop", ("with a key ring", "with a ring")),
    ),
    parts=("teeth",),
    mirror="x",
    metres=0.08,
)
