"""Sailing boats: an open hull, a mast and triangular sails."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, filled, join, line, mirror, polyline, reflect, sheet, smooth, solid


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, half, deep, top = vary(1.09, 1.41), vary(0.36, 0.47), vary(0.34, 0.46), vary(1.81, 2.29)
    mast = 0.0 if "square sail" in attributes else 0.2 * long
    parts = [*_hull(long, half, deep), line((mast, 0, -deep / 2), (mast, 0, top))]
    if "square sail" in attributes:
        wide, high, low = 0.75, 0.95 * top, 0.35 * top
        yards = [curve((0.05, -wide, z), (0.3, -wide / 3, z), (0.3, wide / 3, z), (0.05, wide, z)) for z in (high, low)]
        parts += [*yards, sheet(*yards)]
        bulge = [(0.3, wide, high + (low - high) * share) for share in (1 / 3, 2 / 3)]
        parts.append(mirror(curve((0.05, wide, high), *bulge, (0.05, wide, low))))
    else:
        back, front, boom = -0.85 * long, 0.95 * long, 0.25
        leech = curve((mast, 0, top), (-0.1 * long, 0, 0.75 * top), (-0.75 * long, 0, 0.4 * top), (back, 0, boom))
        parts += [line((mast, 0, boom), (back, 0, boom)), leech]
        parts.append(solid(filled(join(line((mast, 0, boom), (mast, 0, top)), leech))))
        jib = [(0.4 * long, 0, 0.6 * top), (0.8 * long, 0, 0.3 * top)]
        stay = curve((mast, 0, 0.85 * top), *jib, (front, 0, 0.22))
        foot = curve((front, 0, 0.22), (0.7 * long, 0, 0.2), (0.45 * long, 0, 0.25), (mast + 0.08, 0, 0.38))
        parts += [stay, foot, solid(filled(join(stay, foot)))]
    if "flag" in attributes:
        parts.append(line((mast, 0, top), (mast, 0, top + 0.3)))
        parts.append(filled(polyline((mast, 0, top + 0.3), (mast - 0.45, 0, top + 0.2), (mast, 0, top + 0.1))))
    if "waves" in attributes:
        for y in (0.75, 1.1):
            parts.append(mirror(smooth(*[(x * 0.4, y, -deep * 0.6 + 0.06 * (-1) ** x) for x in range(-3, 4)])))
    return parts


def _hull(long: float, half: float, deep: float) -> list[Part]:
    bow, deck, keel = (long, 0, 0.16), (-long, 0.7 * half, 0), (-0.85 * long, 0.45 * half, -deep)
    gunwale = curve(bow, (0.5 * long, 1.1 * half, 0), (-0.3 * long, 1.2 * half, -0.02), deck)
    bilge = curve(bow, (0.55 * long, 0.5 * half, -deep), (-0.3 * long, 0.6 * half, -deep), keel)
    transom = line(deck, keel)
    return [
        mirror(gunwale),
        mirror(bilge),
        mirror(transom),
        # Sides, bottom and stern; one looks in from above.
        mirror(sheet(gunwale, bilge)),
        sheet(bilge, reflect(bilge)),
        sheet(transom, reflect(transom)),
        *(line((x, -y, z), (x, y, z)) for x, y, z in (deck, keel)),
    ]


CATEGORY = Category(
    "sailing boat",
    _make,
    synonyms=("sailboat", "sail boat", "sailing ship", "boat", "yacht", "sailing yacht"),
    attributes=(
        Attribute("square sail", ("with a square sail",), nouns=("Viking ship", "pirate ship", "galleon")),
        Attribute("flag", ("with a flag", "with a pennant")),
        Attribute("waves", ("with waves",)),
    ),
    parts=(
        "a mast",
        "a sail",
        "a hull",
    ),
    metres=8,
)
