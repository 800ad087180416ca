"""Hats: a crown, a brim and a band."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, lathe, ring, spline


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, high, brim = vary(0.5, 0.6), vary(0.42, 0.55), vary(0.95, 1.15)
    if "tall" in attributes:
        high, brim = vary(0.95, 1.1), 0.85
        parts = [
            lathe(
                curve((r, 0, 0), (0.85 * r, 0, 0.4 * high), (0.9 * r, 0, 0.7 * high), (r, 0, high)),
                [(r, 0), (r, high), (0.92 * r, 0.2)],
            )
        ]
        parts.append(ring((0, 0, 0), brim))
    elif "pointed" in attributes:
        high = 1.5
        parts = [
            lathe(
                curve((r, 0, 0), (0.5 * r, 0, 0.4 * high), (0.3 * r, 0, 0.7 * high), (0.0, 0, high)),
                [(r, 0), (0.72 * r, 0.2 * high)],
            )
        ]
        parts.append(ring((0, 0, 0), brim))
    else:
        crown = curve((r, 0, 0), (r, 0, 0.3 * high), (0.85 * r, 0, 0.7 * high), (0.8 * r, 0, high))
        parts = [lathe(crown, [(r, 0), (0.97 * r, 0.25 * high), (0.8 * r, high)])]
        # The brim is turned up at both sides, the crown is dented from front to back.
        rim = [
            (brim, 0, 0),
            (0.7 * brim, 0.62 * brim, 0.05),
            (0, 0.86 * brim, 0.22),
            (-0.7 * brim, 0.62 * brim, 0.05),
            (-brim, 0, 0),
            (-0.7 * brim, -0.62 * brim, 0.05),
            (0, -0.86 * brim, 0.22),
            (0.7 * brim, -0.62 * brim, 0.05),
        ]
        parts.append(spline(*rim, closed=True))
        parts.append(
            curve((0.8 * r, 0, high), (0.4 * r, 0, high - 0.2), (-0.4 * r, 0, high - 0.2), (-0.8 * r, 0, high))
        )
    if "feather" in attributes:
        root, tip = (0.0, 0.95 * r, 0.12), (-0.75, 1.1 * r, 0.95)
        parts.append(curve(root, (-0.1, 1.1 * r, 0.5), (-0.4, 1.1 * r, 0.8), tip))
        parts.append(curve(root, (-0.4, 1.2 * r, 0.3), (-0.8, 1.2 * r, 0.6), tip))
    return parts


CATEGORY = Category(
    "hat",
    _make,
    synonyms=("sun hat", "straw hat", "cowboy hat", "fedora", "sombrero"),
    attributes=(
        Attribute("tall", ("tall",), nouns=("top hat",), excludes=("pointed",)),
        Attribute("pointed", ("pointed", "pointy"), nouns=("witch hat", "wizard hat", "party hat")),
        Attribute("feather", ("with a feather",)),
    ),
    parts=("a brim", "a band", "a ribbon"),
    mirror=None,
    metres=0.35,
    worn=1.8,
)
