"""The grammar of phrases."""

import re

import pytest
from sweep import sweep

from diff3ds.library.categories import CATEGORIES
from diff3ds.library.phrase import Request, parse
from diff3ds.library.vocabulary import COLORS, STRETCHES


@sweep("name", CATEGORIES)
def test_every_caption_of_the_library_is_understood(name):
    category = CATEGORIES[name]
    for attributes in category.combinations():
        for caption in category.captions(attributes):
            found = parse(caption)
            assert (found.category, found.attributes) == (name, attributes), caption
            assert found.count == 1


@sweep("name", [name for name, category in CATEGORIES.items() if category.parts])
def test_parts_go_with_every_caption_and_change_nothing(name):
    category = CATEGORIES[name]
    for attributes in category.combinations():
        caption = category.captions(attributes)[0]
        for part in category.parts:
            assert parse(f"{caption} with {part}") == parse(caption)
    with pytest.raises(ValueError, match=f"every {name} of the library has"):
        parse(f"{category.captions()[0]} without {category.parts[0]}")


@sweep(
    ("phrase", "expected"),
    [
        ("chair", Request("chair")),
        ("A Chair.", Request("chair")),
        ("a sketch of a chair", Request("chair")),
        ("a line drawing of an armchair", Request("chair", ("armrests",))),
        ("a tall red lamp", Request("lamp", color=COLORS["red"], stretch=STRETCHES["tall"])),
        ("two mugs", Request("mug", count=2)),
        ("three blue wine glasses", Request("wine glass", count=3, color=COLORS["blue"])),
        ("a chair with a high back and armrests", Request("chair", ("armrests", "high back"))),
        ("a rocking chair with arms", Request("chair", ("armrests", "rocking"))),
        ("a high backed chair", Request("chair", ("high back",))),
        ("four buses", Request("bus", count=4)),
        ("a small house with chimney", Request("house", ("chimney",), ignored=("small",))),
        ("2 mugs", Request("mug", count=2)),
        ("a couple of mugs", Request("mug", count=2)),
        ("two pairs of chairs", Request("chair", count=4)),
        ("two pairs of glasses", Request("glasses", count=2)),
        ("three snowmen", Request("snowman", count=3)),
        ("three cacti", Request("cactus", count=3)),
        ("glasses", Request("glasses")),
        ("a chair in red", Request("chair", color=COLORS["red"])),
        ("two mugs in blue with steam", Request("mug", ("steam",), 2, COLORS["blue"])),
        ("a tall and narrow lamp", Request("lamp", stretch=(1.0, 0.7, 1.35))),
        ("a chair with armrest", Request("chair", ("armrests",))),
        ("a chair with no back", Request("chair", ("stool",))),
        ("a chair with a back", Request("chair")),
        ("a rocking chair without armrests", Request("chair", ("rocking",))),
        ("a high-back chair", Request("chair", ("high back",))),
        ("a candle with a flame", Request("candle")),
        ("a tree with leaves", Request("tree")),
        ("a car with four wheels", Request("car")),
        ("a sail boat", Request("sailing boat")),
        ("a sailing ship with a mast and a flag", Request("sailing boat", ("flag",))),
        ("a wine bottle", Request("bottle")),
        ("a coffee cup", Request("mug")),
        ("a dining table", Request("table")),
        ("a long, tall car", Request("car", stretch=(1.35, 1.0, 1.35))),
        ("a pair of scissors", Request("scissors")),
        ("a pair of chairs", Request("chair", count=2)),
        ("the two chairs", Request("chair", count=2)),
        ("a wide, low table", Request("table", stretch=(1.0, 1.35, 0.7))),
    ],
)
def test_phrases(phrase, expected):
    assert parse(phrase) == expected


def test_an_attribute_comes_before_a_proportion():
    """A tall mug is a kind of mug here."""
    found = parse("a tall mug")
    assert found.attributes == ("tall",)
    assert found.stretch == (1.0, 1.0, 1.0)


@sweep(
    ("phrase", "word"),
    [
        ("a кот chair", "кот"),
        ("a 椅子 chair", "椅子"),
        ("a chair 🐱", "🐱"),
        ("a 🐱 chair", "🐱"),
        ("a chair with 🛞", "with 🛞"),
        ("a ♥️ chair", "♥"),
        ("a chair 👩‍🚀", "🚀"),
        ("a café chair", "café"),
        ("a कुर्सी chair", "कुर्सी"),
        ("a = chair", "="),
        # A character that Unicode has not assigned, as a new emoji is to an old Python.
        ("a chair \U0003fffd", "\U0003fffd"),
    ],
)
def test_no_word_of_any_script_is_dropped(phrase, word):
    with pytest.raises(ValueError, match=re.escape(f"does not know {word!r}")):
        parse(phrase)


@sweep("name", CATEGORIES)
def test_no_place_of_a_phrase_swallows_a_word(name):
    category = CATEGORIES[name]
    for attribute in category.attributes:
        caption = category.captions((attribute.name,))[0].split()
        for place in range(len(caption) + 1):
            with pytest.raises(ValueError, match="zyx"):
                parse(" ".join([*caption[:place], "zyx", *caption[place:]]))


def test_forms_of_letters_and_punctuation_do_not_matter():
    assert parse("«Ａ  ｃｈａｉｒ»\u200b — with ‘armrests’…") == Request("chair", ("armrests",))


@pytest.mark.parametrize("word", ["old", "new", "nice", "simple"])
def test_what_cannot_be_drawn_is_told(word):
    assert parse(f"a {word} car") == Request("car", ignored=(word,))


@pytest.mark.parametrize(
    ("phrase", "expected"),
    [
        ("a cat sleeping", Request("cat", ignored=("sleeping",))),
        ("a chair that is comfortable", Request("chair", ignored=("comfortable",))),
        ("two rocking chairs which are very old", Request("chair", ("rocking",), 2, ignored=("very", "old"))),
        ("a cat standing with a collar", Request("cat", ("collar",), ignored=("standing",))),
    ],
)
def test_what_cannot_be_drawn_is_told_behind_the_noun_too(phrase, expected):
    assert parse(phrase) == expected


@pytest.mark.parametrize("phrase", ["a tall short lamp", "a tall tall lamp", "a thin wide lamp", "a tall high mug"])
def test_proportions_are_said_once_along_an_axis(phrase):
    """A tall mug is a kind, but tall all the same."""
    first, second = phrase.split()[1:3]
    with pytest.raises(ValueError, match=f"'{first}' and '{second}' are along one axis: say one of them, once"):
        parse(phrase)


@sweep(
    ("phrase", "message"),
    [
        ("", "the phrase is empty"),
        (" ... ", "the phrase is empty"),
        ("椅子", "does not know '椅子'; it draws airplane"),
        ("two tall red", "names nothing"),
        ("with armrests", "names nothing"),
        ("a chair with", "nothing follows 'with'"),
        ("a chair with armrests and", "nothing follows 'and'"),
        ("a chxir", r"does not know 'chxir'; the nearest that it knows: .*chair.* mvdream; for pictures zero123"),
        ("a zeppelin", "does not know 'zeppelin'"),
        ("a sparkling chair", "does not know 'sparkling'"),
        ("a chair with wings", "does not know 'with wings'"),
        ("a chair with armrests and wings", "does not know 'with wings'"),
        ("a red blue chair", "a second one, blue"),
        ("two three chairs", "one number of things, got a second one, three"),
        ("one two chairs", "got a second one, two"),
        ("a pair of two chairs", "got a second one, two"),
        ("a stool with armrests", "no chair is all of this at once"),
        ("two couple of chairs", "got a second one, couple"),
        ("a pair of pairs of chairs", "got a second one, pairs"),
        ("7 chairs", "it draws one to six things, got 7"),
        ("0 chairs", "it draws one to six things, got 0"),
        ("four pairs of chairs", "8 things are too many"),
        ("chairs", "say how many: two chairs, or one"),
        (
            "numerous chairs",
            "does not know 'numerous'; what it knows of a chair: with armrests, .*: black.*to six",
        ),
        (
            "a spotted car",
            "does not know 'spotted'; what it knows of a car: with an open top, .*with wheels, .*: black",
        ),
        ("a car with feathers", "does not know 'with feathers'; what it knows of a car: with an open top"),
        ("a chair that is sparkling", "does not know 'sparkling'; what it knows of a chair"),
        ("a rackimg chair", "does not know 'rackimg'; the nearest that it knows: rocking"),
        ("a mug with a sauser", "does not know 'with a sauser'; the nearest that it knows: with a saucer"),
        ("a mug, tall", "put 'tall' before 'mug'"),
        ("a mug that is red", "put 'red' before 'mug'"),
        ("a clock, square", "put 'square' before 'clock'"),
        ("a chair with red armrests", "put 'red' before 'chair': it is of the whole thing"),
        ("a chair with armrests in red", "put 'red' before 'chair'"),
        ("a chair with armrests and rocking", "put 'rocking' before 'chair'"),
        ("a chair table", "one kind of thing at a time, and 'chair' and 'table' are two"),
        ("a chair and two tables", "'chair' and 'tables' are two"),
        ("a chair on a table", "'chair' and 'table' are two"),
        ("a house with a tree", "'tree' and 'house' are two"),
        ("an armchair without armrests", "contradicts itself: armrests"),
        ("an unlit candle with a flame", "contradicts itself: unlit"),
        ("a stool with a back", "contradicts itself: stool"),
    ],
)
def test_what_is_not_understood_is_said(phrase, message):
    with pytest.raises(ValueError, match=message):
        parse(phrase)
