"""Pumpkins: a flat ball of ribs with a bent stalk."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    curve,
    flesh,
    join,
    lathe,
    line,
    mirror,
    polyline,
    reflect,
    ring,
    solid,
    stretch,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, high, stalk = vary(0.85, 1.0), vary(0.6, 0.72), vary(0.26, 0.4)
    rib = join(
        curve((0.1, 0, 0.86 * high), (0.3, 0, 1.25 * high), (wide, 0, 1.1 * high), (wide, 0, 0)),
        curve((wide, 0, 0), (wide, 0, -1.1 * high), (0.3, 0, -1.2 * high), (0.1, 0, -0.86 * high)),
    )
    # The face is cut in flatter than the ribs bulge.
    within = 0.85 if "face" in attributes else 1.0
    bulge = stretch(solid(lathe(rib, [])), (within, within, 1))
    parts = [around(rib, 10), bulge, ring((0, 0, 0.86 * high), 0.1), ring((0, 0, -0.86 * high), 0.1)]
    top = 0.86 * high
    # The stalk bends backwards.
    tip = (-0.2, 0.07, top + stalk)
    edge = curve((0, 0.08, top), (0, 0.08, top + 0.5 * stalk), (-0.08, 0.07, top + 0.9 * stalk), tip)
    parts += [mirror(edge), flesh(edge, reflect(edge), 0.07)]
    parts.append(line((-0.2, -0.07, top + stalk), tip))
    if "face" in attributes:
        x = 0.93 * wide
        parts.append(mirror(polyline((0.96 * x, 0.14, 0.1), (0.9 * x, 0.4, 0.1), (0.88 * x, 0.26, 0.34), closed=True)))
        parts.append(polyline((x, -0.07, -0.04), (x, 0.07, -0.04), (x, 0, 0.1), closed=True))
        smile = ((0, -0.24), (0.14, -0.24), (0.24, -0.12), (0.3, -0.2), (0.46, -0.16))
        parts.append(mirror(polyline(*((0.88 * x, y, z) for y, z in smile))))
        parts.append(
            curve((0.88 * x, 0.46, -0.16), (0.95 * x, 0.3, -0.5), (0.95 * x, -0.3, -0.5), (0.88 * x, -0.46, -0.16))
        )
    return parts


CATEGORY = Category(
    "pumpkin",
    _make,
    synonyms=("Halloween pumpkin",),
    attributes=(Attribute("face", ("with a face", "carved"), nouns=("jack o lantern",)),),
    parts=("a stalk", "a stem", "ribs"),
    metres=0.35,
)
