"""Balls, with a seam like a tennis ball's or with the panels of a football."""

import math
from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, Vector, around, ball, ellipse, mirror, ring


def _seam(a: Vector, b: Vector) -> Part:
    """The shortest way from one point of the ball to another along it: a chord would be inside."""
    straight = sum(here * there for here, there in zip(a, b, strict=True))
    beside = math.sqrt(1 - straight**2)
    across = [(there - straight * here) / beside for here, there in zip(a, b, strict=True)]
    return ellipse((0, 0, 0), a, across, 0, math.degrees(math.acos(straight)))


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    seam, tilt = vary(0.36, 0.5), vary(0.5, 0.62)
    parts = [ball((0, 0, 0), 1.0), *(ring((0, 0, 0), 1, axis) for axis in ("x", "y", "z"))]
    if "panels" in attributes:
        # A five-cornered panel above and one below, with seams between.
        high, wide = math.sqrt(1 - tilt**2), tilt
        for sign in (1, -1):
            corners = [
                (wide * math.cos(a), wide * math.sin(a), sign * high) for a in (math.tau * i / 5 for i in range(5))
            ]
            parts += [_seam(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        parts.append(around(_seam((wide, 0, high), (wide, 0, -high)), 5))
    elif "stripes" in attributes:
        parts += [ring((0, 0, z), math.sqrt(1 - z * z)) for z in (-seam, seam)]
    else:
        # Four half circles on the ball, two up and two down, which meet upright.
        away = math.sqrt(0.5)
        parts.append(mirror(ring((away, 0, 0), away, "x", 0, 180), "x"))
        parts.append(mirror(ring((0, away, 0), away, "y", 180, 360), "y"))
    return parts


CATEGORY = Category(
    "ball",
    _make,
    synonyms=("tennis ball", "beach ball", "toy ball"),
    attributes=(
        Attribute("panels", ("with panels",), nouns=("football", "soccer ball"), excludes=("stripes",)),
        Attribute("stripes", ("with stripes", "striped")),
    ),
    metres=0.24,
)
