"""Cats, sitting: a round head with pointed ears and whiskers, a tail that curls up."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, ball, curve, detail, line, mirror, polyline, ring, side, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, high, wide = vary(0.27, 0.32), vary(0.95, 1.12), vary(0.33, 0.42)
    top = high + 0.72 * r
    x = 0.14
    parts = [ball((x, 0, top), r), *(ring((x, 0, top), r, axis) for axis in ("x", "y"))]
    parts.append(
        mirror(spline((x, 0.1 * r, top + r), (x - 0.02, 0.72 * r, top + 1.62 * r), (x, 0.95 * r, top + 0.3 * r)))
    )
    parts.append(mirror(line((x - 0.3 * r, 0.6 * r, top + 0.75 * r), (x - 0.02, 0.72 * r, top + 1.62 * r))))
    # The face, on the ball of the head.
    front = x + 0.94 * r
    parts.append(eyes(x + 0.86 * r, 0.38 * r, top + 0.2 * r, 0.13 * r, "x"))
    parts.append(
        detail(
            polyline(
                (front, 0.1 * r, top - 0.12 * r),
                (front, -0.1 * r, top - 0.12 * r),
                (x + r, 0, top - 0.25 * r),
                closed=True,
            )
        )
    )
    parts.append(
        detail(
            mirror(
                curve(
                    (x + r, 0, top - 0.25 * r),
                    (x + r, 0.02 * r, top - 0.5 * r),
                    (front, 0.22 * r, top - 0.5 * r),
                    (front, 0.3 * r, top - 0.35 * r),
                )
            )
        )
    )
    for dz in (0.12, -0.12):
        parts.append(
            detail(
                mirror(line((front, 0.25 * r, top - (0.25 - 0.3 * dz) * r), (front, 1.4 * r, top + (dz * 2 - 0.2) * r)))
            )
        )
    # Chest with forelegs, and back, from the side; the pear of the body from the front.
    chest = side((x + 0.6 * r, top - 0.8 * r), (0.42, 0.72 * high), (0.36, 0.35 * high), (0.38, 0.06), (0.5, 0))
    spine = side((x - 0.75 * r, top - 0.65 * r), (-0.24, 0.72 * high), (-0.5, 0.3 * high), (-0.46, 0))
    parts += [chest, spine]
    widths = (((0.1, top - 0.75 * r), 0.5 * r), ((0, 0.62 * high), 0.7 * wide), ((-0.06, 0.25 * high), 0.95 * wide))
    parts.append(torso(chest, spine, *widths, ((0, 0), 0.85 * wide)))
    parts.append(
        mirror(
            spline(
                (0.02, 0.5 * r, top - 0.86 * r),
                (0, 0.72 * wide, 0.62 * high),
                (-0.06, wide, 0.25 * high),
                (0, 0.9 * wide, 0),
            )
        )
    )
    # Forelegs and haunches.
    parts.append(mirror(spline((0.38, 0.03, 0.06), (0.5, 0.1, 0), (0.38, 0.17, 0.05), (0.34, 0.16, 0.45 * high))))
    parts.append(
        mirror(
            curve(
                (0, 0.9 * wide, 0),
                (0.36, 1.1 * wide, 0.6 * high),
                (-0.4, 1.1 * wide, 0.7 * high),
                (-0.42, 0.6 * wide, 0.1),
            )
        )
    )
    tail = ((-0.47, 0, 0.05), (-0.8, 0, 0.06), (-0.98, 0, 0.32), (-0.84, 0, 0.62), (-0.92, 0, 0.8))
    parts.append(spline(*tail))
    if "collar" in attributes:
        parts.append(ring((x - 0.02, 0, high + 0.02), 0.62 * r))
    if "stripes" in attributes:
        for z in (0.35, 0.5, 0.65):
            back, wide_there = (-0.5 + 0.36 * (z - 0.2), 0.0, z * high), (1.15 - 0.6 * z) * wide
            parts.append(
                mirror(
                    curve(
                        back,
                        (back[0], wide_there, (z + 0.1) * high),
                        (-0.2, wide_there, (z + 0.05) * high),
                        (-0.02, wide_there, (z - 0.04) * high),
                    )
                )
            )
    return parts


CATEGORY = Category(
    "cat",
    _make,
    synonyms=("kitten", "kitty", "pussycat"),
    attributes=(
        Attribute("collar", ("with a collar",)),
        Attribute("stripes", ("with stripes", "striped"), nouns=("tiger", "tabby")),
    ),
    parts=("a head", "whiskers", "ears", "a tail", "eyes", "paws"),
    metres=0.55,
    head=(0.75, 0.88, 0.4),
)
