"""Horses: a long head on a raised neck with a mane, long legs and a flowing tail."""

from collections.abc import Collection

from diff3ds.library.animals import Point, eyes, girth, legs, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, join, line, mirror, polyline, side, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, lift, big = vary(0.92, 1.12), vary(-0.06, 0.1), vary(0.94, 1.08)
    neck = (0.5 * long, 1.2 + lift)

    def body(x: float, z: float) -> Point:
        return long * x, z + lift

    def head(x: float, z: float) -> Point:
        return neck[0] + big * (x - 0.5), neck[1] + big * (z - 1.2)

    back = [head(*p) for p in ((1.14, 1.4), (1.0, 1.66), (0.8, 1.84), (0.62, 1.7))]
    back += [body(*p) for p in ((0.36, 1.28), (-0.1, 1.16), (-0.56, 1.22), (-0.78, 0.98))]
    under = [head(1.14, 1.4), head(1.04, 1.33), head(0.84, 1.52), body(0.66, 1.16), body(0.4, 0.78), body(-0.42, 0.84)]
    parts = [side(*back), side(*under)]
    parts.append(
        torso(
            parts[0],
            parts[1],
            (head(1.1, 1.38), 0.06),
            (head(0.84, 1.66), 0.09),
            (body(0.52, 1.34), 0.11),
            (body(0.34, 1.03), 0.24),
            (body(-0.5, 1.02), 0.22),
        )
    )
    parts.append(legs(body(0.62, 0.98), body(0.28, 0.8), 0.46 * long, 0.07, 0.16))
    parts.append(legs(body(-0.42, 0.84), body(-0.78, 0.98), -0.68 * long, 0.07, 0.16, 0.07))
    parts += [girth(body(0.34, 1.03), 0.25, 0.26), girth(body(-0.5, 1.02), 0.23, 0.2)]
    x, z = head(0.84, 1.66)
    parts.append(girth((x, z), 0.12 * big, 0.15 * big))
    ear = [head(*p) for p in ((0.74, 1.82), (0.76, 2.02), (0.84, 1.82))]
    parts.append(mirror(polyline(*((x, y, z) for (x, z), y in zip(ear, (0.1, 0.09, 0.04), strict=True)))))
    x, z = head(0.92, 1.66)
    parts.append(eyes(x, 0.09, z, 0.035))
    # The mane along the crest, and the tail of two strands.
    crest = [head(0.78, 1.84), head(0.54, 1.72), body(0.32, 1.42), body(0.3, 1.26)]
    parts.append(side(*crest))
    x, z = body(-0.74, 1.08)
    for reach, low in ((0.5, 0.5), (0.36, 0.42)):
        parts.append(
            curve((x, 0, z), (x - reach, 0, z + 0.06), (x - 0.8 * reach, 0, z - 0.4), (x - 0.3, 0, z - low - 0.15))
        )
    if "horn" in attributes:
        base, tip = head(0.9, 1.8), head(1.16, 2.3)
        parts.append(mirror(line((base[0] + 0.02, 0.04, base[1]), (tip[0], 0, tip[1]))))
        parts.append(line((base[0] - 0.06, 0, base[1] + 0.04), (tip[0], 0, tip[1])))
    if "saddle" in attributes:
        seat = [body(*p) for p in ((0.22, 1.32), (0.08, 1.2), (-0.14, 1.2), (-0.26, 1.32))]
        parts.append(side(*seat))
        flap = spline(
            *(
                (x, y, z)
                for (x, z), y in zip(
                    [body(*p) for p in ((0.16, 1.2), (0.14, 0.86), (-0.14, 0.86), (-0.2, 1.2))],
                    (0.06, 0.28, 0.28, 0.06),
                    strict=True,
                )
            )
        )
        parts.append(mirror(flap))
    if "wings" in attributes:
        x, z = body(0.2, 1.18)
        wing = join(
            curve((x, 0.12, z), (x + 0.1, 0.3, z + 0.5), (x - 0.3, 0.6, z + 0.85), (x - 0.75, 0.75, z + 0.8)),
            spline(
                (x - 0.75, 0.75, z + 0.8), (x - 0.62, 0.55, z + 0.5), (x - 0.5, 0.34, z + 0.22), (x - 0.35, 0.12, z)
            ),
        )
        parts.append(mirror(wing))
    return parts


CATEGORY = Category(
    "horse",
    _make,
    synonyms=("pony", "foal", "stallion", "mare"),
    attributes=(
        Attribute("horn", ("with a horn",), nouns=("unicorn",)),
        Attribute("saddle", ("with a saddle", "saddled")),
        Attribute("wings", ("with wings", "winged"), nouns=("pegasus",)),
    ),
    parts=("a head", "a mane", "a tail", "legs", "four legs", "ears", "hooves"),
    metres=2.4,
    carries=0.58,
    head=(0.83, 0.88, 0.14),
)
