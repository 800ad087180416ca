"""Bookshelves: a tall case with shelves, with or without books."""

from collections.abc import Collection

from diff3ds.library.category import Attribute, Category, Vary
from diff3ds.library.shapes import (
    Part,
    box,
    line,
    mirror,
    polyline,
    rectangle,
    reflect,
    ring,
)


def _make(vary: Vary, attributes: Collection[str]) -> list[Part]:
    half, deep, shelves = vary(0.47, 0.63), vary(0.18, 0.28), 4
    gap = vary(0.42, 0.52)
    if "low" in attributes:
        half, shelves = 1.5 * half, 2
    height = shelves * gap
    parts = [box((0, 0, height / 2), (2 * deep, 2 * half, height))]
    for shelf in range(1, shelves):
        parts.append(rectangle((0, 0, shelf * gap), (2 * deep, 2 * half)))
    if "books" in attributes:
        for shelf in range(shelves):
            y = half
            for thick in (0.14, 0.1, 0.16, 0.12)[: 4 - shelf % 2]:
                tall = vary(0.54, 0.91) * gap
                book = polyline(
                    (deep, y, shelf * gap + tall), (deep, y - thick, shelf * gap + tall), (deep, y - thick, shelf * gap)
                )
                parts.append(book if shelf % 2 else reflect(book))
                y -= thick
    if "doors" in attributes:
        parts.append(line((deep, 0, 0), (deep, 0, gap)))
        parts.append(mirror(ring((deep, 0.08, gap / 2), 0.035, "x")))
    return parts


CATEGORY = Category(
    "bookshelf",
    _make,
    synonyms=("bookcase", "shelf", "book shelf", "book case"),
    attributes=(
        Attribute("books", ("with books", "full")),
        Attribute("low", ("low", "wide")),
        Attribute("doors", ("with doors",)),
    ),
    parts=("shelves",),
    mirror=None,
    metres=1.9,
)
