"""What to say instead of a phrase that is not understood."""

import re

from diff3ds.library.scene import Scene, parse_scene
from diff3ds.library.vocabulary import words_of

# Longer phrases are not tried in other wordings, which are as many as the square of their words.
MOST_WORDS = 14
# What is left out is rather a whole "and a scarf" than words out of it.
_JOINERS = (["and"], ["with"])
# An article before what is none of its nouns, left where words were left out.
_DANGLING = re.compile(
    r"\b(a|an|the) (a|an|the|and|with|in|on|of|at|to|\w+ing a|two)\b|\b(a|an|the|and|with|in|on|of)$"
)
# What one of the library's things is most like, before what is: nouns that children and teachers say.
_LIKE = {
    word: thing
    for thing, words in {
        "apple": "banana cherry lemon orange peach pear plum strawberry tomato",
        "ball": "balls bubble circle earth globe marble moon planet sphere world",
        "bicycle": "motorbike motorcycle scooter skateboard tricycle trike",
        "bird": "chick chicken crow hen magpie owl pigeon rooster turkey",
        "bottle": "can cylinder flask jar tube vase",
        "bookshelf": "cabinet cupboard fridge shelf shelves wardrobe",
        "bus": "ambulance caravan coach minibus van",
        "butterfly": "bee dragonfly fly ladybird ladybug moth wasp",
        "candle": "crayon match pen pencil stick torch",
        "car": "cab jeep taxi",
        "castle": "fort fortress palace tower",
        "cat": "cheetah fox leopard lion panther tiger",
        "cow": "bull buffalo calf goat hippo lamb ox pig piglet rhino sheep yak",
        "dinosaur": "brontosaurus diplodocus giraffe",
        "dog": "hyena wolf",
        "dragon": "alligator crocodile dinosaur lizard monster",
        "fish": "dolphin goldfish seahorse shark whale",
        "flower": "bush plant",
        "guitar": "banjo cello ukulele violin",
        "hammer": "axe mallet",
        "horse": "antelope camel deer donkey llama moose reindeer zebra",
        "house": "building cabin cottage garage hotel hut museum school shed shop stable",
        "lamp": "lantern",
        "present": "block book box cube parcel",
        "rabbit": "guinea hamster hedgehog mouse rat squirrel",
        "rocket": "spaceship ufo",
        "ship": "ferry submarine warship",
        "snail": "slug worm",
        "sofa": "bench",
        "spider": "ant beetle bug crab insect octopus scorpion",
        "sword": "dagger knife spear",
        "teapot": "jug kettle",
        "teddy bear": "bear koala monkey panda",
        "tent": "cone mountain pyramid triangle volcano wigwam",
        "train": "engine locomotive tram",
        "truck": "digger lorry",
        "turtle": "frog toad",
        "wine glass": "glass",
    }.items()
    for word in words.split()
}


def understood_scene(phrase: str) -> Scene:
    """The scene of a phrase; of one that is not understood, what to say instead.

    Raises:
        ValueError: as `parse_scene`, with the wording that works, if there is one.
    """
    try:
        return parse_scene(phrase)
    except ValueError as error:
        instead = wording_that_works(phrase)
        raise ValueError(f"{error}. Say instead: {instead}" if instead else str(error)) from None


def wording_that_works(phrase: str) -> str:
    """The wording that is understood and nearest to a phrase that is not, or nothing.

    Bare plurals get a number, things that the library does not have become what is most like them, and of the rest as
    few words are left out as can be.
    """
    words = words_of(phrase)
    if len(words) > MOST_WORDS:
        return ""
    like = [_alike(word) for word in words]
    changed = [[*words[:place], "two", *words[place:]] for place in range(len(words))]
    changed += [
        [*words[:place], "with", *words[place + 1 :]] for place, word in enumerate(words) if word in ("in", "on")
    ]
    fewer = [
        kept[:first] + kept[first + count :]
        for count in range(len(words))
        for kept in dict.fromkeys((tuple(words), tuple(like)))
        for first in sorted(range(len(words) - count + 1), key=lambda n: (words[n : n + 1] not in _JOINERS, -n))
    ]
    for tried in (*changed, *fewer):
        said = _with_articles(" ".join(tried))
        if _DANGLING.search(said):
            continue
        try:
            scene = parse_scene(said)
        except ValueError:
            continue
        if not any(thing.request.corrected for thing in scene.things):
            return said
    return ""


def _alike(word: str) -> str:
    """What of the library a word is most like, plural as it is, or the word."""
    if word in _LIKE:
        return _LIKE[word]
    one = word.removesuffix("s")
    return f"{_LIKE[one]}s" if one in _LIKE else word


def _with_articles(said: str) -> str:
    """With the article that its next word asks for."""
    said = re.sub(r"\ban (?=[^aeiou])", "a ", said)
    return re.sub(r"\ba (?=[aeiou](?!ni))", "an ", said)
