"""Sailing boats: an open hull, a mast and triangular sails."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Strokes,
    curve,
    line,
    mirror,
    polyline,
    smooth,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Strokes]:
    long, half, deep = vary(1.09, 1.41), vary(0.36, 0.47), vary(0.34, 0.46)
    mast, boom = vary(1.81, 2.29), 0.25
    bow = (long, 0, 0.16)
    deck = curve(bow, (0.5 * long, 1.1 * half, 0), (-0.3 * long, 1.2 * half, -0.02), (-long, 0.7 * half, 0))
    bilge = curve(
        bow, (0.55 * long, 0.5 * half, -deep), (-0.3 * long, 0.6 * half, -deep), (-0.85 * long, 0.45 * half, -deep)
    )
    parts = [mirror(deck), mirror(bilge), mirror(line((-long, 0.7 * half, 0), (-0.85 * long, 0.45 * half, -deep)))]
    parts += [line((-long, -0.7 * half, 0), (-long, 0.7 * half, 0))]
    parts.append(line((-0.85 * long, -0.45 * half, -deep), (-0.85 * long, 0.45 * half, -deep)))
    foot = 0.2 * long
    if "square sail" in attributes:
        parts.append(line((0, 0, -deep / 2), (0, 0, mast)))
        wide, belly = 0.75, 0.3
        for z in (0.95 * mast, 0.35 * mast):
            parts.append(curve((0.05, -wide, z), (belly, -wide / 3, z), (belly, wide / 3, z), (0.05, wide, z)))
        side = curve(
            (0.05, wide, 0.95 * mast), (belly, wide, 0.75 * mast), (belly, wide, 0.55 * mast), (0.05, wide, 0.35 * mast)
        )
        parts.append(mirror(side))
        top, at = mast, 0.0
    else:
        parts.append(line((foot, 0, -deep / 2), (foot, 0, mast)))
        leech = curve(
            (foot, 0, mast), (-0.1 * long, 0, 0.75 * mast), (-0.75 * long, 0, 0.4 * mast), (-0.85 * long, 0, boom)
        )
        luff = curve(
            (foot, 0, 0.85 * mast), (0.4 * long, 0, 0.6 * mast), (0.8 * long, 0, 0.3 * mast), (0.95 * long, 0, 0.22)
        )
        parts += [leech, line((foot, 0, boom), (-0.85 * long, 0, boom)), luff]
        parts.append(
            curve((0.95 * long, 0, 0.22), (0.7 * long, 0, 0.2), (0.45 * long, 0, 0.25), (foot + 0.08, 0, 0.38))
        )
        top, at = mast, foot
    if "flag" in attributes:
        parts += [
            line((at, 0, top), (at, 0, top + 0.3)),
            polyline((at, 0, top + 0.3), (at - 0.45, 0, top + 0.2), (at, 0, top + 0.1)),
        ]
    if "waves" in attributes:
        for y in (0.75, 1.1):
            parts.append(mirror(smooth(*[(x * 0.4, y, -deep * 0.6 + 0.06 * (-1) ** x) for x in range(-3, 4)])))
    return parts


CATEGORY = Category(
    "sailing boat",
    _make,
    synonyms=("sailboat", "boat"),
    attributes=(
        Attribute("square sail", ("with a square sail",), nouns=("Viking ship",)),
        Attribute("flag", ("with a flag", "with a pennant")),
        Attribute("waves", ("with waves",)),
    ),
)
