"""Mushrooms: a cap on a stem."""

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
    ring,
    stretch,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    stem, tall, cap, high = vary(0.15, 0.21), vary(0.7, 0.94), vary(0.64, 0.84), vary(0.45, 0.61)
    foot = vary(1.21, 1.69) * stem
    leg = curve((foot, 0, 0), (0.9 * foot, 0, 0.3 * tall), (stem, 0, 0.5 * tall), (stem, 0, tall))
    dome = ellipse((0, 0, tall), (cap, 0, 0), (0, 0, high), 0, 90)
    if "pointed" in attributes:
        cap *= 0.7
        dome = curve((cap, 0, tall - 0.1), (0.75 * cap, 0, tall + 0.5), (0.2 * cap, 0, tall + 0.7), (0, 0, tall + 1.0))
    gill = curve(
        (cap, 0, tall if "pointed" not in attributes else tall - 0.1),
        (0.7 * cap, 0, tall + 0.12),
        (stem, 0, tall + 0.1),
        (stem, 0, tall),
    )
    parts = [
        lathe(join(leg, dome), [(foot, 0), (cap, tall - 0.1 * ("pointed" in attributes)), (stem, tall)], 6),
        around(gill, 2, "z"),
    ]
    if "spots" in attributes:
        for up, turned in ((28, 30), (28, 150), (28, 270), (60, 90), (60, 210), (60, 330)):
            spot = ring((1.0, 0, 0), 0.13, "x")
            spot = stretch(turn(turn(spot, up, "y"), turned), (cap, cap, high))
            parts.append(move(spot, (0, 0, tall)))
    if "ring" in attributes:
        parts.append(lathe(line((stem, 0, 0.8 * tall), (2 * stem, 0, 0.6 * tall)), [(2 * stem, 0.6 * tall)], 6))
    return parts


CATEGORY = Category(
    "mushroom",
    _make,
    synonyms=("toadstool",),
    attributes=(
        Attribute("spots", ("with spots", "spotted"), excludes=("pointed",)),
        Attribute("pointed", ("pointed", "with a pointed cap")),
        Attribute("ring", ("with a ring",)),
    ),
    parts=(
        "a cap",
        "a stem",
    ),
    mirror="x",
    metres=0.12,
)
