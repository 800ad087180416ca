"""Spiders: a ball of an abdomen, a small head and eight bent legs."""

from collections.abc import Collection

from diff3ds.library.animals import eyes
from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, ball, ellipse, line, mirror, polyline, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    r, knee, reach = vary(0.32, 0.42), vary(0.5, 0.68), vary(0.95, 1.15)
    high = 0.36
    parts = [
        ellipse((-0.5, 0, high + 0.06), (1.15 * r, 0, 0), (0, r, 0)),
        ellipse((-0.5, 0, high + 0.06), (1.15 * r, 0, 0), (0, 0, 0.9 * r)),
    ]
    parts.append(ellipse((-0.5, 0, high + 0.06), (0, r, 0), (0, 0, 0.9 * r)))
    parts += [ring((0.12, 0, high), 0.24, axis) for axis in ("z", "y")]
    parts += [ball((-0.5, 0, high + 0.06), (1.15 * r, r, 0.9 * r)), ball((0.12, 0, high), 0.24)]
    for x, ahead in ((0.24, 0.8), (0.15, 0.36), (0.06, -0.18), (-0.04, -0.72)):
        hip = (x, 0.2, high)
        bend = (x + 0.5 * ahead, 0.2 + 0.45 * reach, high + knee)
        parts.append(mirror(polyline(hip, bend, (x + ahead, 0.2 + reach, 0))))
    parts.append(eyes(0.33, 0.08, high + 0.1, 0.05, "x"))
    parts.append(mirror(line((0.34, 0.06, high - 0.06), (0.44, 0.04, high - 0.2))))
    if "thread" in attributes:
        parts.append(line((-0.5, 0, high + 0.06 + 0.9 * r), (-0.5, 0, high + 1.9)))
    return parts


CATEGORY = Category(
    "spider",
    _make,
    synonyms=("tarantula",),
    attributes=(Attribute("thread", ("with a thread", "hanging", "with a string")),),
    parts=("legs", "eight legs", "eyes"),
    metres=0.15,
)
