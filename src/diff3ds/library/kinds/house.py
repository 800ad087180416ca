"""Houses: four walls and a gable roof, a door and windows in the gable."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import Part, box, detail, extrude, mirror, polyline, rectangle


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, deep, walls = vary(0.65, 0.89), vary(0.68, 1.07), vary(0.76, 0.99)
    roof, door = vary(0.47, 0.78), vary(0.13, 0.19)
    floors = 2 if "two floors" in attributes else 1
    eaves = floors * walls
    if "flat roof" in attributes:
        roof, over = 0.12, 0.1
        parts = [box((0, 0, eaves / 2), (2 * deep, 2 * half, eaves))]
        parts.append(box((0, 0, eaves + 0.06), (2 * (deep + over), 2 * (half + over), 0.12)))
    else:
        gable = polyline((deep, -half, 0), (deep, half, 0), (deep, half, eaves), (deep, 0, eaves + roof),
                         (deep, -half, eaves), closed=True)  # fmt: skip
        parts = [extrude(gable, (-2 * deep, 0, 0))]
    parts.append(detail(polyline((deep, -door, 0), (deep, -door, 0.58), (deep, door, 0.58), (deep, door, 0))))
    for floor in range(floors):
        height = 0.44 + floor * walls
        parts.append(detail(mirror(rectangle((deep, 0.55 * half + 0.05, height), (0.24, 0.28), "x"))))
    if "chimney" in attributes:
        x, low, high = -0.45 * deep, eaves + roof - 0.12, eaves + roof + 0.28
        parts.append(box((x, 0, (low + high) / 2), (0.24, 0.24, high - low)))
    return parts


CATEGORY = Category(
    "house",
    _make,
    synonyms=("home", "cottage", "cabin", "hut"),
    attributes=(
        Attribute("chimney", ("with a chimney",)),
        Attribute("two floors", ("with two floors", "two-storey", "two-story")),
        Attribute("flat roof", ("with a flat roof", "flat-roofed"), nouns=("bungalow",)),
    ),
    parts=(
        "a door",
        "windows",
        "a roof",
    ),
    metres=10,
)
