"""Rabbits, sitting: long ears, a round back and a ball of a tail."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, girth, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, ball, curve, ellipse, filled, line, mirror, ring, side, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, ear, long = vary(0.25, 0.3), vary(0.55, 0.75), vary(0.92, 1.1)
    x, top = 0.46 * long, 0.92
    parts = [ellipse((x, 0, top), (1.12 * r, 0, 0), (0, 0, r)), girth((x, top), 0.85 * r, r)]
    parts.append(ball((x, 0, top), (1.12 * r, 0.77 * r, r)))
    back = (
        (x - 0.9 * r, top - 0.3 * r),
        (0.02 * long, 0.84),
        (-0.42 * long, 0.72),
        (-0.66 * long, 0.34),
        (-0.5 * long, 0.02),
    )
    parts.append(side(*back))
    breast = (x + 0.2 * r, top - r), (0.46 * long, 0.45), (0.36 * long, 0.2)
    parts.append(side(*breast, (0.36 * long, 0.06), (0.54 * long, 0)))
    under = side(*breast, (0, 0.05), (-0.5 * long, 0.02))
    widths = (((0.4 * long, 0.7), 0.16), ((-0.2 * long, 0.4), 0.34), ((-0.5 * long, 0.1), 0.2))
    parts.append(torso(side(*back), under, *widths))
    parts.append(girth((-0.2 * long, 0.4), 0.36, 0.38))
    # Haunch with its long foot, and foreleg.
    foot = (0.12 * long, 0.28, 0.06)
    parts.append(mirror(curve(foot, (-0.1 * long, 0.3, 0.12), (0.16 * long, 0.38, 0.56), (-0.22 * long, 0.38, 0.56))))
    parts.append(
        mirror(
            curve(
                (-0.22 * long, 0.38, 0.56), (-0.58 * long, 0.38, 0.56), (-0.6 * long, 0.3, 0), (-0.36 * long, 0.28, 0)
            )
        )
    )
    parts.append(mirror(curve((-0.36 * long, 0.28, 0), (0, 0.28, 0), (0.2 * long, 0.28, -0.02), foot)))
    parts.append(
        mirror(
            curve(
                (0.44 * long, 0.12, 0.5), (0.44 * long, 0.14, 0.14), (0.46 * long, 0.14, 0.06), (0.54 * long, 0.14, 0)
            )
        )
    )
    parts.append(mirror(line((0.54 * long, 0.14, 0), (0.38 * long, 0.1, 0))))
    if "hanging ears" in attributes:
        flap = (
            (x, 0.3 * r, top + 0.9 * r),
            (x - 0.1, 1.0 * r, top + 0.9 * r),
            (x - 0.06, 1.3 * r, top - 0.1),
            (x + 0.06, 1.15 * r, top - 0.3),
            (x + 0.1, 0.9 * r, top + 0.1),
        )
        parts.append(mirror(filled(spline(*flap))))
    else:
        lean = 0.3
        tall = (
            (x + 0.1 * r, 0.1 * r, top + r),
            (x - 0.1 * lean, 0.1, top + r + 0.5 * ear),
            (x - lean, 0.26, top + r + ear),
            (x - 0.8 * lean, 0.34, top + r + 0.5 * ear),
            (x - 0.5 * r, 0.6 * r, top + 0.6 * r),
        )
        parts.append(mirror(filled(spline(*tall))))
    parts.append(eyes(x + 0.5 * r, 0.68 * r, top + 0.2 * r, 0.16 * r))
    parts.append(mirror(line((x + 1.12 * r, 0, top - 0.05 * r), (x + 1.0 * r, 0.2 * r, top + 0.12 * r))))
    parts.append(mirror(line((x + r, 0.2 * r, top - 0.2 * r), (x + 0.9 * r, 1.2 * r, top - 0.1 * r))))
    parts += [ball((-0.68 * long, 0, 0.22), 0.12), *(ring((-0.68 * long, 0, 0.22), 0.12, axis) for axis in ("y", "z"))]
    return parts


CATEGORY = Category(
    "rabbit",
    _make,
    synonyms=("bunny", "hare", "bunny rabbit", "Easter bunny"),
    attributes=(Attribute("hanging ears", ("with hanging ears", "with floppy ears", "lop-eared")),),
    parts=("a head", "ears", "long ears", "a tail", "whiskers", "eyes", "a nose"),
    metres=0.4,
    head=(0.82, 0.64, 0.28),
)
