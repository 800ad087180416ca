"""Steam trains: a boiler with a funnel and a dome, a cab, wheels with a rod."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    ball,
    box,
    curve,
    filled,
    join,
    lathe,
    line,
    mirror,
    move,
    polyline,
    rectangle,
    ring,
    sheet,
    solid,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, long, wheel, cab = vary(0.28, 0.33), vary(1.0, 1.2), vary(0.22, 0.27), vary(0.42, 0.52)
    half, floor = 0.36, 1.7 * wheel
    axis = floor + r
    rear = -0.5 * long
    front = 0.5 * long
    parts = [ring((x, 0, axis), r, "x") for x in (front, rear)]
    parts.append(sheet(*parts))
    parts.append(line((rear, 0, axis + r), (front, 0, axis + r)))
    parts.append(filled(rectangle((-cab / 2, 0, floor), (long + cab, 2 * half))))
    coupled = "wagon" in attributes
    # The cab with its roof, and the sill of its windows.
    roof = floor + 2.3 * r + 0.2
    parts.append(filled(rectangle((rear - cab / 2, 0, roof), (1.2 * cab, 2.2 * half))))
    parts += [mirror(line((x, half, floor), (x, half, roof))) for x in (rear, rear - cab)]
    parts.append(mirror(line((rear - cab, half, roof - 0.38), (rear, half, roof - 0.38))))
    tall = roof - 0.38 - floor
    parts.append(solid(box((rear - cab / 2, 0, floor + tall / 2), (cab, 2 * half, tall))))
    # The funnel widens, the dome is round.
    x, top = front - 0.16, axis + r + 0.42
    parts += [ring((x, 0, top), 0.15), ring((x, 0, axis + 0.97 * r), 0.09)]
    parts.append(mirror(line((x, 0.09, axis + 0.97 * r), (x, 0.15, top))))
    parts += [line((x + s * 0.09, 0, axis + r), (x + s * 0.15, 0, top)) for s in (-1, 1)]
    parts.append(move(solid(lathe(line((0.09, 0, axis + 0.97 * r), (0.15, 0, top)), [])), (x, 0, 0)))
    parts.append(
        curve((0.14, 0, axis + r), (0.14, 0, axis + r + 0.26), (-0.14, 0, axis + r + 0.26), (-0.14, 0, axis + r))
    )
    parts.append(ball((0, 0, axis + r), (0.135, 0.135, 0.195)))
    for at in (front - wheel, front - 3.2 * wheel, rear - 0.1):
        parts.append(mirror(filled(ring((at, half, wheel), wheel, "y"))))
    parts.append(mirror(line((front - wheel, half, 0.8 * wheel), (rear - 0.1, half, 0.8 * wheel))))
    if not coupled:
        # The cow catcher.
        nose = (front + 0.3, 0, 0.06)
        grate = polyline((front, half, floor), (front, half, 0.06), nose)
        parts += [mirror(grate), line((front, 0, floor), nose)]
        parts.append(mirror(solid(filled(join(grate, line(nose, (front, 0, floor)))))))
    if "smoke" in attributes:
        parts.append(
            curve((x, 0, top + 0.04), (x + 0.1, 0, top + 0.3), (x - 0.5, 0, top + 0.1), (x - 0.4, 0, top + 0.42))
        )
        parts.append(
            curve((x - 0.4, 0, top + 0.42), (x - 0.3, 0, top + 0.7), (x - 1.0, 0, top + 0.4), (x - 1.1, 0, top + 0.66))
        )
    if coupled:
        back = rear - cab - 0.14
        parts.append(box((back - 0.42, 0, floor + 0.26), (0.84, 2 * half, 0.52)))
        parts += [
            mirror(filled(ring((back - 0.42 + dx, half, 0.75 * wheel), 0.75 * wheel, "y"))) for dx in (-0.24, 0.24)
        ]
        parts.append(line((back, 0, floor), (back + 0.14, 0, floor)))
    return parts


CATEGORY = Category(
    "train",
    _make,
    synonyms=("steam train", "locomotive", "steam engine", "steam locomotive", "railway engine", "toy train"),
    attributes=(
        Attribute("smoke", ("with smoke", "with steam", "smoking", "steaming")),
        Attribute("wagon", ("with a wagon", "with a carriage", "with a coach")),
    ),
    parts=("a funnel", "a chimney", "wheels", "a cab", "windows"),
    metres=9.0,
)
