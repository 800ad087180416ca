"""Glasses: two lenses, a bridge and two temples."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    filled,
    join,
    line,
    mirror,
    rectangle,
    reflect,
    ring,
    smooth,
    solid,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    lens, apart, long = vary(0.36, 0.46), vary(0.09, 0.16), vary(1.09, 1.41)
    y, tall = lens + apart, vary(0.22, 0.32)
    if "round" in attributes:
        tall = lens = 0.4
        frame = ring((0, y, 0), lens, "x")
    elif "square" in attributes:
        frame = rectangle((0, y, 0), (2 * lens, 2 * tall), "x")
    else:
        corners = ((-0.7, -1), (0.75, -0.9), (1, 0.75), (0, 1), (-1, 0.7))
        frame = smooth(*[(0, y + a * lens, b * tall) for a, b in corners], closed=True)
    parts = [mirror(frame)]
    parts.append(curve((0, -apart, 0.05), (0.06, -apart / 2, 0.14), (0.06, apart / 2, 0.14), (0, apart, 0.05)))
    hinge = y + lens
    temple = join(
        line((0, hinge, 0.05), (-0.8 * long, hinge, 0.05)),
        curve(
            (-0.8 * long, hinge, 0.05),
            (-long, hinge, 0.05),
            (-long - 0.1, hinge - 0.03, -0.1),
            (-long - 0.16, hinge - 0.05, -0.35),
        ),
    )
    parts.append(mirror(temple))
    if "tinted" in attributes:
        # One looks through the others.
        parts.append(mirror(solid(filled(frame))))
        for shift in (-0.25, 0.0, 0.25):
            a, b = shift * lens - 0.4 * tall, shift * lens + 0.4 * tall
            parts.append(line((0, -y + a, -0.5 * tall), (0, -y + b, 0.5 * tall)))
            parts.append(reflect(parts[-1]))
    return parts


CATEGORY = Category(
    "glasses",
    _make,
    synonyms=("spectacles", "eyeglasses", "eye glasses", "reading glasses"),
    attributes=(
        Attribute("round", ("round",), excludes=("square",)),
        Attribute("square", ("square",)),
        Attribute("tinted", ("tinted", "with dark lenses"), nouns=("sunglasses",)),
    ),
    pair=True,
    metres=0.15,
)
