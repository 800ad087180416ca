"""Churches: a nave under a gable roof and a tower with a spire and a cross before it."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    box,
    detail,
    ellipse,
    extrude,
    join,
    line,
    mirror,
    move,
    polyline,
    ring,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, long, eaves, ridge = vary(0.47, 0.63), vary(1.21, 1.69), vary(0.7, 0.94), vary(1.19, 1.51)
    wide, tower, spire = vary(0.22, 0.32), vary(1.53, 1.93), vary(0.81, 1.29)
    gable = polyline((0, -half, 0), (0, half, 0), (0, half, eaves), (0, 0, ridge), (0, -half, eaves), closed=True)
    parts = [extrude(gable, (-long, 0, 0))]
    steeple = [box((0, 0, tower / 2), (2 * wide, 2 * wide, tower))]
    if "dome" in attributes:
        steeple += [
            ring((0, 0, tower), wide),
            ring((0, 0, tower), wide, "x", 0, 180),
            ring((0, 0, tower), wide, "y", 0, 180),
        ]
        peak = tower + wide
    else:
        steeple.append(mirror(line((wide, wide, tower), (0, 0, tower + spire)), "x", "y"))
        peak = tower + spire
    steeple += [line((0, 0, peak), (0, 0, peak + 0.36)), line((0, -0.12, peak + 0.24), (0, 0.12, peak + 0.24))]
    if "clock" in attributes:
        z = tower - 0.3
        steeple += [ring((wide, 0, z), 0.17, "x"), line((wide, 0, z - 0.08), (wide, 0, z + 0.13))]
    if "two towers" in attributes:
        parts.append(mirror(move(join(*steeple), (0.1, half, 0))))
        front = 0.0
    else:
        parts.append(move(join(*steeple), (wide, 0, 0)))
        front = 2 * wide
    parts.append(detail(ellipse((front, 0, 0), (0, 0.15, 0), (0, 0, 0.6), 0, 180)))
    for x in (-0.3 * long, -0.7 * long):
        parts.append(detail(mirror(ellipse((x, half, 0.2), (0.1, 0, 0), (0, 0, 0.4), 0, 180))))
    return parts


CATEGORY = Category(
    "church",
    _make,
    synonyms=("chapel",),
    attributes=(
        Attribute("dome", ("with a dome", "domed")),
        Attribute("two towers", ("with two towers",), nouns=("cathedral",)),
        Attribute("clock", ("with a clock",)),
    ),
    parts=(
        "a door",
        "windows",
        "a cross",
    ),
    metres=30,
)
