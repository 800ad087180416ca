"""Dinosaurs with a long neck and a long tail, on four legs like columns."""

from collections.abc import Collection

from diff3ds.library.animals import eyes, girth, legs, torso
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, filled, flesh, line, mirror, polyline, side


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    tail, neck, high = vary(0.9, 1.15), vary(0.9, 1.15), vary(0.92, 1.08)
    if "big teeth" in attributes:
        return _hunter(tail, high)
    tip = (-0.5 - 1.1 * tail, 0.16)
    x, z = 0.82 * neck + 0.1, high + 0.62 * neck
    back = (
        (x + 0.3, z - 0.02),
        (x + 0.08, z + 0.13),
        (x - 0.12, z - 0.04),
        (0.5, high + 0.06),
        (0.1, high + 0.02),
        (-0.46, high - 0.06),
        (-0.5 - 0.5 * tail, 0.56),
        tip,
    )
    parts = [side(*back)]
    under = (
        (x + 0.3, z - 0.02),
        (x + 0.02, z - 0.12),
        (0.74, high - 0.06),
        (0.52, 0.52),
        (0.06, 0.42),
        (-0.46, 0.52),
        (-0.5 - 0.5 * tail, 0.4),
        tip,
    )
    parts.append(side(*under))
    parts.append(
        torso(
            parts[0],
            parts[1],
            ((x + 0.28, z - 0.02), 0.04),
            ((x + 0.06, z), 0.08),
            ((0.66, high), 0.11),
            ((0.5, 0.5 * high + 0.29), 0.2),
            ((0.1, 0.5 * high + 0.22), 0.32),
            ((-0.46, 0.5 * high + 0.23), 0.22),
            ((-0.5 - 0.5 * tail, 0.48), 0.08),
            (tip, 0.01),
        )
    )
    parts.append(legs((0.52, 0.54), (0.2, 0.44), 0.36, 0.1, 0.2, thick=0.06))
    parts.append(legs((-0.2, 0.44), (-0.6, 0.56), -0.44, 0.1, 0.2, thick=0.06))
    parts += [
        girth((0.1, 0.5 * high + 0.22), 0.34, 0.5 * high - 0.2),
        girth((0.5, 0.5 * high + 0.29), 0.22, 0.5 * high - 0.23),
    ]
    parts += [girth((-0.46, 0.5 * high + 0.23), 0.24, 0.5 * high - 0.28), girth((x + 0.06, z), 0.1, 0.12)]
    parts.append(eyes(x + 0.12, 0.09, z + 0.05, 0.03))
    parts.append(
        mirror(
            curve(
                (x + 0.3, 0, z - 0.02), (x + 0.2, 0.1, z - 0.06), (x + 0.12, 0.1, z - 0.06), (x + 0.08, 0.08, z - 0.02)
            )
        )
    )
    if "plates" in attributes:
        for at, level in ((0.4, 0.06), (0.16, 0.05), (-0.08, 0.03), (-0.32, 0.0), (-0.56, -0.1)):
            plate = ((at + 0.11, 0, high + level), (at, 0, high + level + 0.26), (at - 0.11, 0, high + level - 0.02))
            parts.append(filled(polyline(*plate)))
    return parts


def _hunter(tail: float, high: float) -> list[Part]:
    """On two strong legs, with small arms: Tyrannosaurus."""
    up = high - 0.1
    tip = (-0.5 - tail, up - 0.1)
    crown = (
        (0.98, up + 0.42),
        (0.86, up + 0.62),
        (0.5, up + 0.66),
        (0.3, up + 0.46),
        (0.0, up + 0.22),
        (-0.5, up + 0.02),
        tip,
    )
    parts = [side(*crown)]
    parts.append(side((0.4, up + 0.24), (0.5, up + 0.02), (0.36, up - 0.3), (-0.1, up - 0.4), (-0.5, up - 0.26), tip))
    trunk = side((0.3, up + 0.46), (0.0, up + 0.22), (-0.5, up + 0.02), tip)
    widths = (((0.3, up), 0.22), ((-0.2, up - 0.12), 0.24), ((-0.5, up - 0.12), 0.16), (tip, 0.01))
    parts.append(torso(trunk, parts[1], *widths))
    jaw = ((0.98, 0, up + 0.42), (0.5, 0, up + 0.36), (0.9, 0, up + 0.22), (0.4, 0, up + 0.24))
    parts.append(polyline(*jaw))
    skull, mouth = side(*crown[:4]), side((0.98, up + 0.42), (0.5, up + 0.36), (0.4, up + 0.24))
    parts.append(torso(skull, mouth, ((0.96, up + 0.44), 0.04), ((0.56, up + 0.46), 0.13), ((0.36, up + 0.3), 0.16)))
    chin = side((0.5, up + 0.36), (0.9, up + 0.22)), side((0.4, up + 0.24), (0.9, up + 0.22))
    parts.append(flesh(*chin, 0.12, 0.03))
    parts.append(
        mirror(
            polyline(
                (0.92, 0.06, up + 0.41),
                (0.84, 0.05, up + 0.3),
                (0.78, 0.08, up + 0.4),
                (0.7, 0.05, up + 0.3),
                (0.64, 0.08, up + 0.38),
            )
        )
    )
    parts.append(legs((0.16, up - 0.3), (-0.44, up - 0.16), -0.16, 0.08, 0.22, bend=0.22, thick=0.06))
    parts.append(mirror(line((0.12, 0.2, 0), (-0.08, 0.28, 0))))
    parts.append(mirror(polyline((0.46, 0.12, up - 0.06), (0.62, 0.16, up - 0.18), (0.74, 0.16, up - 0.06))))
    parts += [
        girth((0.3, up + 0.0), 0.24, 0.34),
        girth((-0.2, up - 0.12), 0.26, 0.26),
        girth((0.56, up + 0.46), 0.16, 0.2),
    ]
    parts.append(
        mirror(curve((0.98, 0, up + 0.42), (0.9, 0.16, up + 0.42), (0.7, 0.18, up + 0.42), (0.56, 0.16, up + 0.46)))
    )
    parts.append(eyes(0.66, 0.14, up + 0.54, 0.04))
    return parts


CATEGORY = Category(
    "dinosaur",
    _make,
    synonyms=("dino", "brontosaurus", "brachiosaurus", "diplodocus", "long-necked dinosaur"),
    attributes=(
        Attribute("plates", ("with plates", "with spikes"), nouns=("stegosaurus",), excludes=("big teeth",)),
        Attribute("big teeth", ("with big teeth", "with teeth"), nouns=("tyrannosaurus", "t rex", "tyrannosaurus rex")),
    ),
    parts=("a head", "a long tail", "a tail", "legs", "eyes"),
    metres=9.0,
    carries=0.58,
    head=(0.93, 0.97, 0.12),
)
