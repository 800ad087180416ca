"""Bridges: a deck across an arch, or hung from the cables of two towers."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    ellipse,
    line,
    mirror,
    rectangle,
    reflect,
    sheet,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, deep, rise = vary(1.61, 2.09), vary(0.27, 0.43), vary(0.54, 0.86)
    parts = [rectangle((0, 0, z), (2 * deep, 2 * half)) for z in (rise, rise + 0.1)]
    parts.append(sheet(*parts))
    deck = rise + 0.1
    if "suspension" in attributes:
        y, top = 0.58 * half, deck + vary(0.74, 1.06)
        parts.append(mirror(line((deep, y, 0), (deep, y, top)), "x", "y"))
        parts.append(mirror(line((-deep, y, top), (deep, y, top))))
        # The parabola with its vertex on the deck, and chords to the ends.
        low = 2 * (deck + 0.05) - top
        third = low + (top - low) / 3
        parts.append(mirror(curve((deep, -y, top), (deep, -y / 3, third), (deep, y / 3, third), (deep, y, top)), "x"))
        parts.append(mirror(line((deep, y, top), (deep, half, deck)), "x", "y"))
        for share in (0.33, 0.66):
            z = deck + 0.05 + (top - deck - 0.05) * share**2
            parts.append(mirror(line((deep, share * y, deck), (deep, share * y, z)), "x", "y"))
    else:
        foot = 0.85 * half
        arch = ellipse((deep, 0, 0), (0, foot, 0), (0, 0, rise), 0, 180)
        parts += [mirror(arch, "x"), sheet(arch, reflect(arch, "x"))]
        parts.append(mirror(line((-deep, foot, 0), (deep, foot, 0))))
        for share in (0.45, 0.8):
            z = rise * (1 - share**2) ** 0.5
            parts.append(mirror(line((deep, share * foot, z), (deep, share * foot, rise)), "x", "y"))
    if "railing" in attributes:
        parts.append(mirror(line((deep, -half, deck + 0.25), (deep, half, deck + 0.25)), "x"))
        for share in (0.25, 0.625, 1.0):
            parts.append(mirror(line((deep, share * half, deck), (deep, share * half, deck + 0.25)), "x", "y"))
    if "river" in attributes:
        for x in (-0.8, 0.0, 0.8):
            wave = curve((x, 0, 0), (x + 0.15, 0.2, 0), (x - 0.15, 0.4, 0), (x, 0.6, 0))
            parts.append(mirror(wave))
    return parts


CATEGORY = Category(
    "bridge",
    _make,
    attributes=(
        Attribute("suspension", ("suspension", "with two towers")),
        Attribute("railing", ("with railings", "with a railing")),
        Attribute("river", ("with a river",)),
    ),
    metres=40,
)
