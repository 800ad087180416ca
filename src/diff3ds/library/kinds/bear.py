"""Teddy bears, sitting: round ears, a muzzle, a round belly, arms and legs stretched out."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, girth
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, ball, curve, ellipse, filled, line, mirror, polyline, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, belly, leg = vary(0.36, 0.42), vary(0.42, 0.5), vary(0.55, 0.7)
    high = 1.05 * belly
    z = high + belly + 0.7 * r
    parts = [ring((0.04, 0, z), r, "x"), ring((0.04, 0, z), r, "y")]
    parts += [ellipse((0, 0, high), (0.86 * belly, 0, 0), (0, 0, 1.05 * belly)), girth((0, high), belly, 1.05 * belly)]
    parts += [ball((0.04, 0, z), r), ball((0, 0, high), (0.86 * belly, belly, 1.05 * belly))]
    parts.append(mirror(filled(ring((0.0, 0.8 * r, z + 0.78 * r), 0.36 * r, "x"))))
    # The face: a muzzle with nose and mouth.
    x = 0.04 + r
    parts.append(ring((x, 0, z - 0.2 * r), 0.42 * r, "x"))
    parts.append(
        polyline(
            (x + 0.06, 0.1 * r, z - 0.02 * r),
            (x + 0.06, -0.1 * r, z - 0.02 * r),
            (x + 0.06, 0, z - 0.16 * r),
            closed=True,
        )
    )
    parts.append(
        mirror(
            curve(
                (x + 0.06, 0, z - 0.16 * r),
                (x + 0.06, 0, z - 0.4 * r),
                (x, 0.2 * r, z - 0.4 * r),
                (x, 0.22 * r, z - 0.28 * r),
            )
        )
    )
    parts.append(eyes(0.9 * x, 0.36 * r, z + 0.22 * r, 0.09 * r, "x"))
    # Arms hang forwards, legs stretch out ahead with round soles.
    shoulder = high + 0.7 * belly
    parts.append(
        mirror(
            curve(
                (0.05, 0.66 * belly, shoulder + 0.1),
                (0.1, 1.7 * belly, shoulder),
                (0.4, 1.5 * belly, shoulder - 0.6),
                (0.42, belly, shoulder - 0.5),
            )
        )
    )
    parts.append(
        mirror(
            curve(
                (0.1, 0.85 * belly, shoulder - 0.2),
                (0.2, belly, shoulder - 0.3),
                (0.3, 0.9 * belly, shoulder - 0.4),
                (0.42, belly, shoulder - 0.5),
            )
        )
    )
    sole = (0.3 * belly + leg, 0.62 * belly, 0.2)
    parts.append(mirror(ring(sole, 0.21, "x")))
    for dz in (0.21, -0.21):
        parts.append(
            mirror(
                line(
                    (sole[0], sole[1], sole[2] + dz),
                    (0.62 * belly, sole[1] - 0.05, sole[2] + (0.24 if dz > 0 else -0.16)),
                )
            )
        )
    if "bow tie" in attributes:
        neck, x = high + belly - 0.02, 0.75 * belly
        parts.append(mirror(polyline((x, 0, neck), (x, 0.24, neck + 0.13), (x, 0.24, neck - 0.13), closed=True)))
    if "heart" in attributes:
        x, mid = 0.92 * belly, high
        parts.append(mirror(curve((x, 0, mid + 0.08), (x, 0.08, mid + 0.24), (x, 0.3, mid + 0.16), (x, 0, mid - 0.2))))
    return parts


CATEGORY = Category(
    "teddy bear",
    _make,
    synonyms=("bear", "teddy", "cuddly toy"),
    attributes=(
        Attribute("bow tie", ("with a bow tie", "with a bow")),
        Attribute("heart", ("with a heart",)),
    ),
    parts=("a head", "ears", "arms", "legs", "eyes", "a nose", "a belly"),
    metres=0.45,
    head=(0.37, 0.92, 0.55),
)
