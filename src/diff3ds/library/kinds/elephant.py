"""Elephants: a trunk, large ears, tusks, and legs like columns."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, girth, legs, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, filled, flesh, mirror, side, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, high, ear = vary(0.92, 1.1), vary(1.24, 1.4), vary(0.9, 1.15)
    x, z = 0.78 * long, high - 0.08
    back = (
        (x + 0.36, z - 0.12),
        (x + 0.2, z + 0.16),
        (x - 0.06, z + 0.2),
        (0.5 * long, high),
        (0, high + 0.1),
        (-0.6 * long, high - 0.06),
        (-0.9 * long, 0.78),
    )
    parts = [side(*back)]
    if "raised trunk" in attributes:
        outer = ((x + 0.36, z - 0.12), (x + 0.5, z - 0.3), (x + 0.72, z - 0.1), (x + 0.78, z + 0.3), (x + 0.7, z + 0.5))
        inner = (
            (x + 0.14, z - 0.45),
            (x + 0.5, z - 0.56),
            (x + 0.84, z - 0.24),
            (x + 0.9, z + 0.3),
            (x + 0.82, z + 0.54),
        )
    else:
        outer = ((x + 0.36, z - 0.12), (x + 0.5, z - 0.55), (x + 0.5, 0.3), (x + 0.64, 0.16), (x + 0.74, 0.24))
        inner = ((x + 0.14, z - 0.45), (x + 0.3, z - 0.7), (x + 0.34, 0.3), (x + 0.6, 0.02), (x + 0.84, 0.16))
    trunk = side(*outer), side(*inner)
    parts += [*trunk, side(outer[-1], inner[-1]), flesh(*trunk, 0.17, 0.09, 0.06)]
    under = side((x + 0.14, z - 0.45), (x - 0.12, z - 0.5), (0.52 * long, 0.62), (0, 0.5), (-0.5 * long, 0.56))
    widths = (((x + 0.2, z - 0.2), 0.19), ((x, z - 0.14), 0.24), ((0.3 * long, 0.9), 0.45), ((-0.5 * long, 0.85), 0.4))
    parts += [under, torso(parts[0], under, *widths)]
    parts.append(legs((0.66 * long, 0.72), (0.3 * long, 0.53), 0.46 * long, 0.15, 0.28, thick=0.08))
    parts.append(legs((-0.42 * long, 0.54), (-0.9 * long, 0.78), -0.7 * long, 0.15, 0.28, thick=0.08))
    parts += [girth((0.1 * long, 0.92), 0.48, 0.45), girth((x + 0.05, z - 0.14), 0.26, 0.32)]
    flap = [
        (x + 0.02, 0.24, z + 0.08),
        (x - 0.16 * ear, 0.5 * ear, z + 0.2),
        (x - 0.4 * ear, 0.62 * ear, z - 0.1),
        (x - 0.26 * ear, 0.5 * ear, z - 0.5),
        (x - 0.04, 0.26, z - 0.36),
    ]
    parts.append(mirror(filled(spline(*flap))))
    parts.append(eyes(x + 0.24, 0.2, z - 0.02, 0.04))
    for drop in (0.0, 0.09):
        root, tip = (x + 0.22, 0.16, z - 0.42 - drop), (x + 0.66, 0.24, z - 0.52)
        parts.append(mirror(curve(root, (x + 0.34, 0.2, z - 0.64 - drop), (x + 0.52, 0.24, z - 0.68), tip)))
    parts.append(curve((-0.86 * long, 0, 0.92), (-1.0 * long, 0, 0.8), (-1.0 * long, 0, 0.6), (-0.98 * long, 0, 0.42)))
    return parts


CATEGORY = Category(
    "elephant",
    _make,
    synonyms=("baby elephant",),
    attributes=(Attribute("raised trunk", ("with a raised trunk", "with its trunk up", "trumpeting")),),
    parts=("a head", "a trunk", "tusks", "ears", "big ears", "legs", "four legs", "a tail"),
    metres=4.5,
    carries=0.9,
    head=(0.68, 0.97, 0.4),
)
