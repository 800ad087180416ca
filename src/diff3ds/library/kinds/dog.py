"""Dogs: a long muzzle, hanging ears, four legs and a tail that is up."""

from collections.abc import Collection

from diff3ds.library.animals import Point, eyes, girth, legs, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, detail, mirror, ring, side, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, lift, big = vary(0.9, 1.15), vary(-0.08, 0.12), vary(0.92, 1.1)
    if "short legs" in attributes:
        long, lift = 1.35, -0.3
    neck = (0.42 * long, 1.0 + lift)

    def body(x: float, z: float) -> Point:
        return long * x, z + lift

    def head(x: float, z: float) -> Point:
        return neck[0] + big * (x - 0.42), neck[1] + big * (z - 1.0)

    back = [head(*p) for p in ((1.04, 1.12), (0.88, 1.2), (0.72, 1.38), (0.54, 1.34))]
    back += [body(*p) for p in ((0.34, 1.04), (-0.1, 0.92), (-0.52, 0.92), (-0.7, 0.76))]
    under = [head(1.04, 1.12), head(0.98, 1.0), head(0.74, 0.98), body(0.52, 0.74), body(0.3, 0.52), body(-0.36, 0.64)]
    parts = [side(*back), side(*under)]
    parts.append(
        torso(
            parts[0],
            parts[1],
            (head(1.0, 1.08), 0.05),
            (head(0.84, 1.14), 0.09),
            (head(0.66, 1.18), 0.15 * big),
            (body(0.44, 0.95), 0.15),
            (body(0.3, 0.78), 0.2),
            (body(-0.46, 0.77), 0.16),
        )
    )
    x, z = body(-0.64, 0.85)
    parts.append(curve((x, 0, z), (x - 0.28, 0, z + 0.02), (x - 0.36, 0, z + 0.2), (x - 0.3, 0, z + 0.46)))
    parts.append(legs(body(0.5, 0.66), body(0.2, 0.54), 0.36 * long, 0.07, 0.14))
    parts.append(legs(body(-0.36, 0.64), body(-0.7, 0.76), -0.6 * long, 0.07, 0.14, 0.06))
    parts += [girth(body(0.3, 0.78), 0.21, 0.25), girth(body(-0.46, 0.77), 0.17, 0.15)]
    x, z = head(0.66, 1.18)
    parts.append(girth((x, z), 0.17 * big, 0.19 * big))
    ear = [head(*p) for p in ((0.6, 1.36), (0.5, 1.2), (0.56, 1.0), (0.68, 1.06), (0.7, 1.3))]
    if "pointed ears" in attributes:
        ear = [head(*p) for p in ((0.52, 1.32), (0.56, 1.62), (0.7, 1.36))]
        parts.append(mirror(spline(*((x, y, z) for (x, z), y in zip(ear, (0.16, 0.15, 0.05), strict=True)))))
    else:
        parts.append(mirror(spline(*((x, y, z) for (x, z), y in zip(ear, (0.1, 0.2, 0.24, 0.22, 0.13), strict=True)))))
    x, z = head(0.82, 1.22)
    parts.append(eyes(x, 0.1, z, 0.035))
    x, z = head(1.04, 1.12)
    parts.append(detail(ring((x, 0, z), 0.045, "x")))
    if "collar" in attributes:
        parts.append(girth(body(0.46, 0.97), 0.17, 0.2))
    return parts


CATEGORY = Category(
    "dog",
    _make,
    synonyms=("puppy", "hound", "doggy"),
    attributes=(
        Attribute("pointed ears", ("with pointed ears", "with pointy ears"), nouns=("wolf", "fox", "German shepherd")),
        Attribute("short legs", ("with short legs", "short-legged"), nouns=("dachshund", "sausage dog")),
        Attribute("collar", ("with a collar",)),
    ),
    parts=("a head", "a tail", "ears", "legs", "four legs", "eyes", "a nose"),
    metres=0.9,
    carries=0.66,
    head=(0.8, 0.96, 0.26),
)
