"""Balls, with a seam like a tennis ball's or with the panels of a football."""

import math
from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, Vector, around, ball, ellipse, mirror, reflect, ring, turn


def _seam(a: Vector, b: Vector) -> Part:
    """The shortest way from one point of the ball to another along it: a chord would be inside."""
    straight = sum(here * there for here, there in zip(a, b, strict=True))
    beside = math.sqrt(1 - straight**2)
    across = [(there - straight * here) / beside for here, there in zip(a, b, strict=True)]
    return ellipse((0, 0, 0), a, across, 0, math.degrees(math.acos(straight)))


def _bow(high: float) -> Part:
    """The circle on the ball from one corner of a square around its middle to the next, over a point so high.

    Half a turn about a corner makes a bow up one down: they meet smoothly, however high.
    """
    corner = math.sqrt(0.5)
    rise = (math.sqrt(1 - high**2) - corner, high)
    along = [part / math.hypot(*rise) for part in rise]
    below = corner * along[0]
    x, z = corner - below * along[0], -below * along[1]
    radius = math.sqrt(1 - x**2 - z**2)
    half = math.degrees(math.atan2(corner, below))
    return ellipse((x, 0, z), (radius * along[0], 0, radius * along[1]), (0, radius, 0), -half, half)


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
        up = mirror(_bow(seam), "x")
        parts += [up, reflect(turn(up, 90), "z")]
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
