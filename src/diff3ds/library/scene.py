"""Phrases of several things and where they stand: "a table with a lamp on it and two chairs".

    THING [relation THING] [with THING [relation it]] [and THING [relation THING]] ...

A thing is a phrase of the library (`phrase.py`); a relation one of `RELATIONS` or `ACTIONS`.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from diff3ds.library.categories import CATEGORIES
from diff3ds.library.phrase import Request, parse
from diff3ds.library.vocabulary import COUNTS, OPENING, singulars, words_of

# Where a thing is said to be without a target: at what was named before.
UNAIMED = {
    "on top": "on",
    "on the left": "left of",
    "to the left": "left of",
    "on the right": "right of",
    "to the right": "right of",
    "in front": "in front of",
    "in the back": "behind",
}
# Where a scene plays: no lines are drawn of these, which is said.
PLACES = re.findall(
    r"living room|\w+",
    """
    air bathroom beach bedroom city classroom cliff countryside day desert distance evening farm field forest garden
    grass ground hill island jungle kitchen lake lawn living room meadow middle moon morning mountain mountains night
    ocean park pond rain river road rock room school sea sky snow space storm street sun town village water wind woods
    world yard zoo
    """,
)
# On these small things stand where they are said to be there "with" it.
CARRIERS = ("table", "bookshelf")
# How one says where a thing stands, and what it is called here.
RELATIONS = {
    "on top of": "on",
    "on": "on",
    "upon": "on",
    "underneath": "under",
    "beneath": "under",
    "below": "under",
    "under": "under",
    "in front of": "in front of",
    "behind": "behind",
    "to the left of": "left of",
    "on the left of": "left of",
    "left of": "left of",
    "to the right of": "right of",
    "on the right of": "right of",
    "right of": "right of",
    "above": "above",
    "over": "above",
    "against": "beside",
    "next to": "beside",
    "beside": "beside",
    "near": "beside",
    "by": "beside",
    "between": "between",
    "around": "around",
    "inside": "in",
}
# What one does to another says where it stands too.
ACTIONS = {
    "fighting with": "beside",
    "fighting": "beside",
    "playing with": "beside",
    "talking to": "beside",
    "for": "beside",
    "chasing": "behind",
    "following": "behind",
    "kicking": "behind",
    "pushing": "behind",
    "eating": "behind",
    "guarding": "in front of",
    "pulling": "in front of",
    "hanging from": "under",
    "riding on": "on",
    "riding": "on",
}
PRONOUNS = ("it", "them")
MOST_THINGS = 12
_PLACED = RELATIONS | ACTIONS
_RELATION = re.compile(rf"^({'|'.join(sorted(_PLACED, key=len, reverse=True))})\b ?")
# "in a bowl", but "in red" is a colour.
_INSIDE = re.compile(r"\b(in|into) (?=(a|an|the|my|your|our|his|her|their)\b)")
# What is written or heard.
_SAYING = re.compile(r" (that |which )?(says|saying|shows|showing|reads|reading|called|named) .*$")
_VERBS = "|".join(
    [
        "dancing",
        "driving",
        "floating",
        "flying",
        "going",
        "growing",
        "hanging",
        "hiding",
        "jumping",
        "leaning",
        "lying",
        "parked",
        "placed",
        "playing",
        "resting",
        "running",
        "sailing",
        "sitting",
        "sleeping",
        "standing",
        "swimming",
        "waiting",
        "walking",
    ]
)
_STANDING = re.compile(rf"\b(that |which )?((is|are) )?({_VERBS}) (?=on|in|by|under|be|ne|a|o|to|th|up)")
_PLACE = "|".join(PLACES)
# Not where it belongs to a noun: "on a kitchen table".
_JOINERS = "|".join(["and", "with", *_PLACED])
_AT_PLACE = re.compile(
    rf"\b(in|on|at|to|into|through|across|by|under) (the |a |an |my )?({_PLACE})(?=$| ({_JOINERS})\b| (in|at|to) )"
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
        return Scene((_thing(phrase, parse(phrase)),))
    except ValueError as error:
        text = OPENING.sub("", " ".join(words_of(phrase.replace(",", " and ")))).replace("and and", "and")
        text, unseen = _without_places(_STANDING.sub("", text))
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
            try:
                return parse(" ".join(self.rest[first:end])), end - first
            except ValueError:
                continue
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
            for thing in listed or [latest]:
                if thing == latest or (thing not in targets and self._may_stand(thing, targets[0])):
                    self.relations.append(Relation(thing, relation, targets))
            listed = []
            latest = targets[-1]
        related = {relation.thing for relation in self.relations}
        named = {target for relation in self.relations for target in relation.targets}
        others = [number for number in range(1, len(self.things)) if number not in related | named]
        rest = [Relation(n, "on", (carried[n],)) if n in carried else Relation(n, "beside", (0,)) for n in others]
        return Scene(tuple(self.things), tuple(self._in_order([*self.relations, *rest])))

    def _is_carried(self, thing: int, anchor: int) -> bool:
        """Whether a thing is small enough to stand on another that things stand on."""
        small, large = (CATEGORIES[self.things[number].request.category] for number in (thing, anchor))
        return large.name in CARRIERS and small.metres < large.metres / 2

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
        sizes = [CATEGORIES[self.things[number].request.category].metres for number in (thing, target)]
        return sizes[0] < sizes[1]

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
