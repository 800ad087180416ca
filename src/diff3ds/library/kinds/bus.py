"""Buses: a long box with a row of windows."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    box,
    detail,
    join,
    line,
    mirror,
    polyline,
    rectangle,
    ring,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, half, low = vary(1.84, 2.16), vary(0.46, 0.57), 0.22
    sill, head, roof, wheel = 0.85, 1.3, vary(1.46, 1.66), 0.27
    if "two floors" in attributes:
        roof += 0.75
    parts = [box((0, 0, (low + roof) / 2), (2 * long, 2 * half, roof - low))]
    for rise in (0.0, 0.75)[: 1 + ("two floors" in attributes)]:
        strip = [polyline((long - 0.25, half, z + rise), (-long + 0.15, half, z + rise)) for z in (sill, head)]
        bars = [
            line((x * long, half, sill + rise), (x * long, half, head + rise)) for x in (-0.9, -0.45, 0, 0.45, 0.85)
        ]
        parts.append(detail(mirror(join(*strip, *bars))))
        parts.append(rectangle((long, 0, (sill + head) / 2 + rise), (1.7 * half, head - sill), "x"))
    for x in (0.6 * long, -0.6 * long):
        parts.append(mirror(ring((x, half, wheel), wheel, "y")))
    parts.append(detail(mirror(ring((long, 0.7 * half, 0.45), 0.09, "x"))))
    if "hood" in attributes:
        parts.append(box((long + 0.3, 0, (low + 0.75) / 2), (0.6, 1.7 * half, 0.75 - low)))
        parts[-2] = mirror(ring((long + 0.6, 0.6 * half, 0.5), 0.09, "x"))
    if "poles" in attributes:
        parts.append(mirror(line((0.4, 0.2, roof), (-0.9 * long, 0.2, roof + 0.7))))
        parts.append(mirror(line((-1.2 * long, 0.2, roof + 0.72), (1.2 * long, 0.2, roof + 0.72))))
    return parts


CATEGORY = Category(
    "bus",
    _make,
    synonyms=("coach",),
    attributes=(
        Attribute(
            "two floors", ("double-decker", "with two floors"), nouns=("double-decker",), excludes=("hood", "poles")
        ),
        Attribute("hood", ("with a hood",), nouns=("school bus",), excludes=("poles",)),
        Attribute("poles", ("with trolley poles",), nouns=("trolleybus",)),
    ),
    parts=(
        "wheels",
        "four wheels",
        "windows",
        "headlights",
    ),
    metres=11,
)
