"""What a category of things is: its names, its attributes, how members of it are drawn and what they are called."""

import itertools
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Literal

from diff3ds.library.shapes import Part

# From a source of proportions, `vary(low, high)`, and the names of the member's attributes to its strokes, of any size
# and anywhere; x points to the front, z up.
Vary = Callable[[float, float], float]
Make = Callable[[Vary, Collection[str]], Sequence[Part]]


@dataclass(frozen=True)
class Attribute:
    """Something that members of a category may have, and that one sees.

    Attributes:
        name: of the attribute.
        phrases: how one says it, the usual way first: behind the noun if it starts with "with" or "without", else
            before it.
        nouns: words for a member with this attribute ("armchair").
        excludes: attributes of the category that no member has together with this one.
    """

    name: str
    phrases: tuple[str, ...]
    nouns: tuple[str, ...] = ()
    excludes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Category:
    """A kind of thing that can be drawn.

    Attributes:
        name: its usual noun.
        make: draws a member.
        synonyms: other nouns for all of its members.
        attributes: what a member may have.
        parts: what all members have and one may name: "handle", of a mug. Captions do not.
        mirror: the coordinate whose sign can be changed without changing any member: "y" if left and right are alike,
            "x" for front and back, None if neither.
        pair: the noun is a plural: "a pair of scissors".
        metres: how large it usually is: the longest side of its bounding box.
        carries: at which fraction of its height things stand on it.
        head: where a hat sits on it: at which fraction of its length, from its back on, and of its height, and how wide
            its head is there, as a fraction of its height; None if it has no head.
        worn: how many heads wide it is on a head; None if it is not worn there.
        aloft: it is in the air.
        leans: it cannot stand by itself.
        faces: the kind of thing that its front is turned to.
    """

    name: str
    make: Make
    synonyms: tuple[str, ...] = ()
    attributes: tuple[Attribute, ...] = ()
    parts: tuple[str, ...] = ()
    mirror: Literal["x", "y"] | None = "y"
    pair: bool = False
    metres: float = 1.0
    carries: float = 1.0
    head: tuple[float, float, float] | None = None
    worn: float | None = None
    aloft: bool = False
    leans: bool = False
    faces: str | None = None

    def captions(self, attributes: Collection[str] = ()) -> tuple[str, ...]:
        """All ways to call a member with these attributes; the first has the category's name and usual phrases."""
        chosen = [a for a in self.attributes if a.name in attributes]
        heads = [(noun, chosen) for noun in (self.name, *self.synonyms)]
        heads += [(noun, [a for a in chosen if a is not b]) for b in chosen for noun in b.nouns]
        return tuple(
            self._caption(noun, phrases)
            for noun, said in heads
            for phrases in itertools.product(*(attribute.phrases for attribute in said))
        )

    def combinations(self) -> tuple[tuple[str, ...], ...]:
        """All sets of attributes that a member may have, from none to as many as go together."""
        names = [a.name for a in self.attributes]
        apart = {frozenset((a.name, other)) for a in self.attributes for other in a.excludes}
        return tuple(
            chosen
            for count in range(len(names) + 1)
            for chosen in itertools.combinations(names, count)
            if not any(frozenset(two) in apart for two in itertools.combinations(chosen, 2))
        )

    def _caption(self, noun: str, phrases: tuple[str, ...]) -> str:
        # "with a saucer and steam", "with a holder and without a flame"
        behind = [phrase for phrase in phrases if phrase.startswith("with ")]
        behind = [*behind[:1], *(phrase.removeprefix("with ") for phrase in behind[1:])]
        behind += [phrase for phrase in phrases if phrase.startswith("without ")]
        words = " ".join([*(phrase for phrase in phrases if phrase.split()[0] not in ("with", "without")), noun])
        article = "a pair of" if self.pair else "an" if words[0] in "aeiou" and words[:3] != "uni" else "a"
        return " ".join([article, words, " and ".join(behind)]).strip()
