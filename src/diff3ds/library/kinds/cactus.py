"""Cacti: a ribbed column with two arms, or flat pads."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    curve,
    ellipse,
    join,
    lathe,
    line,
    move,
    reflect,
    ring,
    stretch,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    tall, thick = vary(1.62, 2.02), vary(0.23, 0.3)
    if "pads" in attributes:
        size, left, right = 1.6 * thick, vary(28, 47), vary(28, 47)
        pads = [
            (size, 0.0, 0.0, 0, 0),
            (0.7 * size, 0.75 * size, 2.0 * size, right, 15),
            (0.75 * size, -0.75 * size, 1.9 * size, -left, -15),
        ]
        pads += [(0.55 * size, 0.1 * size, 2.7 * size, 3, 0), (0.5 * size, -1.75 * size, 3.1 * size, -5, 20)]
        parts, top = [_pad(*pad) for pad in pads], 4.15 * size
    else:
        top = tall + thick
        rib = join(line((thick, 0, 0), (thick, 0, tall)), ring((0, 0, tall), thick, "y", 0, 90))
        parts = [lathe(rib, [(thick, 0.0)], 6)]
        for side, low, high in ((1, vary(0.56, 0.8), vary(1.24, 1.56)), (-1, vary(0.76, 0.99), vary(1.44, 1.76))):
            arm = _arm(thick, low, high)
            parts.append(arm if side > 0 else reflect(arm))
    if "flower" in attributes:
        petal = curve((0, 0, top), (0.3, 0.12, top + 0.05), (0.3, -0.12, top + 0.4), (0.05, 0, top + 0.3))
        parts.append(around(petal, 6))
    if "pot" in attributes:
        parts.append(lathe(line((0.36, 0, -0.55), (0.5, 0, 0.0)), [(0.36, -0.55), (0.5, 0.0)], 4, 45))
    return parts


def _pad(half: float, y: float, z: float, lean: float, twist: float) -> Part:
    """An upright oval with spines that stands on (0, y, z), leaning to the right and turned around its length."""
    oval = ellipse((0, 0, 1.35 * half), (0, half, 0), (0, 0, 1.35 * half))
    spine = line((0, 0, 1.25), (0, 0, 1.5))
    spines = stretch(join(*(turn(spine, angle, "x") for angle in (-100, -50, 50, 100))), (1, 0.75 * half, half))
    return move(turn(turn(join(oval, move(spines, (0, 0, 1.35 * half))), twist), -lean, "x"), (0, y, z))


def _arm(thick: float, low: float, high: float) -> Part:
    """An arm to the right: an elbow and a column with a round top."""
    radius, y = 0.14, thick + 0.34
    outer = curve((0, thick, low - radius), (0, y, low - radius), (0, y + radius, low), (0, y + radius, low + 0.3))
    inner = curve(
        (0, thick, low + radius), (0, y - radius, low + radius), (0, y - radius, low + 0.15), (0, y - radius, low + 0.3)
    )
    rib = join(line((radius, 0, low + 0.3), (radius, 0, high)), ring((0, 0, high), radius, "y", 0, 90))
    return join(outer, inner, move(around(rib, 4), (0, y, 0)))


CATEGORY = Category(
    "cactus",
    _make,
    attributes=(
        Attribute("pads", ("with flat pads",), nouns=("prickly pear",)),
        Attribute("flower", ("with a flower", "flowering")),
        Attribute("pot", ("with a pot", "potted")),
    ),
    mirror=None,
    metres=1.2,
)
