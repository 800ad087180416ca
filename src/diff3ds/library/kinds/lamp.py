"""Lamps: a shade over a turned foot on a table, on a tall pole, on an arm with joints or on a cord."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, between, curve, lathe, line, move, polyline, ring, turn


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, narrow, tall = vary(0.46, 0.66), vary(0.23, 0.39), vary(0.45, 0.69)
    belly, foot = vary(0.22, 0.36), vary(0.24, 0.36)
    shade = lathe(line((wide, 0, 0), (narrow, 0, tall)), [(wide, 0), (narrow, tall)], meridians=6, open=True)
    if "hanging" in attributes:
        return [shade, line((0, 0, tall), (0, 0, tall + 1.1)), ring((0, 0, tall + 1.1), 0.15), ring((0, 0, 0.02), 0.13)]
    if "desk" in attributes:
        elbow, tip = (-vary(0.59, 0.91), 0, vary(0.65, 0.89)), (vary(0.15, 0.35), 0, vary(1.34, 1.66))
        arm = [polyline((0, 0, 0.06), elbow, tip), ring(elbow, 0.07, "y")]
        base = between(ring((0, 0, 0), 0.42), ring((0, 0, 0.06), 0.42))
        head = lathe(
            curve((0.42, 0, -0.5), (0.4, 0, -0.2), (0.15, 0, -0.1), (0.12, 0, 0.05)), [(0.42, -0.5), (0.12, 0.05)]
        )
        return [*arm, base, move(turn(head, 35, "y"), tip)]
    if "floor" in attributes:
        base = between(ring((0, 0, 0), foot), ring((0, 0, 0.06), foot))
        return [base, line((0, 0, 0.06), (0, 0, 2.6)), move(shade, (0, 0, 2.1))]
    vase = curve((foot, 0, 0), (2 * belly, 0, 0.35), (0.02, 0, 0.5), (0.05, 0, 0.9))
    return [
        lathe(vase, [(foot, 0)]),
        line((0, 0, 0.9), (0, 0, 1.05)),
        ring((0, 0, 0.9), 0.05),
        move(shade, (0, 0, 0.95)),
    ]


CATEGORY = Category(
    "lamp",
    _make,
    synonyms=("light",),
    attributes=(
        Attribute("floor", ("floor", "standing"), excludes=("desk", "hanging")),
        Attribute("desk", ("desk", "with a jointed arm"), excludes=("hanging",)),
        Attribute("hanging", ("hanging", "ceiling"), nouns=("pendant light",)),
    ),
    parts=("a shade",),
    metres=0.5,
)
