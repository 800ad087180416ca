"""Ducks, swimming: a boat of a body with a turned-up tail, an S of a neck and a flat bill."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, girth, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, ball, curve, ellipse, join, mirror, side, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, neck, wide = vary(0.24, 0.3), vary(0.78, 0.95), vary(0.36, 0.46)
    x = 0.62
    if "long neck" in attributes:
        r, neck = 0.17, 1.45
        nape = [(x - r, neck), (x - 0.3, 0.9), (x - 0.1, 0.5), (0.1, 0.42), (-0.6, 0.4)]
        throat = [(x + 0.3 * r, neck - r), (x - 0.06, 0.9), (0.74, 0.4)]
    else:
        nape = [(x - r, neck), (x - 0.9 * r, neck - 0.7 * r), (0.16, 0.4), (-0.6, 0.36)]
        throat = [(x + 0.6 * r, neck - 0.85 * r), (0.82, 0.3)]
    nape = [(x - 0.2 * r, neck + r), *nape, (-0.95, 0.6)]
    throat = [(x + 0.9 * r, neck - 0.3 * r), *throat, (0.76, 0.02)]
    keel = curve((0.76, 0, 0.02), (0.5, 0, -0.3), (-0.7, 0, -0.36), (-0.95, 0, 0.6))
    parts = [side(*nape), side(*throat), keel]
    parts.append(
        torso(
            parts[0],
            join(parts[1], keel),
            ((x + 0.3 * r, neck + 0.4 * r), 0.7 * r),
            ((x, neck - 0.1 * r), 0.8 * r),
            ((x - 0.1, 0.5), 0.6 * r),
            ((0.3, 0.12), 0.85 * wide),
            ((-0.3, 0.1), 0.85 * wide),
            ((-0.9, 0.55), 0.02),
        )
    )
    parts.append(ball((x, 0, neck), (0.95 * r, 0.82 * r, 0.97 * r)))
    parts.append(mirror(curve((0.8, 0, 0.14), (0.6, 1.3 * wide, 0.1), (-0.5, 1.3 * wide, 0.1), (-0.95, 0, 0.6))))
    parts += [girth((0.05, 0.1), 0.95 * wide, 0.31), girth((x, neck), 0.85 * r, r)]
    # The bill: two lips and how they widen.
    tip = (x + 0.9 * r + 0.36, 0, neck - 0.32 * r)
    parts.append(
        curve(
            (x - 0.2 * r, 0, neck + r),
            (x + 0.5 * r, 0, neck + r),
            (x + 0.9 * r, 0, neck + 0.5 * r),
            (x + 0.95 * r, 0, neck),
        )
    )
    parts.append(
        curve((x + 0.95 * r, 0, neck), (x + r + 0.1, 0, neck - 0.15 * r), (x + r + 0.2, 0, neck - 0.2 * r), tip)
    )
    parts.append(
        curve((x + 0.9 * r, 0, neck - 0.3 * r), (x + r + 0.1, 0, neck - 0.5 * r), (x + r + 0.2, 0, neck - 0.5 * r), tip)
    )
    parts.append(
        mirror(
            curve(
                (x + 0.85 * r, 0.3 * r, neck - 0.2 * r),
                (x + r + 0.12, 0.4 * r, neck - 0.3 * r),
                (x + r + 0.36, 0.5 * r, neck - 0.3 * r),
                tip,
            )
        )
    )
    parts.append(eyes(x + 0.35 * r, 0.75 * r, neck + 0.3 * r, 0.15 * r))
    wing = ((0.36, wide, 0.28), (0.1, 1.05 * wide, 0.0), (-0.4, 0.9 * wide, 0.08), (-0.8, 0.5 * wide, 0.5))
    parts.append(mirror(spline(*wing)))
    parts.append(
        mirror(curve((0.36, wide, 0.28), (0.1, 0.9 * wide, 0.46), (-0.4, 0.8 * wide, 0.36), (-0.8, 0.5 * wide, 0.5)))
    )
    if "water" in attributes:
        parts += [ellipse((-0.1, 0, -0.06), (size, 0, 0), (0, 0.7 * size, 0)) for size in (1.15, 1.5)]
    return parts


CATEGORY = Category(
    "duck",
    _make,
    synonyms=("duckling", "rubber duck", "goose"),
    attributes=(
        Attribute("long neck", ("with a long neck", "long-necked"), nouns=("swan",)),
        Attribute("water", ("with water", "swimming", "with ripples")),
    ),
    parts=("a head", "a beak", "a bill", "wings", "a tail", "eyes", "feathers"),
    metres=0.5,
    carries=0.45,
    head=(0.72, 0.96, 0.3),
)
