"""Airplanes: a turned fuselage with wings and a tail."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, around, curve, filled, join, lathe, line, mirror, move, polyline, smooth, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, body = vary(1.44, 1.76), vary(0.17, 0.26)
    span, chord, sweep = vary(1.44, 1.76), vary(0.47, 0.63), vary(0.45, 0.75)
    small = "propeller" in attributes or "two wings" in attributes
    if small:
        long, span, chord, sweep = 1.25, 1.6, 0.55, 0.05
    nose = curve((body, 0, 0.75 * long), (body, 0, 0.95 * long), (0.6 * body, 0, long), (0, 0, long))
    hull = join(line((body, 0, -0.3 * long), (body, 0, 0.75 * long)), nose)
    tail = curve((body, 0, -0.3 * long), (body, 0, -0.7 * long), (0.3 * body, 0, -long), (0, 0, -long))
    rings = [(body, -0.3 * long), (body, 0.7 * long)]
    # The fuselage is turned around z, then laid down with its nose to the front.
    parts = [turn(lathe(join(hull, tail), rings), -90, "y")]

    def wing(x: float, z: float, size: float) -> Part:
        tip = x - sweep * size
        outline = polyline(
            (x, 0.1, z), (tip, span * size, z), (tip - 0.5 * chord * size, span * size, z), (x - chord * size, 0.1, z)
        )
        return mirror(filled(outline))

    levels = (-0.1, 0.5) if "two wings" in attributes else (-0.05,)
    parts += [wing(0.35, z, 1.0) for z in levels]
    if "two wings" in attributes:
        parts += [mirror(line((x, y, -0.1), (x, y, 0.5))) for x in (0.25, -0.08) for y in (0.35, 1.3)]
    parts.append(wing(-0.75 * long, 0.05, 0.4))
    fin = (-0.65 * long, 0, 0.8 * body), (-0.95 * long, 0, 0.62), (-1.08 * long, 0, 0.62), (-long, 0, 0.05)
    parts.append(filled(polyline(*fin)))
    if "propeller" in attributes:
        hub = (long, 0, 0)
        blade = smooth(hub, (long, 0.07, 0.3), (long, 0, 0.5), (long, -0.07, 0.3), closed=True)
        parts += [around(blade, 2, "x", hub)]
    if "jets" in attributes:
        engine = turn(lathe(line((0.12, 0, -0.25), (0.12, 0, 0.25)), [(0.12, -0.25), (0.12, 0.25)]), -90, "y")
        parts.append(mirror(move(engine, (0.2, 0.42 * span, -0.22))))
    return parts


CATEGORY = Category(
    "airplane",
    _make,
    synonyms=("aeroplane", "plane", "aircraft", "airliner"),
    attributes=(
        Attribute("propeller", ("with a propeller",), excludes=("jets",)),
        Attribute("two wings", ("with two pairs of wings",), nouns=("biplane",), excludes=("jets",)),
        Attribute("jets", ("with jet engines", "jet"), nouns=("jet",)),
    ),
    parts=(
        "wings",
        "a tail",
    ),
    metres=30,
    aloft=True,
)
