"""Castles: four round towers with pointed roofs, walls between them with battlements, and a gate."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, ellipse, filled, join, lathe, line, mirror, move, polyline, solid


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, half, wall, tall = vary(0.2, 0.26), vary(0.75, 0.9), vary(0.55, 0.7), vary(0.95, 1.15)
    roof = tall + 3.2 * r
    if "flat towers" in attributes:
        roof = tall + 0.26
        side_of_it = polyline((r, 0, 0), (r, 0, tall), (1.3 * r, 0, tall + 0.06), (1.3 * r, 0, roof))
        tower = lathe(side_of_it, [(r, 0), (1.3 * r, roof)], 2, 45)
    else:
        tower = lathe(polyline((r, 0, 0), (r, 0, tall), (0, 0, roof)), [(r, 0), (r, tall)], 3, 30)
    parts = [mirror(move(tower, (x, half, 0))) for x in (-half, half)]
    near, far = -half + r, half - r
    # The wall in front with battlements, the others plain.
    tooth, width = 0.14, (far - near) / 5
    ups = [(near + width * (i // 2 + i % 2), wall + (tooth if (i // 2) % 2 else 0)) for i in range(10)]
    parts.append(polyline(*((half, y, z) for y, z in ups)))
    gate = 0.2
    parts += [line((half, s * gate, 0), (half, s * far, 0)) for s in (-1, 1)]
    parts += [mirror(line((near, half, wall), (far, half, wall))), line((-half, near, wall), (-half, far, wall))]
    parts += [line((half, y, 0), (half, y, 0.22)) for y in (-gate, gate)]
    arch = ellipse((half, 0, 0.22), (0, gate, 0), (0, 0, gate), 0, 180)
    parts.append(arch)
    front = join(
        polyline(*((half, y, z) for y, z in (*ups, (far, 0), (gate, 0), (gate, 0.22)))),
        arch,
        polyline(*((half, y, z) for y, z in ((-gate, 0.22), (-gate, 0), (near, 0), ups[0]))),
    )
    flank = polyline((near, half, wall), (far, half, wall), (far, half, 0), (near, half, 0), closed=True)
    rear = polyline((-half, near, wall), (-half, far, wall), (-half, far, 0), (-half, near, 0), closed=True)
    parts += [solid(filled(front)), mirror(solid(filled(flank))), solid(filled(rear))]
    if "flags" in attributes:
        pole = join(
            line((0, 0, roof), (0, 0, roof + 0.4)),
            polyline((0, 0, roof + 0.4), (0, 0.28, roof + 0.32), (0, 0, roof + 0.24)),
        )
        parts.append(mirror(move(pole, (half, half, 0))))
    if "keep" in attributes:
        parts.append(lathe(polyline((0.34, 0, 0), (0.34, 0, 1.5)), [(0.34, 1.5)], 4, 45))
    return parts


CATEGORY = Category(
    "castle",
    _make,
    synonyms=("palace", "sandcastle", "sand castle", "fairytale castle"),
    attributes=(
        Attribute("flat towers", ("with flat towers", "with flat roofs"), nouns=("fortress",)),
        Attribute("flags", ("with flags", "with a flag")),
        Attribute("keep", ("with a keep", "with a tall tower", "with a big tower")),
    ),
    parts=("towers", "four towers", "a gate", "walls", "battlements"),
    metres=20.0,
)
