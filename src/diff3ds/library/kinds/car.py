"""Cars: a body with a narrower cabin on four wheels."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    between,
    box,
    curve,
    line,
    mirror,
    polyline,
    rectangle,
    reflect,
    ring,
    solid,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, half, low, belt = vary(1.79, 2.11), vary(0.69, 0.85), 0.28, vary(0.77, 0.93)
    roof, wheel, top = belt + vary(0.46, 0.66), vary(0.32, 0.42), 0.8 * half
    cowl, nose = 0.85, 0.62
    front = [(cowl, half, belt), (0.3, top, roof)]
    back = (
        [(-0.35, top, roof), (-0.45, half, belt)] if "pickup" in attributes else [(-1.0, top, roof), (-1.6, half, belt)]
    )
    if "convertible" in attributes:
        front, back = [(cowl, half, belt), (0.45, top, roof - 0.1)], []
        parts = [mirror(rectangle((x, 0.45 * half, belt), (0.6 * half, 0.4), "x")) for x in (-0.3, -1.2)]
    else:
        parts = [mirror(line((-0.4, half, belt), (-0.35, top, roof)))]
    parts.append(mirror(polyline(*front, *back)))
    body = [(-long, half, belt), (-long, half, low), (long, half, low), (long, half, nose)]
    parts.append(mirror(polyline(front[0], *body)))
    # What is solid: the body between its sides, and the cabin over it.
    for outline in ([*body, (cowl + 0.5, half, belt - 0.04), front[0]], [*front, *back]):
        if len(outline) > 2:
            left = polyline(*outline, closed=True)
            parts.append(solid(between(left, reflect(left))))
    parts.append(mirror(curve(body[-1], (long, half, belt - 0.08), (cowl + 0.5, half, belt - 0.04), front[0])))
    parts += [line((x, -y, z), (x, y, z)) for x, y, z in (*front, *back, *body)]
    for x in (0.62 * long, -0.62 * long):
        parts += [mirror(ring((x, half, wheel), radius, "y")) for radius in (wheel, 0.45 * wheel)]
    if "taxi" in attributes:
        parts.append(box((-0.3, 0, roof + 0.11), (0.25, 0.6, 0.22)))
    return parts


CATEGORY = Category(
    "car",
    _make,
    synonyms=("automobile", "motor car", "sports car", "racing car", "race car"),
    attributes=(
        Attribute("convertible", ("with an open top", "open-top"), nouns=("convertible",), excludes=("pickup", "taxi")),
        Attribute("pickup", ("with a load bed",), nouns=("pickup", "pickup truck"), excludes=("taxi",)),
        Attribute("taxi", ("with a taxi sign",), nouns=("taxi", "cab")),
    ),
    parts=(
        "wheels",
        "four wheels",
    ),
    metres=4.3,
)
