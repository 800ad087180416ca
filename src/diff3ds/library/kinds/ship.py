"""Ships that carry people: a long hull with a sharp bow, decks, and funnels."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, box, curve, lathe, line, mirror, move, ring, side


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    wide, deep, deck = vary(0.26, 0.34), vary(0.32, 0.42), vary(0.72, 0.88)
    bow, stern = (1.3, 0, deep + 0.14), (-1.15, 0, deep)
    parts = [mirror(curve(bow, (0.9, wide, deep + 0.02), (0.6, 1.1 * wide, deep), (0.2, wide, deep)))]
    parts.append(mirror(curve((0.2, wide, deep), (-0.4, wide, deep), (-1.15, wide, deep), stern)))
    parts.append(side(bow[::2], (1.14, 0.2), (1.0, 0)))
    parts.append(side(stern[::2], (-1.1, 0.14), (-0.9, 0)))
    parts.append(mirror(curve((1.0, 0, 0), (0.7, 0.8 * wide, 0), (-0.8, 0.9 * wide, 0), (-0.9, 0, 0))))
    high = 0.24
    parts.append(box((-0.1, 0, deep + high / 2), (2 * deck, 1.3 * wide, high)))
    parts.append(box((-0.02, 0, deep + 1.45 * high), (1.3 * deck, 0.95 * wide, 0.9 * high)))
    top = deep + 1.9 * high
    funnel = lathe(line((0.1, 0, 0), (0.1, 0, 0.4)), [(0.1, 0.4), (0.1, 0.28)], 2, 0)
    places = (-0.42, -0.02, 0.38) if "three funnels" in attributes else (0.0,)
    parts += [move(funnel, (x * deck, 0, top)) for x in places]
    parts.append(line((0.85, 0, deep + 0.04), (0.85, 0, deep + 0.9)))
    if "portholes" in attributes:
        parts += [mirror(ring((x, 0.97 * wide, 0.6 * deep), 0.06, "y")) for x in (-0.6, -0.25, 0.1, 0.45)]
    if "guns" in attributes:
        for x, z in ((0.95, deep + 0.03), (-0.98, deep + 0.03)):
            ahead = 1 if x > 0 else -1
            parts.append(ring((x, 0, z + 0.07), 0.1))
            parts.append(mirror(line((x + 0.09 * ahead, 0.04, z + 0.07), (x + 0.36 * ahead, 0.04, z + 0.14))))
    if "smoke" in attributes:
        for x in places:
            x *= deck
            parts.append(curve((x, 0, top + 0.44), (x, 0, top + 0.7), (x - 0.4, 0, top + 0.5), (x - 0.5, 0, top + 0.8)))
    return parts


CATEGORY = Category(
    "ship",
    _make,
    synonyms=("steamship", "steam ship", "cruise ship", "ocean liner", "ferry", "steamboat", "steam boat"),
    attributes=(
        Attribute("three funnels", ("with three funnels", "with three chimneys")),
        Attribute("portholes", ("with portholes", "with round windows")),
        Attribute("guns", ("with guns", "with cannons"), nouns=("warship", "battleship")),
        Attribute("smoke", ("with smoke", "with steam")),
    ),
    parts=("a funnel", "a chimney", "a hull", "a mast", "a bow", "decks"),
    metres=60.0,
)
