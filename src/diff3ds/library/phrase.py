"""Phrases of the library: what of, with what, how many, in which colour and proportions.

    [a sketch of] [a | two | ... six] [pairs of] [big | tall | wide ...] [colour] [attribute ...] NOUN [in colour]
    [with X [and Y]] [without Z]

Nouns, attributes and parts are those of the categories; plurals are understood. What is not understood is an error.
"""

import difflib
import functools
import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from diff3ds.library.categories import CATEGORIES
from diff3ds.library.category import Category
from diff3ds.library.vocabulary import (
    COLORS,
    COUNTS,
    IDLE,
    NUMBERS,
    PAIR,
    SIZES,
    STRETCHES,
    UNSEEN,
    number,
    parted,
    singulars,
    stretched,
    words_of,
)

SUGGESTIONS = 4
# Of words that are near, as difflib has it: "chiar" is .8 of "chair", "sparkling" .63 of "rocking". Empirical.
NEAR = 0.7
# What can be said before all nouns.
GENERAL = {*COUNTS, *PAIR, *COLORS, *STRETCHES, *SIZES}
OPPOSITE = {"with": "without", "without": "with"}


@dataclass(frozen=True)
class Request:
    """What a phrase asks for.

    Attributes:
        category: name of what it is.
        attributes: names of what each has, in the category's order.
        count: how many.
        color: straight RGB, or None if none is said.
        stretch: factors along x, y and z.
        ignored: its words of size, and of what no line shows, without effect.
        corrected: words that were misspelt, each with what it is taken for.
    """

    category: str
    attributes: tuple[str, ...] = ()
    count: int = 1
    color: tuple[float, float, float] | None = None
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ignored: tuple[str, ...] = ()
    corrected: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class _Noun:
    """A noun that ends some words.

    Attributes:
        category: what it means.
        implied: the attribute that it has in itself ("armchair"), or None.
        said: the noun as it is said.
        first: its place in the words.
        plural: whether it is one.
    """

    category: Category
    implied: str | None
    said: str
    first: int
    plural: bool


def parse(phrase: str) -> Request:
    """What a phrase asks for.

    Raises:
        ValueError: it is empty, or a word is outside the vocabulary; names the nearest words that are known.
    """
    (front, behind), corrected = corrected_parts(phrase)
    if not front and not behind:
        raise ValueError("the phrase is empty: say what to draw, such as a chair")
    noun = _ending(front)
    if noun is None:
        front = _unseen_first(front)
        noun = _ending(front)
    if noun is None:
        raise ValueError(_no_noun(front, phrase))
    request = _Reader(noun, phrase)
    request.read_before(front[: noun.first])
    request.read_behind(behind)
    return replace(request.finished(), corrected=corrected)


def corrected_parts(phrase: str) -> tuple[tuple[list[str], list[str]], tuple[tuple[str, str], ...]]:
    """The words of a phrase, `parted`, and those that were misspelt, each with the known word that it is taken for."""
    parts = parted(phrase)
    found = {word: meant for word in itertools.chain(*parts) if (meant := _meant(word)) != word}
    front, behind = ([found.get(word, word) for word in part] for part in parts)
    return (front, behind), tuple(found.items())


@functools.lru_cache(maxsize=4096)
def _meant(word: str) -> str:
    """The known word that a word is a slip of, or the word."""
    if word in _words():
        return word
    meant = {other for other in _near_in_length(len(word)) if is_slip(word, other)}
    return min(meant, key=lambda other: (sorted(other) != sorted(word), other), default=word)


class _Reader:
    """What has been understood of a phrase so far."""

    def __init__(self, noun: _Noun, phrase: str) -> None:
        self.noun = noun
        self.category = noun.category
        self.phrase = phrase
        self.attributes = {noun.implied} if noun.implied else set()
        self.absent: set[str] = set()
        self.numbers: list[str] = []
        self.color: tuple[float, float, float] | None = None
        self.proportions: list[str] = []
        self.ignored: list[str] = []
        self.ways = _ways(self.category)

    def read_before(self, words: list[str]) -> None:
        """Counts, colours, proportions and attributes before the noun; attributes come first: a tall mug is a kind."""
        place = 0
        while place < len(words):
            heads = {n: " ".join(words[place : place + n]) for n in range(len(words) - place, 0, -1)}
            length = next((n for n, head in heads.items() if head in self.ways), 0)
            if length:
                self.attributes.add(self.ways[heads[length]])
            elif not self._takes_word(words[place]):
                raise ValueError(self._unknown_before(words, words[place]))
            if length <= 1 and words[place] in STRETCHES:
                self.proportions.append(words[place])
            place += length or 1

    def _takes_word(self, word: str) -> bool:
        """Whether a word is one of those that go with all nouns; heeds it."""
        if word in COUNTS or word in PAIR:
            self.numbers.append(word)
        elif word in COLORS:
            if self.color is not None:
                raise ValueError(f"{self.phrase!r}: strokes have one colour, got a second one, {word}")
            self.color = COLORS[word]
        elif word in SIZES or word in UNSEEN:
            self.ignored.append(word)
        return word in GENERAL or word in IDLE or word in UNSEEN

    def _unknown_before(self, words: list[str], word: str) -> str:
        other = _last_noun(words)
        if other is not None:
            return self._two_kinds(other)
        if word.isdecimal():
            return f"{self.phrase!r}: it draws one to {NUMBERS[-1]} things, got {word}"
        return self.unknown(word)

    def read_behind(self, words: list[str]) -> None:
        """Attributes and parts behind the noun: "with armrests and a high back without ..."."""
        if words and words[-1] in ("with", "without", "and"):
            raise ValueError(f"{self.phrase!r}: nothing follows {words[-1]!r}")
        for preposition, said in re.findall(r"(with|without) (.*?)(?= with | without |$)", " ".join(words)):
            rest = said.removesuffix(" and")
            while rest:
                # A way to say it may itself have an "and".
                pieces = rest.split(" and ")
                heads = {n: " and ".join(pieces[:n]) for n in range(len(pieces), 0, -1)}
                count = next((n for n, head in heads.items() if self._takes(preposition, head)), 0)
                if not count:
                    raise ValueError(self._unknown_behind(preposition, pieces[0]))
                rest = " and ".join(pieces[count:])

    def _takes(self, preposition: str, said: str) -> bool:
        """Whether this is an attribute, the lack of one, or a part that all have; heeds it."""
        name, lacking = self._named(preposition, said), self._named(OPPOSITE[preposition], said)
        part = _bare(said) in map(_bare, self.category.parts)
        first, _, rest = re.sub(r"^(a|an|the) ", "", said).partition(" ")
        if name is None and lacking is None and not part and rest and first in {*COUNTS, *SIZES, *UNSEEN, *STRETCHES}:
            # "with 3 windows", "with a tiny door", "with a long tail"
            known = self._takes(preposition, rest)
            self.ignored += [first if first in COUNTS or first in UNSEEN else f"{first} {rest}"] if known else []
            return known
        if name is not None:
            self.attributes.add(name)
        elif lacking is not None:
            self.absent.add(lacking)
        elif part and preposition == "without":
            raise ValueError(f"{self.phrase!r}: every {self.category.name} of the library has {said}")
        return name is not None or lacking is not None or part

    def _named(self, preposition: str, said: str) -> str | None:
        """The attribute that "with armrest", "with a high back" or "with a cherry on top" means, articles or not."""
        wanted = _bare(f"{preposition} {said}".removesuffix(" on top"))
        return next((name for way, name in self.ways.items() if _bare(way) == wanted), None)

    def _unknown_behind(self, preposition: str, said: str) -> str:
        words = [word for word in said.split() if word != "in"]
        late = next((word for word in words if word in COLORS or word in STRETCHES or word in self.ways), None)
        if late is not None and (words == [late] or self._takes(preposition, " ".join(w for w in words if w != late))):
            return f"{self.phrase!r}: put {late!r} before {self.noun.said!r}: it is of the whole thing"
        return self.unknown(said, preposition, _ending(words))

    def unknown(self, said: str, preposition: str = "", other: _Noun | None = None) -> str:
        """The nearest of what can be said of this category, another noun that it is, or all that can be said."""
        usual = [a.phrases[0] for a in self.category.attributes] + [f"with {part}" for part in self.category.parts]
        known = {_bare(re.sub(r"^with(out)? ", "", way)): way for way in (*self.ways, *usual)}
        if not preposition:
            known |= {word: word for word in (*COLORS, *STRETCHES, *SIZES, *NUMBERS)}
        if other is not None and not _near(said, known):
            return self._two_kinds(other)
        everything = (
            f"what it knows of {self.category.captions()[0]}: {', '.join(usual)}; colours: {', '.join(COLORS)}; "
            f"proportions: {', '.join(STRETCHES)}; numbers: one to {NUMBERS[-1]}"
        )
        return _unknown(self.phrase, f"{preposition} {said}".strip(), _near(said, known), everything)

    def _two_kinds(self, other: _Noun) -> str:
        return (
            f"{self.phrase!r}: it draws one kind of thing at a time, and {other.said!r} and {self.noun.said!r} are two"
        )

    def finished(self) -> Request:
        """The request; attributes must go together."""
        both = self.attributes & self.absent
        if both:
            raise ValueError(f"{self.phrase!r} contradicts itself: {', '.join(sorted(both))}")
        names = tuple(a.name for a in self.category.attributes if a.name in self.attributes)
        if names not in self.category.combinations():
            raise ValueError(f"{self.phrase!r}: no {self.category.name} is all of this at once: {', '.join(names)}")
        stretch = stretched(self.phrase, self.proportions, self.ways)
        if self.noun.plural and not self.numbers:
            raise ValueError(f"{self.phrase!r}: say how many: two {self.noun.said}, or one")
        count = number(self.phrase, self.numbers, self.category.pair)
        return Request(self.category.name, names, count, self.color, stretch, tuple(self.ignored))


def _ways(category: Category) -> dict[str, str]:
    """From every way to say an attribute, as lower case words, to its name."""
    return {" ".join(words_of(way)): a.name for a in category.attributes for way in a.phrases}


def _ending(words: Sequence[str]) -> _Noun | None:
    """The longest noun that ends the words."""
    nouns = _nouns()
    for first in range(len(words)):
        said = " ".join(words[first:])
        for candidate in (said, *singulars(said)):
            if candidate in nouns:
                return _Noun(*nouns[candidate], said, first, candidate != said)
    return None


def _unseen_first(words: list[str]) -> list[str]:
    """Words with what no line shows before the noun, where it is behind: "a cat sleeping", "a chair that is old"."""
    end = len(words)
    while end and words[end - 1] in UNSEEN:
        end -= 1
    noun = re.sub(r" (that|which|who) (is|are)$", "", " ".join(words[:end])).split()
    return [*words[end:], *noun] if _ending(noun) is not None else words


def _last_noun(words: Sequence[str]) -> _Noun | None:
    """The last noun among the words."""
    return next((noun for end in range(len(words), 0, -1) if (noun := _ending(words[:end])) is not None), None)


def _no_noun(words: list[str], phrase: str) -> str:
    """What is wrong with words that no noun ends."""
    noun = _last_noun(words)
    if noun is not None:
        behind = words[noun.first + len(noun.said.split()) :]
        late = next((word for word in behind if word in GENERAL or word in _ways(noun.category)), None)
        if late is not None:
            return f"{phrase!r}: put {late!r} before {noun.said!r}"
    if {*words} <= GENERAL | {*IDLE} | UNSEEN:
        return f"{phrase!r} names nothing: say what to draw, such as a chair"
    near = _near(words[-1], {noun: noun for noun in _nouns()})
    if noun is not None and not near:
        return _Reader(noun, phrase).unknown(words[-1])
    return _unknown(phrase, words[-1], near, f"it draws {', '.join(sorted(CATEGORIES))}")


@functools.cache
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


@functools.cache
def _words() -> frozenset[str]:
    """Every word that a phrase may have, plurals included."""
    said = [*_nouns(), *GENERAL, *IDLE, *UNSEEN, "in", "with", "without", "no"]
    said += [way for c in CATEGORIES.values() for a in c.attributes for way in a.phrases]
    said += [part for category in CATEGORIES.values() for part in category.parts]
    words = {word for way in said for word in words_of(way)}
    plurals = {word + ending for word in words for ending in ("s", "es")}
    return frozenset(words | plurals | {word.removesuffix("s") for word in words})


@functools.cache
def _near_in_length(length: int) -> tuple[str, ...]:
    """The words that differ by one letter at most in length."""
    return tuple(word for word in _words() if abs(len(word) - length) <= 1)


def is_slip(word: str, known: str) -> bool:
    """Whether a word is surely a known one with a slip of the pen: two letters swapped, or one too many or too few.

    Doubled letters slip in any word; of others the known word must have seven letters, and a wrong letter is none:
    "hose" is no house, "bride" no bridge, and "horse" no slip of "house".
    """
    if min(len(word), len(known)) < 4:
        return False
    if len(word) == len(known):
        wrong = [i for i in range(len(word)) if word[i] != known[i]]
        swapped = len(wrong) == 2 and (word[wrong[0]], word[wrong[1]]) == (known[wrong[1]], known[wrong[0]])
        # Farther apart in long words only, and never the first: "bycicle".
        return swapped and (wrong[1] == wrong[0] + 1 or (len(known) >= 7 and wrong[0] > 0))
    short, long = sorted((word, known), key=len)
    if len(long) != len(short) + 1:
        return False
    at = next((i for i in range(len(short)) if short[i] != long[i]), len(short))
    doubled = (at > 0 and long[at] == long[at - 1]) or (at + 1 < len(long) and long[at] == long[at + 1])
    return short[at:] == long[at + 1 :] and (doubled or len(known) >= 7)


def _bare(text: str) -> str:
    """Without articles and plurals."""
    words = (word for word in text.split() if word not in ("a", "an", "the"))
    return " ".join(word.removesuffix("s") for word in words)


def _near(said: str, known: Mapping[str, str]) -> list[str]:
    """What is known by keys that are like what is said."""
    return [known[key] for key in difflib.get_close_matches(_bare(said), list(known), SUGGESTIONS, NEAR)]


def _unknown(phrase: str, said: str, near: list[str], otherwise: str) -> str:
    hint = f"the nearest that it knows: {', '.join(near)}" if near else otherwise
    return (
        f"{phrase!r}: the built-in prior does not know {said!r}; {hint}. "
        "For anything else use a network, on a GPU: for phrases diff3ds fetch mvdream, then --prior mvdream; for "
        "pictures zero123 in its place"
    )
