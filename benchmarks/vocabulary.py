"""Writes docs/reference/vocabulary.md, all words that phrases of the library can have, or the file that is named.

python benchmarks/vocabulary.py [FILE]
"""

import sys
from itertools import groupby
from pathlib import Path

from diff3ds.library.categories import CATEGORIES
from diff3ds.library.category import Attribute, Category
from diff3ds.library.vocabulary import ACTIONS, COLORS, COUNTS, IDLE, PAIR, RELATIONS, SIZES, STRETCHES, UNSEEN

DOCUMENT = Path(__file__).parents[1] / "docs/reference/vocabulary.md"
AXES = ("front to back", "left to right", "up")
HEAD = """# What phrases can say

All words of phrases for the built-in priors, by [their grammar](../howto/phrase.md#the-built-in-prior); \
`python benchmarks/vocabulary.py` writes this page.

## Of every kind

| | words |
|---|---|
"""
KINDS = """
## Of each kind

An attribute is said in one of its ways, before the noun or behind "with" and "without"; a noun in brackets has it \
in itself. What goes behind "with" can also go behind "without", and says then that it is not there, and the other way \
round. Plurals and articles do not matter. Parts are what all of a kind have.

| kind | other nouns | attributes | parts |
|---|---|---|---|
"""


def document() -> str:
    """The whole page."""
    return (
        HEAD
        + "".join(_row(*cells) for cells in _of_every_kind())
        + f"\nWhere a thing stands: {', '.join(RELATIONS)}, in (a bowl).\n"
        + f"\nWhat it does, which says where it stands too: {', '.join(ACTIONS)}.\n"
        + KINDS
        + "".join(
            _row(category.name, ", ".join(category.synonyms), _attributes(category), ", ".join(category.parts))
            for category in CATEGORIES.values()
        )
    )


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |\n"


def _of_every_kind() -> list[tuple[str, str]]:
    by_count = groupby(sorted(COUNTS, key=COUNTS.__getitem__), COUNTS.__getitem__)
    numbers = ", ".join(f"{' or '.join(words)}" for _, words in by_count)
    alike = groupby(STRETCHES, STRETCHES.__getitem__)
    proportions = "; ".join(f"{', '.join(words)}: {_factors(factors)}" for factors, words in alike)
    return [
        ("numbers", f"{numbers}; {', '.join(PAIR)}: two, but one of {_pairs()}"),
        ("colours", ", ".join(COLORS)),
        ("proportions", proportions),
        (
            "sizes, of things in a scene; of one they change nothing, and the command says so",
            ", ".join(SIZES),
        ),
        ("what no line shows, which changes nothing, and the command says so", ", ".join(sorted(UNSEEN))),
        ("passed over", ", ".join(IDLE)),
    ]


def _pairs() -> str:
    return " and ".join(category.name for category in CATEGORIES.values() if category.pair)


def _factors(factors: tuple[float, float, float]) -> str:
    changed = [(factor, axis) for factor, axis in zip(factors, AXES, strict=True) if factor != 1]
    return f"× {changed[0][0]:g} {' and '.join(axis for _, axis in changed)}"


def _attributes(category: Category) -> str:
    return "; ".join(_attribute(attribute) for attribute in category.attributes)


def _attribute(attribute: Attribute) -> str:
    nouns = f" ({', '.join(attribute.nouns)})" if attribute.nouns else ""
    return " or ".join(attribute.phrases) + nouns


if __name__ == "__main__":
    Path(sys.argv[1] if len(sys.argv) > 1 else DOCUMENT).write_text(document(), encoding="utf-8")
