"""Cows: a long straight back, horns, an udder and a tail with a tuft."""

from collections.abc import Collection

from diff3ds.library.animals import Point, eyes, girth, legs, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, ellipse, mirror, ring, side, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, lift, big = vary(0.95, 1.12), vary(-0.05, 0.06), vary(0.95, 1.08)
    neck = (0.62 * long, 1.1 + lift)

    def body(x: float, z: float) -> Point:
        return long * x, z + lift

    def head(x: float, z: float) -> Point:
        return neck[0] + big * (x - 0.62), neck[1] + big * (z - 1.1)

    back = [head(*p) for p in ((1.24, 0.84), (1.12, 1.08), (0.98, 1.28), (0.84, 1.3))]
    back += [body(*p) for p in ((0.6, 1.14), (0.3, 1.16), (-0.5, 1.14), (-0.82, 1.1), (-0.9, 0.86))]
    under = [
        head(1.24, 0.84),
        head(1.12, 0.76),
        head(0.92, 0.92),
        body(0.72, 0.76),
        body(0.5, 0.5),
        body(0.0, 0.46),
        body(-0.5, 0.56),
    ]
    parts = [side(*back), side(*under)]
    parts.append(
        torso(
            parts[0],
            parts[1],
            (head(1.22, 0.84), 0.09),
            (head(0.96, 1.08), 0.13 * big),
            (body(0.7, 0.96), 0.18),
            (body(0.36, 0.83), 0.3),
            (body(-0.56, 0.85), 0.29),
            (body(-0.8, 0.84), 0.2),
        )
    )
    parts.append(legs(body(0.66, 0.66), body(0.36, 0.49), 0.52 * long, 0.08, 0.2))
    parts.append(legs(body(-0.52, 0.58), body(-0.9, 0.86), -0.76 * long, 0.08, 0.2, 0.05))
    parts += [girth(body(0.36, 0.83), 0.32, 0.33), girth(body(-0.56, 0.85), 0.3, 0.28)]
    x, z = head(0.96, 1.08)
    parts.append(girth((x, z), 0.15 * big, 0.19 * big))
    x, z = head(0.88, 1.28)
    parts.append(mirror(curve((x, 0.06, z), (x, 0.24, z), (x + 0.06, 0.32, z + 0.1), (x + 0.02, 0.26, z + 0.3))))
    parts.append(
        mirror(
            spline(
                (x, 0.14, z - 0.1), (x - 0.06, 0.32, z - 0.06), (x - 0.04, 0.36, z - 0.18), (x + 0.02, 0.16, z - 0.2)
            )
        )
    )
    x, z = head(1.04, 1.12)
    parts.append(eyes(x, 0.13, z, 0.04))
    x, z = head(1.22, 0.82)
    parts.append(ring((x, 0, z), 0.1, "x"))
    parts.append(
        curve(
            (*body(-0.36, 0.56)[:1], 0, body(0, 0.54)[1]),
            (-0.4 * long, 0, 0.36 + lift),
            (-0.6 * long, 0, 0.36 + lift),
            (-0.6 * long, 0, 0.6 + lift),
        )
    )
    x, z = body(-0.86, 1.04)
    parts.append(curve((x, 0, z), (x - 0.16, 0, z), (x - 0.14, 0, z - 0.3), (x - 0.12, 0, z - 0.56)))
    parts.append(ellipse((x - 0.12, 0, z - 0.66), (0.04, 0, 0), (0, 0, 0.1)))
    if "spots" in attributes:
        for at, wide, high in ((0.1, 0.18, 0.12), (-0.36, 0.14, 0.14)):
            px, pz = body(at, 0.92)
            parts.append(mirror(ellipse((px, 0.31, pz), (wide, 0, 0), (0, -0.04, high))))
    if "bell" in attributes:
        x, z = body(0.74, 0.76)
        parts += [curve((x, y, z), (x, y, z - 0.14), (x, 2 * y, z - 0.14), (x, 2 * y, z - 0.2)) for y in (-0.05, 0.05)]
        parts.append(ring((x, 0, z - 0.2), 0.1))
    return parts


CATEGORY = Category(
    "cow",
    _make,
    synonyms=("bull", "calf", "ox"),
    attributes=(
        Attribute("spots", ("with spots", "spotted")),
        Attribute("bell", ("with a bell",)),
    ),
    parts=("a head", "horns", "an udder", "a tail", "legs", "four legs", "ears", "eyes"),
    metres=2.4,
    carries=0.76,
    head=(0.84, 0.8, 0.22),
)
