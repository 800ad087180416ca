"""The grammar of phrases."""

import re

import pytest

from diff3ds.library.categories import CATEGORIES
from diff3ds.library.phrase import Request, parse
from diff3ds.library.vocabulary import COLORS, STRETCHES


@pytest.mark.parametrize("name", CATEGORIES)
def test_every_caption_of_the_library_is_understood(name):
    category = CATEGORIES[name]
    for attributes in category.combinations():
        for caption in category.captions(attributes):
            found = parse(caption)
            assert (found.category, found.attributes) == (name, attributes), caption
            assert found.count == 1


@pytest.mark.parametrize(
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


@pytest.mark.parametrize(
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


def test_forms_of_letters_and_punctuation_do_not_matter():
    assert parse("«Ａ  ｃｈａｉｒ»\u200b — with ‘armrests’…") == Request("chair", ("armrests",))


@pytest.mark.parametrize("word", ["old", "new", "nice", "simple"])
def test_what_cannot_be_drawn_is_not_swallowed(word):
    with pytest.raises(ValueError, match=f"does not know '{word}'"):
        parse(f"a {word} car")


@pytest.mark.parametrize("phrase", ["a tall short lamp", "a tall tall lamp", "a thin wide lamp", "a tall high mug"])
def test_proportions_are_said_once_along_an_axis(phrase):
    """A tall mug is a kind, but tall all the same."""
    first, second = phrase.split()[1:3]
    with pytest.raises(ValueError, match=f"'{first}' and '{second}' are along one axis: say one of them, once"):
        parse(phrase)


@pytest.mark.parametrize(
    ("phrase", "message"),
    [
        ("", "the phrase is empty"),
        (" ... ", "the phrase is empty"),
        ("椅子", "does not know '椅子'; it draws airplane"),
        ("a chair with", "nothing follows 'with'"),
        ("a chair with armrests and", "nothing follows 'and'"),
        ("a chiar", r"does not know 'chiar'; the nearest that it knows: .*chair.* MVDream"),
        ("a dragon", "does not know 'dragon'"),
        ("a sparkling chair", "does not know 'sparkling'"),
        ("a chair with wings", "does not know 'with wings'"),
        ("a chair with armrests and wings", "does not know 'with wings'"),
        ("a red blue chair", "a second one, blue"),
        ("two three chairs", "one number of things, got a second one, three"),
        ("one two chairs", "got a second one, two"),
        ("a pair of two chairs", "got a second one, two"),
        ("a stool with armrests", "no chair is all of this at once"),
        ("a chair table", "does not know 'chair'"),
        ("with armrests", "does not know"),
    ],
)
def test_what_is_not_understood_is_said(phrase, message):
    with pytest.raises(ValueError, match=message):
        parse(phrase)
