"""Words that phrases of any library share, of numbers, colours, sizes and places, and how a phrase becomes words."""

import itertools
import re
import unicodedata
from collections.abc import Collection, Iterable, Sequence

NUMBERS = ("one", "two", "three", "four", "five", "six")
COUNTS = {word: count for count, name in enumerate(NUMBERS, 1) for word in (name, str(count))} | {
    "couple": 2,
    "some": 3,
    "several": 3,
    "few": 3,
    "many": 5,
}
PAIR = ("pair", "pairs")
# Straight RGB of plain inks on white.
COLORS = {
    "black": (0.0, 0.0, 0.0),
    "gray": (0.5, 0.5, 0.5),
    "grey": (0.5, 0.5, 0.5),
    "red": (0.8, 0.1, 0.1),
    "orange": (0.9, 0.5, 0.1),
    "yellow": (0.8, 0.7, 0.0),
    "green": (0.1, 0.6, 0.2),
    "blue": (0.1, 0.3, 0.8),
    "purple": (0.5, 0.2, 0.6),
    "pink": (0.9, 0.4, 0.6),
    "brown": (0.5, 0.3, 0.1),
}
# Factors along x (front to back), y (left to right) and z (up), beyond what members vary by themselves. Empirical.
STRETCHES = {
    "tall": (1.0, 1.0, 1.35),
    "high": (1.0, 1.0, 1.35),
    "low": (1.0, 1.0, 0.7),
    "short": (1.0, 1.0, 0.7),
    "wide": (1.0, 1.35, 1.0),
    "broad": (1.0, 1.35, 1.0),
    "narrow": (1.0, 0.7, 1.0),
    "thin": (0.7, 0.7, 1.0),
    "long": (1.35, 1.0, 1.0),
}
# Understood, but without effect, which is said: every sketch fills the unit ball.
SIZES = ("big", "large", "huge", "small", "little", "tiny")
# Words of material, age, mood and use, which no line shows: understood, but without effect, which is said.
UNSEEN = frozenset(
    re.findall(
        r"\w+",
        """
        wooden wood metal iron steel stone brick plastic glass leather paper cardboard ceramic porcelain marble
        velvet woollen golden gold silver copper bronze old new ancient modern antique vintage classic rustic rusty
        broken cracked dirty dusty clean shiny polished cute pretty beautiful nice lovely happy sad funny scary
        spooky cozy cosy magic magical enchanted fancy elegant comfortable ugly friendly lonely sweet haunted royal
        empty warm cold cool fresh soft hard heavy fast slow strong sharp blunt wild garden kitchen office school
        classroom farm city village country street toy baby birthday medieval colorful colourful bright dark fluffy
        cheap expensive simple plain ordinary normal regular typical favorite favourite parked sleeping burning
        steaming hot frozen snowy sunny pirate princess fairy wizard giant rainbow really very so super extra quite
        angry brave dancing evil flying hungry jumping playing running sitting smiling standing swimming walking
        asleep awake crying curly dreaming falling fat hands holding hovering laughing naughty shy singing
        sleepy talking thirsty tired waving yawning
        """,
    )
)
# Words between the others: the two chairs are two.
IDLE = ("a", "an", "the", "of", "and", "my", "your", "our", "his", "her", "their", "this", "that", "these", "those")
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
    r"living room|[\w?]+",
    """
    air bathroom beach bedroom ceiling city classroom cliff clouds? corner countryside day desert distance evening farm
    fence field floor forest garage garden grass ground hills? hospital island jungle kitchen lake lawn living room
    market meadow middle moon morning mountains? museum night ocean park path playground pond rain river road rock
    room school sea shelf shop sky snow space station storm street sun sunset sunshine town village wall water window
    wind woods world yard zoo
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
    "against": "against",
    "leaning against": "against",
    "leaning on": "against",
    "next to": "beside",
    "close to": "beside",
    "at": "at",
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
    "holding hands with": "beside",
    "looking at": "beside",
    "watching": "beside",
    "hugging": "beside",
    "climbing up": "beside",
    "climbing": "beside",
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
    "jumping over": "above",
    "riding on": "on",
    "riding": "on",
}
OPENING = re.compile(r"^(an? )?(simple )?(line )?(3d )?(sketch|drawing|picture|line art|wireframe) of ")
WITH_NO = re.compile(r"\bwith no\b")
# "a cat that has a hat", "a boy wearing a hat": what one has is with one. "A boy playing" has nothing.
_DETERMINERS = "|".join(["a", "an", "the", "no", "my", "your", "our", "his", "her", "its", "their", *COUNTS])
HAVING = re.compile(
    rf"\b(?:(?:that|which|who) )?(?:has|have|having|holds|holding|wears|wearing|carrying) "
    rf"(?:on |up )?(?=(?:{_DETERMINERS}) )"
)
# Of emoji and other characters, to be drawn in colour or not.
_VARIANTS = re.compile("[\ufe00-\ufe0f]")


def words_of(text: str) -> list[str]:
    """Lower case words of any script, without punctuation; hyphens part words; runs of symbols are words too."""
    composed = _VARIANTS.sub("", unicodedata.normalize("NFKC", text).casefold())
    return ["".join(run) for kind, run in itertools.groupby(composed, _kind) if kind != "gap"]


def _kind(character: str) -> str:
    """Letters with their marks and digits make words; emoji and characters of no known kind are symbols."""
    category = unicodedata.category(character)
    if category[0] in "PZ" or category in ("Cc", "Cf"):
        return "gap"
    return "word" if category[0] in "LMN" else "symbol"


def parted(phrase: str) -> tuple[list[str], list[str]]:
    """Words of a phrase up to its noun, and those from "with" or "without" on.

    "a sketch of" is left out, "in red" is "red" before the noun, and "with no" is "without".
    """
    return split_behind(
        WITH_NO.sub("without", HAVING.sub("with ", OPENING.sub("", " ".join(words_of(phrase))))).split()
    )


def split_behind(words: list[str]) -> tuple[list[str], list[str]]:
    """Words up to the noun, with the colour first that "in" has behind it, and those from "with" or "without" on."""
    split = next((i for i, word in enumerate(words) if word in ("with", "without")), len(words))
    front, behind = words[:split], words[split:]
    if len(front) > 2 and front[-2] == "in" and front[-1] in COLORS:
        front = [front[-1], *front[:-2]]
    return front, behind


def number(phrase: str, said: Sequence[str], pair_is_one: bool) -> int:
    """How many things a phrase means.

    Args:
        said: its words of number: "two", "pair", "two pairs", or none, which is one.
        pair_is_one: as of scissors.

    Raises:
        ValueError: two numbers, or more than six things.
    """
    counts, pairs = said[:1] if said and said[0] in COUNTS else (), [word for word in said if word in PAIR]
    second = [word for word in said if word not in (*counts, *pairs[:1])] or said[len(counts) + 1 :]
    if second:
        raise ValueError(f"{phrase!r}: there is one number of things, got a second one, {second[0]}")
    count = COUNTS[counts[0]] if counts else 1
    count *= 2 if pairs and not pair_is_one else 1
    if count > len(NUMBERS):
        raise ValueError(f"{phrase!r}: {count} things are too many: {NUMBERS[0]} to {NUMBERS[-1]} can be drawn")
    return count


def stretched(phrase: str, said: Iterable[str], kinds: Collection[str] = ()) -> tuple[float, float, float]:
    """Factors along x, y and z of all proportions that a phrase says.

    Args:
        kinds: proportions that are attributes here, as in "a tall mug", and stretch nothing.

    Raises:
        ValueError: two are along one axis.
    """
    factors = [1.0, 1.0, 1.0]
    along: dict[int, str] = {}
    for word in said:
        for axis in (axis for axis in range(3) if STRETCHES[word][axis] != 1):
            if axis in along:
                raise ValueError(f"{phrase!r}: {along[axis]!r} and {word!r} are along one axis: say one of them, once")
            along[axis] = word
            factors[axis] = 1.0 if word in kinds else STRETCHES[word][axis]
    return factors[0], factors[1], factors[2]


_SINGULAR = (
    ("s", ""),
    ("es", ""),
    ("ies", "y"),
    ("ves", "f"),
    ("men", "man"),
    ("i", "us"),
    ("people", "person"),
    ("children", "child"),
)


def singulars(noun: str) -> Iterable[str]:
    """What a plural may come from: mugs, buses, berries, shelves, snowmen, cacti, cups of tea."""
    head, of, rest = noun.partition(" of ")
    if of:
        yield from (f"{singular} of {rest}" for singular in singulars(head))
    for ending, instead in _SINGULAR:
        if noun.endswith(ending):
            yield noun.removesuffix(ending) + instead
