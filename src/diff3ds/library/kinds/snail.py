"""Snails: a spiral shell on a long foot, horns with eyes."""

import math
from collections.abc import Collection

from diff3ds.library.animals import torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    ball,
    curve,
    ellipse,
    join,
    lathe,
    line,
    mirror,
    move,
    ring,
    side,
    solid,
    spline,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    size, turns, wide = vary(0.56, 0.66), vary(2.1, 2.5), vary(0.26, 0.34)
    middle = (-0.2, 0, 0.2 + size)
    spiral = []
    for i in range(13):
        t = i / 12
        angle, r = math.radians(-100) + math.tau * turns * t, size * (1 - t) ** 0.8 + 0.03
        spiral.append((middle[0] + r * math.cos(angle), wide * t, middle[2] + r * math.sin(angle)))
    parts = [mirror(spline(*spiral)[:12])]
    parts += [ellipse(middle, (0, wide, 0), (0, 0, size))]
    # Cones to both sides, of which the spiral is drawn.
    cone = solid(lathe(line((size, 0, 0), (0.03, 0, wide)), []))
    parts.append(mirror(move(turn(cone, -90, "x"), middle)))
    foot = ((1.02, 0.62), (0.98, 0.3), (1.06, 0.06), (0.4, 0.0), (-0.6, 0.0), (-1.1, 0.02))
    parts.append(side(*foot))
    parts.append(side((1.02, 0.62), (0.78, 0.66), (0.6, 0.4), (0.36, 0.24)))
    back = side((1.02, 0.62), (0.78, 0.66), (0.6, 0.4), (0.36, 0.24), (-0.5, 0.2), (-0.8, 0.14), (-1.1, 0.02))
    widths = (((1.0, 0.6), 0.05), ((0.86, 0.35), 0.14), ((0.3, 0.12), 0.19), ((-0.5, 0.1), 0.17), ((-1.1, 0.02), 0.01))
    parts.append(torso(back, parts[-2], *widths))
    parts.append(side((-0.5, 0.2), (-0.8, 0.14), (-1.1, 0.02)))
    parts.append(mirror(curve((1.06, 0, 0.06), (0.8, 0.26, 0), (-0.4, 0.26, 0), (-1.1, 0, 0.02))))
    parts.append(mirror(curve((0.94, 0.05, 0.64), (0.96, 0.08, 0.76), (1.06, 0.14, 0.86), (1.1, 0.16, 0.98))))
    parts.append(mirror(join(ring((1.1, 0.16, 1.02), 0.045, "y"), ball((1.1, 0.16, 1.02), 0.045))))
    if "trail" in attributes:
        parts.append(mirror(curve((-1.1, 0, 0.02), (-1.4, 0.16, 0), (-1.7, 0.16, 0), (-2.0, 0.1, 0))))
    return parts


CATEGORY = Category(
    "snail",
    _make,
    attributes=(Attribute("trail", ("with a trail", "with a trail of slime")),),
    parts=("a head", "a shell", "horns", "eyes", "feelers"),
    metres=0.08,
    head=(0.88, 0.48, 0.2),
)
