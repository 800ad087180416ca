"""Turtles: a vaulted shell with plates, four short legs, a head on a neck."""

import math
from collections.abc import Collection

from diff3ds.library.animals import eyes
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    ellipse,
    flesh,
    lathe,
    line,
    mirror,
    move,
    polyline,
    sheet,
    side,
    solid,
    spline,
    stretch,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, wide, high = vary(0.8, 0.92), vary(0.6, 0.72), vary(0.46, 0.58)
    rim = 0.2
    parts = [ellipse((0, 0, rim), (long, 0, 0), (0, wide, 0))]
    parts.append(ellipse((0, 0, rim), (long, 0, 0), (0, 0, high), 0, 180))
    parts.append(ellipse((0, 0, rim), (0, wide, 0), (0, 0, high), 0, 180))
    # A little lower, for the edges of the plates are straight.
    vault = lathe(ellipse((0, 0, 0), (1, 0, 0), (0, 0, 1), 0, 90), [])
    parts.append(move(stretch(solid(vault), (0.95 * long, 0.95 * wide, 0.95 * high)), (0, 0, rim)))
    # The plates on top: a hexagon on the vault, with ribs down to the rim.
    level = math.sin(math.radians(50))
    six = [
        (0.64 * long * math.cos(a), 0.64 * wide * math.sin(a), rim + level * high)
        for a in (math.tau * i / 6 for i in range(6))
    ]
    parts.append(polyline(*six, closed=True))
    for x, y, z in (six[1], six[2]):
        end = (long * x / (0.64 * long) * 0.98, wide * y / (0.64 * wide) * 0.98, rim)
        parts.append(
            mirror(curve((x, y, z), (1.25 * x, 1.25 * y, z - 0.08), (0.97 * end[0], 0.97 * end[1], rim + 0.16), end))
        )
    brow = side((0.9 * long, rim), (long + 0.14, 0.34), (long + 0.3, 0.5), (long + 0.48, 0.42))
    chin = side((0.9 * long, rim - 0.06), (long + 0.2, 0.2), (long + 0.46, 0.28), (long + 0.48, 0.42))
    parts.append(flesh(brow, chin, 0.06, 0.07, 0.08, 0.1, 0.02))
    parts.append(
        side(
            (long, rim),
            (long + 0.14, 0.34),
            (long + 0.3, 0.5),
            (long + 0.48, 0.42),
            (long + 0.46, 0.28),
            (long + 0.2, 0.2),
            (0.9 * long, rim - 0.06),
        )
    )
    parts.append(
        mirror(curve((long + 0.48, 0, 0.42), (long + 0.44, 0.14, 0.44), (long + 0.3, 0.16, 0.42), (long, 0.06, rim)))
    )
    parts.append(eyes(long + 0.36, 0.1, 0.44, 0.035))
    for x, toward in ((0.55 * long, 0.22), (-0.55 * long, -0.2)):
        if "flippers" in attributes:
            a, tip = (x, 0.8 * wide, rim), (x + toward - 0.25, 0.8 * wide + (0.7 if toward > 0 else 0.35), 0.1)
            flipper = [
                curve(a, (x + 0.3, 0.9 * wide, rim), (tip[0] + 0.3, tip[1], 0.12), tip),
                curve((x - 0.2, 0.8 * wide, rim), (x - 0.1, 0.9 * wide, rim), (tip[0], tip[1] - 0.2, 0.12), tip),
            ]
            parts += [mirror(part) for part in (*flipper, sheet(*flipper))]
        else:
            parts.append(
                mirror(
                    spline(
                        (x + 0.12, 0.72 * wide, rim),
                        (x + 0.16 + toward, 0.82 * wide, 0.04),
                        (x + toward, 0.9 * wide, 0.0),
                        (x - 0.12, 0.78 * wide, rim),
                    )
                )
            )
    parts.append(mirror(line((-long, 0.05, rim), (-long - 0.2, 0, 0.12))))
    return parts


CATEGORY = Category(
    "turtle",
    _make,
    synonyms=("tortoise",),
    attributes=(Attribute("flippers", ("with flippers", "swimming"), nouns=("sea turtle",)),),
    parts=("a head", "a shell", "legs", "four legs", "a tail", "eyes"),
    metres=0.5,
    head=(0.96, 0.72, 0.35),
)
