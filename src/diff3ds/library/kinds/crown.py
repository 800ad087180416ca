"""Crowns: a band with points all around and balls on them."""

import math
from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, ball, curve, filled, join, lathe, polyline, ring, solid, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, flare, band, high = vary(0.72, 0.82), vary(1.1, 1.25), vary(0.2, 0.28), vary(0.75, 0.95)
    count = 8
    parts = [ring((0, 0, 0), r), ring((0, 0, band), 1.03 * r)]
    # Its sides, of gold up to the notches between the points; one looks in at the top.
    parts.append(solid(lathe(polyline((r, 0, 0), (1.03 * r, 0, band), (1.06 * r, 0, band + 0.1)), [], open=True)))
    half = math.pi / count
    low = (1.06 * r * math.cos(half), 1.06 * r * math.sin(half), band + 0.1)
    tip = (flare * r, 0, high)
    parts.append(around(filled(polyline((low[0], -low[1], low[2]), tip, low)), count))
    top = (flare * r, 0, high + 0.06)
    parts.append(around(join(ring(top, 0.06, "x"), ball(top, 0.06)), count))
    if "jewels" in attributes:
        parts.append(around(ring((1.02 * r, 0, band / 2), 0.07, "x"), 4))
    if "arches" in attributes:
        arch = curve((r, 0, band), (1.3 * r, 0, 1.7 * high), (-1.3 * r, 0, 1.7 * high), (-r, 0, band))
        parts += [arch, turn(arch, 90)]
    return parts


CATEGORY = Category(
    "crown",
    _make,
    synonyms=("tiara", "golden crown"),
    attributes=(Attribute("jewels", ("with jewels", "with gems")), Attribute("arches", ("with arches",))),
    parts=("points",),
    metres=0.25,
    worn=1.1,
)
