"""Hammers: a head with a face and a claw on a handle."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    around,
    curve,
    join,
    lathe,
    line,
    mirror,
    move,
    turn,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    long, grip, head, face = vary(1.43, 1.82), vary(0.064, 0.096), vary(0.28, 0.38), vary(0.11, 0.15)
    if "two-faced" in attributes:
        long, head, face = 1.2 * long, 1.2 * head, 1.5 * face
    if "mallet" in attributes:
        head, face = 1.35 * head, 2.0 * face
    parts = [
        lathe(
            curve((1.2 * grip, 0, 0), (1.2 * grip, 0, 0.5 * long), (0.6 * grip, 0, 0.6 * long), (0.6 * grip, 0, long)),
            [(1.2 * grip, 0)],
        )
    ]
    middle = long + 0.5 * face
    barrel = turn(lathe(line((face, 0, -head), (face, 0, head)), [(face, -head), (face, head)]), 90, "x")
    if "two-faced" in attributes or "mallet" in attributes:
        return [*parts, move(barrel, (0, 0, middle))]
    poll = lathe(line((face, 0, 0.6 * head), (face, 0, head)), [(face, head), (face, 0.6 * head)])
    neck = line((0.6 * face, 0, 0.6 * head), (0.7 * face, 0, -0.3 * head))
    parts.append(move(turn(join(poll, around(neck, 4)), 90, "x"), (0, 0, middle)))
    return [*parts, move(_claw(face, 0.3 * head, 1.5 * head), (0, 0, middle))]


def _claw(face: float, start: float, reach: float) -> Part:
    """Two prongs that bend down to the right."""
    upper = curve(
        (0.6 * face, start, 0.6 * face),
        (face, 0.6 * reach, 0.8 * face),
        (face, 0.9 * reach, 0),
        (face, reach, -1.6 * face),
    )
    lower = curve(
        (0.6 * face, start, -0.6 * face),
        (face, 0.5 * reach, -0.4 * face),
        (face, 0.8 * reach, -face),
        (face, reach, -1.6 * face),
    )
    inner = curve(
        (0, 0.6 * reach, 0.2 * face),
        (0.3 * face, 0.7 * reach, 0),
        (0.6 * face, 0.9 * reach, -0.5 * face),
        (face, reach, -1.6 * face),
    )
    return mirror(join(upper, lower, inner), "x")


CATEGORY = Category(
    "hammer",
    _make,
    attributes=(
        Attribute("two-faced", ("with two faces",), nouns=("sledgehammer",), excludes=("mallet",)),
        Attribute("mallet", ("with a wooden head",), nouns=("mallet",)),
    ),
    parts=("a handle",),
    mirror="x",
    metres=0.35,
)
