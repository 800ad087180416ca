"""Names of the sketches in a user's folder, and phrases of them: the noun comes last, or before "with".

A phrase, whose words are those of names:

    [a sketch of] [a | two | ... six] [tall | wide | ...] [colour] [word ...] NOUN [with word ...] [without word ...]
"""

import difflib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from diff3ds.library.phrase import GENERAL, SUGGESTIONS, Request
from diff3ds.library.vocabulary import (
    COLORS,
    COUNTS,
    IDLE,
    NUMBERS,
    PAIR,
    SIZES,
    STRETCHES,
    number,
    parted,
    singulars,
    split_behind,
    stretched,
    words_of,
)

# Things of which a pair is one.
PAIRS = ("glasses", "scissors")
# Words that say nothing in a name, and behind the noun of a phrase.
FILLERS = ("a", "an", "the", "and", "of")
# So many names are listed where none is near.
LISTED = 12


@dataclass(frozen=True)
class Name:
    """What a sketch is, by the words of its file's name.

    Attributes:
        noun: its kind: the last word, or the last one before "with" or "without".
        words: all others; behind "without" they are "without ...".
        said: the name as words: "rocking chair with armrests".
    """

    noun: str
    words: tuple[str, ...]
    said: str


def named(said: str) -> Name | None:
    """The name that a file's or folder's name has: words parted by _ or -, digits at its end dropped; None if none."""
    words = [word for word in words_of(said) if word[0].isalnum()]
    while words and (bare := words[-1].rstrip("0123456789")) != words[-1]:
        words = [*words[:-1], bare] if bare else words[:-1]
    front, clauses = split_behind(words)
    before = (word for word in front[:-1] if word not in FILLERS)
    return Name(front[-1], (*before, *_behind(clauses)), " ".join(words)) if front else None


def asked_of(names: Sequence[Name], phrase: str, place: str) -> Request:
    """Reads a phrase by the names of what is there: `category` is a noun, `attributes` are words of names.

    Args:
        place: what the names belong to, for messages.

    Raises:
        ValueError: it is empty, a word is neither in the names nor in the grammar, or nothing there is all of it; says
            the nearest names.
    """
    front, clauses = parted(phrase)
    if not front:
        raise ValueError(f"{phrase!r} names nothing: say what to draw, such as a {names[0].said}")
    nouns = {name.noun for name in names}
    noun = _among(front[-1], nouns)
    if noun is None and front[-1] in GENERAL and any(_among(word, nouns) for word in front):
        raise ValueError(f"{phrase!r}: put {front[-1]!r} before what it is of")
    if noun is None:
        known = {text: None for name in names for text in (name.noun, name.said)}
        raise ValueError(_unknown(phrase, front[-1], known, place))
    of_noun = [name for name in names if name.noun == noun]
    known = {word: None for name in of_noun for word in name.words}
    numbers = [word for word in front[:-1] if (word in COUNTS or word in PAIR) and _among(word, known) is None]
    if not numbers and front[-1] not in nouns and noun in singulars(front[-1]):
        raise ValueError(f"{phrase!r}: say how many: two {front[-1]}, or one")
    request = Request(noun, count=number(phrase, numbers, noun in PAIRS))
    for word in front[:-1]:
        if _among(word, known) is None and _among(word, nouns) is not None:
            raise ValueError(f"{phrase!r}: one kind of thing at a time, and {word!r} and {front[-1]!r} are two")
        request = _read(request, word, known, phrase, place)
    proportions = [word for word in front[:-1] if word in STRETCHES]
    request = replace(request, stretch=stretched(phrase, proportions, request.attributes))
    for word in _behind(clauses):
        found = _among(word, known)
        if found is None:
            raise ValueError(_unknown(phrase, word, known or {noun: None}, place))
        request = replace(request, attributes=(*request.attributes, found))
    if not any(fits(name, request) for name in of_noun):
        there = listed(name.said for name in of_noun)
        raise ValueError(f"{phrase!r}: none in {place} is all of {', '.join(request.attributes)}; it has {there}")
    return request


def fits(name: Name, request: Request) -> bool:
    """Whether a request means what has this name."""
    return name.noun == request.category and {*request.attributes} <= {*name.words}


def _read(request: Request, word: str, known: Collection[str], phrase: str, place: str) -> Request:
    """A word before the noun; those of names come first: a tall lamp may be a kind."""
    attribute = _among(word, known)
    if attribute is not None:
        return replace(request, attributes=(*request.attributes, attribute))
    if word in COLORS:
        if request.color is not None:
            raise ValueError(f"{phrase!r}: strokes have one colour, got a second one, {word}")
        return replace(request, color=COLORS[word])
    if word in SIZES:
        return replace(request, ignored=(*request.ignored, word))
    if word not in GENERAL and word not in IDLE:
        raise ValueError(_unknown(phrase, word, [*known, *COLORS, *STRETCHES, *NUMBERS, *SIZES], place))
    return request


def _behind(words: list[str]) -> list[str]:
    """Reads the words behind the noun: "with a low back without arms" gives "low", "back" and "without arms"."""
    behind, prefix = [], ""
    for word in words:
        if word in ("with", "without"):
            prefix = "without " if word == "without" else ""
        elif word not in FILLERS:
            behind.append(prefix + word)
    return behind


def _among(said: str, known: Collection[str]) -> str | None:
    """The same word, or its singular or plural."""
    if said in known:
        return said
    return next((word for word in known if word in singulars(said) or said in singulars(word)), None)


def _unknown(phrase: str, said: str, known: Iterable[str], place: str) -> str:
    words = list(known)
    near = difflib.get_close_matches(said, words, SUGGESTIONS, cutoff=0.5)
    hint = f"the nearest there: {', '.join(near)}" if near else f"it has {listed(words)}"
    return f"{phrase!r}: nothing in {place} is named {said!r}; {hint}"


def listed(words: Iterable[str]) -> str:
    """The first dozen in the order of the alphabet, and how many more."""
    there = sorted({*words})
    return ", ".join([*there[:LISTED], *([f"{len(there) - LISTED} more"] if len(there) > LISTED else [])])
