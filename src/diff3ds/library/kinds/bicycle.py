"""Bicycles: two wheels, a frame, a saddle and handlebars."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    between,
    curve,
    line,
    mirror,
    polyline,
    rectangle,
    ring,
    smooth,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wheel, base = vary(0.48, 0.58), vary(0.78, 0.9)
    rear, front = (-base, 0, wheel), (base, 0, wheel)
    crank, seat, head = (-0.12, 0, wheel - 0.06), (-0.35, 0, vary(1.1, 1.22)), (0.6, 0, vary(1.1, 1.22))
    if "one wheel" in attributes:
        rear = front = (0, 0, wheel)
        crank, seat = front, (0, 0, 2.6 * wheel)
        parts = [
            mirror(polyline((0, 0.1, wheel), (0, 0.1, 2.1 * wheel), (0, 0, 2.15 * wheel))),
            line((0, 0, 2.15 * wheel), seat),
        ]
    else:
        neck = (0.56, 0, head[2] + 0.12)
        parts = [polyline(rear, crank, head, seat, rear), line(crank, (-0.38, 0, seat[2] + 0.12)), line(front, neck)]
        grip = curve(neck, (0.68, 0.2, neck[2] + 0.1), (0.55, 0.33, neck[2] + 0.1), (0.3, 0.33, neck[2] + 0.06))
        parts.append(mirror(grip))
        parts.append(ring(rear, wheel, "y"))
        seat = (-0.38, 0, seat[2] + 0.12)
    parts.append(ring(front, wheel, "y"))
    x, _, z = seat
    parts.append(mirror(smooth((x + 0.2, 0, z), (x - 0.1, 0.11, z + 0.02), (x - 0.18, 0, z + 0.03))))
    x, _, z = crank
    parts.append(ring(crank, 0.12, "y"))
    for side in (-1, 1):
        pedal = (x + 0.18 * side, 0.1 * side, z - 0.1 * side)
        parts += [line((x, 0.1 * side, z), pedal), line(pedal, (pedal[0], 0.28 * side, pedal[2]))]
    if "basket" in attributes:
        parts.append(between(rectangle((0.86, 0, 1.08), (0.22, 0.3)), rectangle((0.88, 0, 1.36), (0.34, 0.42))))
    if "spokes" in attributes:
        for at in (rear, front) if rear != front else (front,):
            parts.append(around(line((at[0] - wheel, 0, wheel), (at[0] + wheel, 0, wheel)), 5, "y", at)[::2])
    return parts


CATEGORY = Category(
    "bicycle",
    _make,
    synonyms=("bike",),
    attributes=(
        Attribute("basket", ("with a basket",), excludes=("one wheel",)),
        Attribute("spokes", ("with spokes",)),
        Attribute("one wheel", ("with one wheel",), nouns=("unicycle",)),
    ),
    parts=(
        "pedals",
        "a saddle",
    ),
    mirror=None,
    metres=1.8,
)
