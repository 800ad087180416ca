"""Phrases of the library: what of, with what, how many, in which colour and proportions.

    [a sketch of] [a | two | ... six] [big | tall | wide ...] [colour] [attribute ...] NOUN [with X [and Y]] [without Z]

Nouns and attributes are those of the categories; plurals are understood. What is not understood is an error.
"""

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass

from diff3ds.library.categories import CATEGORIES
from diff3ds.library.category import Category
from diff3ds.library.vocabulary import (
    COLORS,
    COUNTS,
    IDLE,
    PAIRS,
    SIZES,
    STRETCHES,
    parted,
    singulars,
    stretched,
    words_of,
)

SUGGESTIONS = 4


@dataclass(frozen=True)
class Request:
    """What a phrase asks for.

    Attributes:
        category: name of what it is.
        attributes: names of what each has, in the category's order.
        count: how many.
        color: straight RGB, or None if none is said.
        stretch: factors along x, y and z.
        ignored: its words of size, without effect.
    """

    category: str
    attributes: tuple[str, ...] = ()
    count: int = 1
    color: tuple[float, float, float] | None = None
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ignored: tuple[str, ...] = ()


def parse(phrase: str) -> Request:
    """What a phrase asks for.

    Raises:
        ValueError: it is empty, or a word is outside the vocabulary; names the nearest words that are known.
    """
    front, behind = parted(phrase)
    if not front and not behind:
        raise ValueError("the phrase is empty: say what to draw, such as a chair")
    category, implied, first = _noun(front, phrase)
    request = _Reader(category, phrase, implied)
    request.read_before(front[:first])
    request.read_behind(behind)
    return request.finished()


class _Reader:
    """What has been understood of a phrase so far."""

    def __init__(self, category: Category, phrase: str, implied: str | None) -> None:
        self.category = category
        self.phrase = phrase
        self.attributes = {implied} if implied else set()
        self.count: int | None = None
        self.color: tuple[float, float, float] | None = None
        self.proportions: list[str] = []
        self.sizes: list[str] = []
        # From every way to say an attribute, as words, to its name.
        self.ways = {
            tuple(words_of(way)): attribute.name for attribute in category.attributes for way in attribute.phrases
        }

    def read_before(self, words: list[str]) -> None:
        """Counts, colours, proportions and attributes before the noun; attributes come first: a tall mug is a kind."""
        place = 0
        while place < len(words):
            length = next(
                (n for n in range(len(words) - place, 0, -1) if tuple(words[place : place + n]) in self.ways), 0
            )
            if length:
                self.attributes.add(self.ways[tuple(words[place : place + length])])
                self.proportions += [
                    word for word in words[place : place + length] if length == 1 and word in STRETCHES
                ]
            else:
                self._read_word(words[place])
            place += length or 1

    def _read_word(self, word: str) -> None:
        if word in COUNTS or word == "pair":
            if self.count is not None:
                raise ValueError(f"{self.phrase!r}: there is one number of things, got a second one, {word}")
            self.count = COUNTS.get(word, 1 if self.category.name in PAIRS else 2)
        elif word in COLORS:
            if self.color is not None:
                raise ValueError(f"{self.phrase!r}: strokes have one colour, got a second one, {word}")
            self.color = COLORS[word]
        elif word in STRETCHES:
            self.proportions.append(word)
        elif word in SIZES:
            self.sizes.append(word)
        elif word not in IDLE:
            known = [*COLORS, *STRETCHES, *COUNTS, *(" ".join(way) for way in self.ways)]
            raise ValueError(_unknown(self.phrase, word, known))

    def read_behind(self, words: list[str]) -> None:
        """Attributes behind the noun: "with armrests and a high back without ..."."""
        if words and words[-1] in ("with", "without", "and"):
            raise ValueError(f"{self.phrase!r}: nothing follows {words[-1]!r}")
        clauses = re.findall(r"(with|without) (.*?)(?= with | without |$)", " ".join(words))
        for preposition, said in clauses:
            rest = said.removesuffix(" and")
            while rest:
                # A way to say it may itself have an "and".
                pieces = rest.split(" and ")
                for count in range(len(pieces), 0, -1):
                    head = " and ".join(pieces[:count])
                    name = self._named(preposition, head)
                    if name is not None:
                        self.attributes.add(name)
                        rest = " and ".join(pieces[count:])
                        break
                else:
                    known = [" ".join(way) for way in self.ways if way[0] in ("with", "without")]
                    raise ValueError(_unknown(self.phrase, f"{preposition} {pieces[0]}", known))

    def _named(self, preposition: str, said: str) -> str | None:
        """The attribute that "with armrests", "with a high back" or "with two towers" means, articles or not."""
        wanted = _bare(f"{preposition} {said}")
        return next((name for way, name in self.ways.items() if _bare(" ".join(way)) == wanted), None)

    def finished(self) -> Request:
        """The request; attributes must go together."""
        names = tuple(a.name for a in self.category.attributes if a.name in self.attributes)
        if names not in self.category.combinations():
            raise ValueError(f"{self.phrase!r}: no {self.category.name} is all of this at once: {', '.join(names)}")
        kinds = [way[0] for way in self.ways if len(way) == 1]
        stretch = stretched(self.phrase, self.proportions, kinds)
        return Request(self.category.name, names, self.count or 1, self.color, stretch, tuple(self.sizes))


def _noun(words: list[str], phrase: str) -> tuple[Category, str | None, int]:
    """The category, the attribute that its noun implies, and where the noun starts: it ends the words."""
    nouns = _nouns()
    for first in range(len(words)):
        said = " ".join(words[first:])
        for candidate in (said, *singulars(said)):
            if candidate in nouns:
                return (*nouns[candidate], first)
    said = words[-1] if words else phrase
    raise ValueError(_unknown(phrase, said, nouns))


def _nouns() -> dict[str, tuple[Category, str | None]]:
    """Every noun, lower case: its category, and the attribute that it implies."""
    nouns: dict[str, tuple[Category, str | None]] = {}
    for category in CATEGORIES.values():
        for attribute in category.attributes:
            for noun in attribute.nouns:
                nouns.setdefault(" ".join(words_of(noun)), (category, attribute.name))
    for category in CATEGORIES.values():
        for noun in (category.name, *category.synonyms):
            nouns[" ".join(words_of(noun))] = (category, None)
    return nouns


def _bare(text: str) -> str:
    return " ".join(word for word in text.split() if word not in ("a", "an", "the"))


def _unknown(phrase: str, said: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(said, list(known), SUGGESTIONS, cutoff=0.5)
    hint = f"the nearest that it knows: {', '.join(near)}" if near else f"it draws {', '.join(sorted(CATEGORIES))}"
    return (
        f"{phrase!r}: the built-in prior does not know {said!r}; {hint}. "
        'For any phrase use MVDream, on a GPU: diff3ds fetch mvdream, then diff3ds text "..." --prior mvdream'
    )
