"""Hearts, as on a card: an outline with depth, rounded like a cushion."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, curve, filled, join, line, mirror, move, polyline, sheet, solid, stretch


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, low, notch, deep = vary(0.85, 1.02), vary(0.9, 1.1), vary(0.36, 0.48), vary(0.16, 0.26)
    top = 0.62

    def outline(x: float, size: float) -> Part:
        """Half of it, from the notch over the bump to the point."""
        bump = curve((0, 0, notch), (0, 0.16 * wide, top + 0.26), (0, 0.94 * wide, top + 0.3), (0, wide, 0.3))
        flank = curve((0, wide, 0.3), (0, 1.04 * wide, -0.12), (0, 0.4 * wide, -0.55 * low), (0, 0, -low))
        return move(stretch(join(bump, flank), (1, size, size)), (x, 0, 0))

    parts = [mirror(outline(0, 1))]
    parts += [mirror(outline(x, 0.74)) for x in (-deep, deep)]
    for x in (-deep, deep):
        cushion = join(sheet(outline(0, 1), outline(x, 0.74)), solid(filled(outline(x, 0.74))))
        parts.append(mirror(cushion))
    for x in (-deep, deep):
        parts += [
            line((0, 0, notch), (x, 0, 0.74 * notch)),
            line((0, 0, -low), (x, 0, -0.74 * low)),
            mirror(line((0, wide, 0.3), (x, 0.74 * wide, 0.74 * 0.3))),
        ]
    if "arrow" in attributes:
        tail, tip = (0.0, -1.35, -0.3), (0.0, 1.35, 0.62)
        parts.append(line(tail, tip))
        parts.append(polyline((0, tip[1] - 0.26, tip[2] + 0.05), tip, (0, tip[1] - 0.12, tip[2] - 0.22)))
        for s in (0.0, 0.12):
            y, z = tail[1] + s * (tip[1] - tail[1]), tail[2] + s * (tip[2] - tail[2])
            parts += [line((0, y, z), (0, y - 0.2, z + 0.08)), line((0, y, z), (0, y - 0.08, z - 0.2))]
    return parts


CATEGORY = Category(
    "heart",
    _make,
    synonyms=("love heart", "valentine heart"),
    attributes=(Attribute("arrow", ("with an arrow",)),),
    mirror="x",
    metres=0.3,
)
