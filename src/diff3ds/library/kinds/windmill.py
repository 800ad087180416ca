"""Windmills: a tower with a cap and four sails; wind turbines have three blades."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    box,
    curve,
    join,
    lathe,
    line,
    mirror,
    polyline,
    reflect,
    ring,
    sheet,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    foot, head, height = vary(0.44, 0.56), vary(0.29, 0.35), vary(1.43, 1.82)
    sail, hub = vary(0.9, 1.15), height + 0.1
    if "turbine" in attributes:
        hub, wide, long = 1.3 * height, vary(0.08, 0.13), vary(0.81, 1.29)
        at, x = (0.22, 0, hub), 0.22
        edge = curve(at, (x, 1.5 * wide, hub + 0.15), (x, wide, hub + 0.3), (x, 0, hub + long))
        blade = join(mirror(edge), sheet(edge, reflect(edge)))
        tower = lathe(line((0.09, 0, 0), (0.05, 0, hub - 0.08)), [(0.09, 0), (0.05, hub - 0.08)])
        return [around(blade, 3, "x", at), ring(at, 0.07, "x"), tower, box((0, 0, hub), (0.4, 0.16, 0.16))]
    cap = curve((head, 0, height), (head, 0, height + 0.25), (0.2, 0, height + 0.38), (0, 0, height + 0.4))
    parts = [lathe(join(line((foot, 0, 0), (head, 0, height)), cap), [(foot, 0), (head, height)], 4, 45)]
    x = head + 0.12
    parts.append(line((0, 0, hub), (x, 0, hub)))
    # One sail, pointing up: a spar and a frame on both of its sides.
    frame = polyline((x, 0, hub + 0.3), (x, 0.15, hub + 0.3), (x, 0.15, hub + sail), (x, 0, hub + sail))
    blade = join(line((x, 0, hub), (x, 0, hub + sail)), mirror(frame))
    if "lattice" in attributes:
        bars = [hub + 0.3 + (sail - 0.3) * i / 4 for i in (1, 2, 3)]
        blade = join(blade, *(line((x, -0.15, z), (x, 0.15, z)) for z in bars))
    parts.append(turn(around(blade, 4, "x", (0, 0, hub)), 45, "x", (0, 0, hub)))
    if "gallery" in attributes:
        parts += [ring((0, 0, z), 0.75) for z in (0.5, 0.7)]
        parts.append(around(line((0.75, 0, 0.5), (0.75, 0, 0.7)), 8))
    return parts


CATEGORY = Category(
    "windmill",
    _make,
    synonyms=("mill",),
    attributes=(
        Attribute("turbine", ("modern", "with three blades"), nouns=("wind turbine",), excludes=("lattice", "gallery")),
        Attribute("lattice", ("with lattice sails",)),
        Attribute("gallery", ("with a gallery", "with a balcony")),
    ),
    metres=15,
)
