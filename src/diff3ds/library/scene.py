"""Phrases of several things and where they stand: "a table with a lamp on it and two chairs".

    THING [relation THING] [with THING [relation it]] [and THING [relation THING]] ...

A thing is a phrase of the library (`phrase.py`); a relation one of `RELATIONS` or `ACTIONS`.
"""

import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from diff3ds.library.categories import CATEGORIES
from diff3ds.library.category import Category
from diff3ds.library.phrase import Request, parse
from diff3ds.library.vocabulary import (
    ACTIONS,
    CARRIERS,
    COUNTS,
    HAVING,
    OPENING,
    PLACES,
    RELATIONS,
    UNAIMED,
    singulars,
    words_of,
)

PRONOUNS = ("it", "them")
MOST_THINGS = 12
_PLACED = RELATIONS | ACTIONS
_RELATION = re.compile(rf"^({'|'.join(sorted(_PLACED, key=len, reverse=True))})\b ?")
# "in a bowl", but "in red" is a colour.
_INSIDE = re.compile(r"\b(in|into) (?=(a|an|the|my|your|our|his|her|their)\b)")
_WITHIN = re.compile(r"\b(in|inside) (?=(a|an|the|his|her|its) )")
# What is written or heard.
_SAYING = re.compile(r" (that |which )?(says|saying|shows|showing|reads|reading|called|named) .*$")
_VERBS = "|".join(
    re.findall(
        r"\w+",
        """
        asleep crawling dancing driving falling floating flying going growing hanging hiding hovering jumping
        lying parked perched placed playing resting running sailing sitting sleeping standing swimming
        waiting walking working
        """,
    )
)
_STANDING = re.compile(rf"\b(that |which )?((is|are) )?({_VERBS}) (?=on|in|by|under|be|ne|a|o|to|th|up|cl)")
_LEFT_STANDING = re.compile(rf" ({_VERBS}|leaning)$")
_PLACE = "|".join(PLACES)
# Not where it belongs to a noun: "on a kitchen table".
_JOINERS = "|".join(["and", "with", *_PLACED])
_AT_PLACE = re.compile(
    r"\b(in|on|at|to|into|through|across|by|under|near|over|above|behind|against|along|down|up|from) "
    rf"(the |a |an |my |our |his |her )?(\w+ )??({_PLACE})(?=$| ({_JOINERS})\b| (in|at|to) )"
)
_IN_ROOM = re.compile(rf"^(a |an |the |my |our )?({_PLACE}) with ")
_ARTICLES = ("a", "an", "the", *COUNTS)


@dataclass(frozen=True)
class Thing:
    """One or more of a kind, alike.

    Attributes:
        request: what each is; its count is one.
        count: how many.
        said: what they are, in words: "two red chairs".
    """

    request: Request
    count: int
    said: str

    @property
    def one(self) -> str:
        """What each is, in words: "a red chair"."""
        if self.count == 1:
            return self.said
        words = [word for word in self.said.split() if word not in COUNTS]
        for place, word in enumerate(words):
            for singular in singulars(word):
                said = " ".join((*words[:place], singular, *words[place + 1 :]))
                said = f"{'an' if said[0] in 'aeiou' else 'a'} {said}"
                try:
                    if replace(parse(said), corrected=()) == replace(self.request, corrected=()):
                        return said
                except ValueError:
                    continue
        return CATEGORIES[self.request.category].captions(self.request.attributes)[0]


@dataclass(frozen=True)
class Relation:
    """Where a thing stands.

    Attributes:
        thing: the number of the thing.
        kind: a value of `RELATIONS` or `ACTIONS`.
        targets: numbers of the things that it is said of: two for "between", else one.
    """

    thing: int
    kind: str
    targets: tuple[int, ...]


@dataclass(frozen=True)
class Scene:
    """Things, and where all but the first stand."""

    things: tuple[Thing, ...]
    relations: tuple[Relation, ...] = ()


def parse_scene(phrase: str) -> Scene:
    """What a phrase asks for, of one thing or several.

    Raises:
        ValueError: it is not understood; where it speaks of one thing, as `parse`.
    """
    try:
        return Scene((_thing(phrase, _parse_dressed(phrase)),))
    except ValueError as error:
        text = OPENING.sub("", " ".join(words_of(phrase.replace(",", " and ")))).replace("and and", "and")
        text = HAVING.sub("with ", text)
        text, unseen = _without_places(_STANDING.sub("", text))
        text = _LEFT_STANDING.sub("", text) if unseen else text
        reader = _Reader(_INSIDE.sub("inside ", text), phrase)
        if not unseen and not reader.speaks_of_several():
            raise
        alone = _why_not_one(text) if unseen else error
    scene = reader.read(alone)
    if unseen:
        first = scene.things[0]
        told = replace(first, request=replace(first.request, ignored=(*first.request.ignored, *unseen)))
        scene = replace(scene, things=(told, *scene.things[1:]))
    if sum(thing.count for thing in scene.things) > MOST_THINGS:
        raise ValueError(f"{phrase!r}: at most {MOST_THINGS} things can be drawn in a scene")
    return scene


@functools.lru_cache(maxsize=4096)
def _request(words: str) -> Request | None:
    """What words ask for, if they are one thing; as a phrase is typed, its words come again and again."""
    try:
        return parse(words)
    except ValueError:
        return None


def _parse_dressed(phrase: str) -> Request:
    """What a phrase asks for, in which "in a dress" and "in a pot" are "with" it, where that is known of the thing."""
    try:
        return parse(phrase)
    except ValueError:
        if _WITHIN.search(phrase) is None:
            raise
        dressed = parse(_WITHIN.sub("with ", phrase))
        if not dressed.attributes:
            raise
        return dressed


def _without_places(text: str) -> tuple[str, list[str]]:
    """The text without the places where it plays and without what is written there, and what was left out."""
    saying = _SAYING.search(text)
    text = _SAYING.sub("", text)
    room, places = _IN_ROOM.match(text), [found[0] for found in _AT_PLACE.finditer(text)]
    text = re.sub(r"\s+", " ", _AT_PLACE.sub("", _IN_ROOM.sub("", text))).strip()
    return text, ([room[2]] if room else []) + places + ([saying[0].strip()] if saying else [])


def _why_not_one(text: str) -> ValueError:
    """What is wrong with a text that is taken for one thing; if nothing is, no use is made of it."""
    try:
        parse(text)
    except ValueError as error:
        return error
    return ValueError(text)


def _thing(said: str, request: Request) -> Thing:
    return Thing(replace(request, count=1), request.count, said)


class _Reader:
    """Reads a scene from its front to its end."""

    def __init__(self, text: str, phrase: str) -> None:
        self.rest = text.split()
        self.phrase = phrase
        self.things: list[Thing] = []
        self.relations: list[Relation] = []
        self.latest = 0  # that was named

    def speaks_of_several(self) -> bool:
        """Whether a word joins things in it, behind the first."""
        return any(self._joins(place) for place in range(1, len(self.rest)))

    def _joins(self, place: int) -> bool:
        return self.rest[place] in ("and", "with") or bool(_RELATION.match(" ".join(self.rest[place:]) + " "))

    def _longest(self, first: int, least: int = 1) -> tuple[Request, int] | None:
        """The longest words from a place on that are a thing, and how many they are."""
        for end in range(len(self.rest), first + least - 1, -1):
            request = _request(" ".join(self.rest[first:end]))
            if request is not None:
                return request, end - first
        return None

    def read(self, alone: ValueError) -> Scene:
        """The scene.

        Args:
            alone: why the phrase is not one thing.
        """
        # Things of which nothing has been said: "a teapot and two mugs" may yet be "on a table".
        listed = [self._take_thing(alone)]
        latest = anchor = listed[0]
        # Joined by "with" to what carries them: "a table with a candle and a mug".
        carried: dict[int, int] = {}
        attached = False
        while self.rest:
            joined = self.rest[0] in ("and", "with")
            if joined:
                if self.rest.pop(0) == "with":
                    # "a mug on a table with a chair beside it"
                    listed, anchor, attached = [], self.latest, True
                latest = self._take_thing(alone)
                listed.append(latest)
                if attached and self._is_carried(latest, anchor):
                    carried[latest] = anchor
                    if self._kind(latest).worn is not None:
                        # "a king with a crown on a chair": the king is.
                        latest, listed = anchor, []
            unaimed = self._take_unaimed()
            if unaimed and joined:
                self.relations.append(Relation(latest, unaimed, (anchor,)))
                listed = []
                continue
            relation = self._take_relation()
            if relation is None and not joined:
                raise self._lost(alone)
            if relation is None:
                continue
            targets = self._take_targets(relation, anchor, alone)
            if relation == "at":
                relation = "behind" if self._kind(targets[0]).name in CARRIERS else "beside"
            for thing in listed or [latest]:
                if thing == latest or (thing not in targets and self._may_stand(thing, targets[0])):
                    self.relations.append(Relation(thing, relation, targets))
            listed = []
            latest = targets[-1]
        related = {relation.thing for relation in self.relations}
        named = {target for relation in self.relations for target in relation.targets}
        # Beside what stands on the ground by itself.
        first = next((n for n in range(len(self.things)) if n not in related | {*carried} and self._stands(n)), 0)
        others = [n for n in range(len(self.things)) if n not in related | named | {first}]
        rest = [Relation(n, "on", (carried[n],)) if n in carried else Relation(n, "beside", (first,)) for n in others]
        return Scene(tuple(self.things), tuple(self._in_order([*self.relations, *rest])))

    def _is_carried(self, thing: int, anchor: int) -> bool:
        """Whether a thing is on another that it is said to be with: small enough for a table, or worn on a head."""
        small, large = self._kind(thing), self._kind(anchor)
        worn = small.worn is not None and large.head is not None
        return worn or (large.name in CARRIERS and small.metres < large.metres / 2)

    def _kind(self, thing: int) -> Category:
        return CATEGORIES[self.things[thing].request.category]

    def _stands(self, thing: int) -> bool:
        """Whether it stands on the ground by itself."""
        return not (self._kind(thing).aloft or self._kind(thing).leans)

    def _take_unaimed(self) -> str | None:
        """A relation at the end, or before a word that joins."""
        for said, kind in UNAIMED.items():
            words = said.split()
            if self.rest[: len(words)] == words and self.rest[len(words) : len(words) + 1] in ([], ["and"], ["with"]):
                del self.rest[: len(words)]
                return kind
        return None

    def _may_stand(self, thing: int, target: int) -> bool:
        """Whether a thing that is listed before another is meant too: a sofa and a lamp on a table are not both."""
        return self._kind(thing).metres < self._kind(target).metres

    def _take_thing(self, alone: ValueError) -> int:
        """The number of the thing that comes next."""
        found = self._longest(0)
        if found is None:
            raise self._lost(alone)
        request, count = found
        self.things.append(_thing(" ".join(self.rest[:count]), request))
        del self.rest[:count]
        self.latest = len(self.things) - 1
        return self.latest

    def _take_relation(self) -> str | None:
        match = _RELATION.match(" ".join(self.rest) + " ")
        if match is None:
            return None
        del self.rest[: len(match[1].split())]
        return _PLACED[match[1]]

    def _take_targets(self, relation: str, anchor: int, alone: ValueError) -> tuple[int, ...]:
        if len(self.things) > 1 and self.rest and self.rest[0] in PRONOUNS:
            self.rest.pop(0)
            return (anchor,)
        targets = [self._take_target(alone)]
        if relation == "between" and self.things[targets[0]].count == 1:
            if self.rest[:1] != ["and"]:
                raise ValueError(f"{self.phrase!r}: between what? Say between a tree and a house, or between two trees")
            self.rest.pop(0)
            targets.append(self._take_target(alone))
        return tuple(targets)

    def _take_target(self, alone: ValueError) -> int:
        """A thing that was named before, as "the table", or a new one."""
        if self.rest[:1] == ["the"] and (found := self._longest(0)) is not None:
            request, count = found
            for number, known in enumerate(self.things):
                if known.request.category == request.category:
                    del self.rest[:count]
                    self.latest = number
                    return number
        return self._take_thing(alone)

    def _lost(self, alone: ValueError) -> ValueError:
        """What the first thing that is not understood is wrong about."""
        if not self.rest:
            return ValueError(f"{self.phrase!r}: something is missing at its end: what stands there?")
        if self.things and not self._names_a_thing():
            return alone
        end = next((place for place in range(1, len(self.rest)) if self._joins(place)), len(self.rest))
        try:
            parse(" ".join(self.rest[:end]))
        except ValueError as error:
            return error
        return alone

    def _names_a_thing(self) -> bool:
        """Whether the words that come next are about a thing rather than about what the one before them has."""
        return self.rest[0] in _ARTICLES and any(self._joins(place) for place in range(1, len(self.rest)))

    def _in_order(self, relations: Sequence[Relation]) -> list[Relation]:
        """Each after those that place its targets.

        Raises:
            ValueError: a thing has two places, or stands where it would have to stand first.
        """
        left, done = list(relations), []
        for relation in left:
            if sum(other.thing == relation.thing for other in left) > 1:
                raise ValueError(f"{self.phrase!r}: {self.things[relation.thing].said!r} has two places: say one")
        while left:
            waiting = {relation.thing for relation in left}
            ready = [relation for relation in left if not waiting & {*relation.targets}]
            if not ready:
                said = " and ".join(repr(self.things[relation.thing].said) for relation in left)
                raise ValueError(f"{self.phrase!r}: {said} would stand on or beside themselves: name two things")
            done += ready
            left = [relation for relation in left if relation not in ready]
        return done
