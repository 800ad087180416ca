"""Birds, small ones: a round breast, a short beak, folded or spread wings, a long tail."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, girth, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, filled, join, line, mirror, polyline, side, solid, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    tail, plump, beak = vary(0.45, 0.7), vary(0.9, 1.1), vary(0.16, 0.26)
    wide = 0.3 * plump
    crown = ((0.82, 0.6), (0.74, 0.78), (0.5, 0.86), (0.28, 0.68), (-0.1, 0.44), (-0.6, 0.12))
    parts = [side(*crown)]
    parts.append(side((0.82, 0.54), (0.7, 0.2), (0.36, -0.22 * plump), (-0.1, -0.26 * plump), (-0.6, 0.02)))
    parts.append(
        torso(
            parts[0],
            parts[1],
            ((0.8, 0.57), 0.06),
            ((0.5, 0.62), 0.16),
            ((0.24, 0.2), 0.95 * wide),
            ((-0.2, 0.12), 0.7 * wide),
            ((-0.6, 0.07), 0.03),
        )
    )
    parts.append(polyline((0.82, 0, 0.6), (0.82 + beak, 0, 0.54), (0.82, 0, 0.54)))
    parts.append(mirror(curve((0.82 + beak, 0, 0.54), (0.86, 0.06, 0.57), (0.84, 0.1, 0.57), (0.76, 0.12, 0.6))))
    parts.append(eyes(0.64, 0.15, 0.66, 0.045))
    parts += [girth((0.24, 0.2), wide, 0.42 * plump), girth((0.5, 0.62), 0.17, 0.24)]
    parts.append(mirror(filled(polyline((-0.6, 0, 0.12), (-0.6 - tail, 0.14, 0.02), (-0.6 - 0.9 * tail, 0, -0.02)))))
    parts.append(line((-0.6, 0, 0.02), (-0.6 - 0.9 * tail, 0, -0.02)))
    if "spread wings" in attributes:
        root, rear, tip = (0.34, 0.2, 0.4), (-0.3, 0.2, 0.24), (-0.16, 1.3, 0.85)
        edge = curve(root, (0.5, 0.5, 0.8), (0.3, 1.0, 0.9), tip)
        feathers = spline(tip, (-0.3, 0.98, 0.62), (-0.3, 0.7, 0.44), rear)
        parts += [mirror(edge), mirror(feathers), mirror(solid(filled(join(edge, feathers))))]
        parts.append(mirror(curve((0.2, 0.35, 0.58), (0.1, 0.6, 0.68), (-0.05, 0.8, 0.7), (-0.3, 0.98, 0.62))))
    else:
        shoulder, tip = (0.4, wide, 0.3), (-0.7, 0.1, 0.14)
        parts.append(mirror(curve(shoulder, (0.3, 1.1 * wide, 0.62), (-0.2, wide, 0.36), tip)))
        parts.append(mirror(curve(shoulder, (0.3, 1.2 * wide, -0.1), (-0.2, 1.1 * wide, -0.1), tip)))
        foot = -0.66
        parts.append(mirror(line((0.12, 0.12, -0.26 * plump + 0.02), (0.16, 0.14, foot))))
        parts.append(mirror(polyline((0.36, 0.08, foot), (0.16, 0.14, foot), (0.36, 0.2, foot))))
        parts.append(mirror(line((0.16, 0.14, foot), (0.0, 0.14, foot))))
        if "branch" in attributes:
            for z in (foot - 0.02, foot - 0.14):
                parts.append(mirror(curve((0.14, 0, z), (0.14, 0.3, z), (0.2, 0.6, z), (0.06, 1, z + 0.06))))
    return parts


CATEGORY = Category(
    "bird",
    _make,
    synonyms=("robin", "sparrow", "songbird", "little bird", "parrot", "dove"),
    attributes=(
        Attribute(
            "spread wings",
            ("with spread wings", "flying", "with its wings spread"),
            nouns=("eagle", "seagull"),
            excludes=("branch",),
        ),
        Attribute("branch", ("with a branch",)),
    ),
    parts=("a head", "a beak", "wings", "a tail", "eyes", "feathers"),
    metres=0.25,
    head=(0.78, 0.96, 0.3),
)
