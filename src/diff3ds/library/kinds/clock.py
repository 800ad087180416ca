"""Clocks: a round face with ticks and two hands."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    box,
    detail,
    ellipse,
    extrude,
    filled,
    join,
    line,
    mirror,
    move,
    polyline,
    ring,
    sheet,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    rim, deep = vary(0.77, 0.93), vary(0.1, 0.16)
    # About ten past ten, as in advertisements: the hands stay apart.
    minute = vary(4, 15)
    parts = [ring((x, 0, 0), rim, "x") for x in (0, -deep)]
    parts.append(sheet(*parts))
    tick = around(line((0, 0, 0.86 * rim), (0, 0, 0.97 * rim)), 12, "x")
    parts += [detail(tick), detail(ring((0, 0, 0), 0.05, "x"))]
    parts.append(turn(line((0, 0, 0), (0, 0, 0.5 * rim)), -30 * (10 + minute / 60), "x"))
    parts.append(turn(line((0, 0, 0), (0, 0, 0.78 * rim)), -6 * minute, "x"))
    if "square" in attributes:
        parts.append(box((-deep / 2, 0, 0), (deep, 2.15 * rim, 2.15 * rim)))
    if "alarm" in attributes:
        bell = join(
            filled(ellipse((0, 0, 0), (0, 0.34, 0), (0, 0, 0.3), 0, 180)),
            line((0, -0.34, 0), (0, 0.34, 0)),
            line((0, 0, 0), (0, 0, -0.12)),
        )
        bell = turn(move(bell, (-deep / 2, 0, rim + 0.12)), -32, "x")
        parts += [mirror(bell), mirror(line((-deep / 2, 0.5 * rim, -0.87 * rim), (-deep / 2, 0.7 * rim, -1.2 * rim)))]
    if "pendulum" in attributes:
        half, low = 1.15 * rim, -3.6 * rim
        parts.append(
            extrude(
                polyline(
                    (0, -half, low), (0, half, low), (0, half, half), (0, 0, 1.8 * rim), (0, -half, half), closed=True
                ),
                (-0.5, 0, 0),
            )
        )
        parts += [line((0, 0, -rim), (0, 0, -2.6 * rim)), ring((0, 0, -2.8 * rim), 0.2 * rim, "x")]
    return parts


CATEGORY = Category(
    "clock",
    _make,
    synonyms=("wall clock",),
    attributes=(
        Attribute("square", ("square", "with a square case"), excludes=("alarm", "pendulum")),
        Attribute("alarm", ("alarm", "with bells"), excludes=("pendulum",)),
        Attribute("pendulum", ("with a pendulum",), nouns=("grandfather clock",)),
    ),
    parts=("hands",),
    mirror=None,
    metres=0.35,
)
