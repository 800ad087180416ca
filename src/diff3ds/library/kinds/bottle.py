"""Bottles: a body, a shoulder and a neck, turned."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, between, curve, join, lathe, line, ring


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    body, neck = vary(0.32, 0.44), vary(0.1, 0.15)
    shoulder, rise, top = vary(1.04, 1.36), vary(0.29, 0.48), vary(2.04, 2.36)
    throat = shoulder + rise
    if "flask" in attributes:
        body, shoulder = 0.8, 0.0
        throat, top = 1.45, vary(1.94, 2.26)
        profile = join(
            curve((0.4, 0, 0), (1.1, 0, 0.1), (0.9, 0, 1.25), (neck, 0, throat)),
            line((neck, 0, throat), (neck, 0, top)),
        )
        rings = [(0.4, 0.0), (neck, throat)]
    else:
        bend = curve(
            (body, 0, shoulder), (body, 0, shoulder + 0.6 * rise), (neck, 0, throat - 0.4 * rise), (neck, 0, throat)
        )
        profile = join(line((body, 0, 0), (body, 0, shoulder)), bend, line((neck, 0, throat), (neck, 0, top)))
        rings = [(body, 0.0), (body, shoulder), (neck, throat)]
    parts = [lathe(profile, [*rings, (neck, top), (1.25 * neck, top - 0.1)])]
    if "label" in attributes:
        parts += [ring((0, 0, z * shoulder), body) for z in (0.25, 0.75)]
    if "cork" in attributes:
        parts.append(between(ring((0, 0, top), 0.8 * neck), ring((0, 0, top + 0.2), neck)))
    return parts


CATEGORY = Category(
    "bottle",
    _make,
    synonyms=("wine bottle", "bottle of wine", "bottle of water", "water bottle"),
    attributes=(
        Attribute("label", ("with a label", "labelled"), excludes=("flask",)),
        Attribute("cork", ("with a cork", "corked")),
        Attribute("flask", ("round", "with a round body"), nouns=("flask",)),
    ),
    parts=("a neck",),
    metres=0.3,
)
