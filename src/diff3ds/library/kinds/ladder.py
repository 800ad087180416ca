"""Ladders: two rails and their rungs."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    line,
    mirror,
    polyline,
    rectangle,
    ring,
    smooth,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    foot, head, tall = vary(0.32, 0.42), vary(0.25, 0.31), vary(2.28, 2.92)
    rungs = 7
    if "folding" in attributes:
        tall, rungs, splay = 0.75 * tall, 5, vary(0.47, 0.63)
        parts = [mirror(line((splay, foot, 0), (0, head, tall))), mirror(line((-splay, foot, 0), (0, head, tall)))]
        parts.append(rectangle((0, 0, tall), (0.3, 2 * head)))
        parts.append(mirror(line((splay / 2, (foot + head) / 2, tall / 2), (-splay / 2, (foot + head) / 2, tall / 2))))
    elif "rope" in attributes:
        splay, sway = 0.0, 0.06
        rail = [(sway * (-1) ** i, foot, tall * (i + 0.5) / rungs) for i in range(rungs)]
        parts = [mirror(smooth((0, foot, 0), *rail, (0, foot, tall)))]
        return [*parts, *(line((x, -y - 0.08, z), (x, y + 0.08, z)) for x, y, z in rail)]
    else:
        splay = 0.0
        parts = [mirror(polyline((x, foot, 0), (x, head, tall))) for x in (-0.04, 0.04)]
    for i in range(rungs):
        t = (i + 0.6) / (rungs + 0.2)
        x, y = splay * (1 - t), foot + (head - foot) * t
        parts.append(line((x, -y, t * tall), (x, y, t * tall)))
    if "hooks" in attributes:
        parts.append(mirror(ring((-0.2, head, tall), 0.2, "y", 0, 180)))
    return parts


CATEGORY = Category(
    "ladder",
    _make,
    attributes=(
        Attribute("folding", ("folding",), nouns=("stepladder",), excludes=("rope", "hooks")),
        Attribute("rope", ("rope",), excludes=("hooks",)),
        Attribute("hooks", ("with hooks",)),
    ),
    parts=("rungs",),
    metres=2.5,
    leans=True,
)
