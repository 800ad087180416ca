"""Wine glasses: a bowl on a stem and a foot."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    curve,
    lathe,
    line,
    ring,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    foot, stem, bowl = vary(0.34, 0.44), vary(0.79, 1.11), vary(0.81, 1.05)
    rim, belly = vary(0.3, 0.4), vary(0.53, 0.69)
    top = stem + bowl
    if "flute" in attributes:
        rim, belly, top = 0.2, 0.34, stem + 1.5 * bowl
    side = curve((0, 0, stem), (belly * 4 / 3, 0, stem), (belly, 0, stem + 0.5 * (top - stem)), (rim, 0, top))
    level, surface = stem + 0.42 * (top - stem), 0.93 * belly
    if "cocktail" in attributes:
        rim, top = 0.75, stem + 0.7
        side = line((0, 0, stem), (rim, 0, top))
        level, surface = stem + 0.5, rim * 0.5 / 0.7
    elif "flute" in attributes:
        surface = 0.83 * belly
    parts = [lathe(side, [(rim, top), (foot, 0)], meridians=4, start=45, open=True), line((0, 0, 0), (0, 0, stem))]
    if "wine" in attributes:
        parts.append(ring((0, 0, level), surface))
    if "straw" in attributes:
        parts.append(line((0, 0, stem + 0.1), (0, rim + 0.3, top + 0.45)))
    return parts


CATEGORY = Category(
    "wine glass",
    _make,
    synonyms=("glass", "stemmed glass", "glass of wine", "glass of water"),
    attributes=(
        Attribute("wine", ("with wine", "full")),
        Attribute("flute", ("tall", "slender"), nouns=("champagne flute", "champagne glass")),
        Attribute(
            "cocktail",
            ("with a conical bowl",),
            nouns=("cocktail glass", "martini glass"),
            excludes=("flute",),
        ),
        Attribute("straw", ("with a straw",)),
    ),
    parts=(
        "a stem",
        "a foot",
    ),
    mirror="x",
    metres=0.22,
)
