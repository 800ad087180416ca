"""What the names of files in a folder of sketches say, and which of them a phrase means."""

import pytest

from diff3ds.library.phrase import Request
from diff3ds.library.vocabulary import COLORS, STRETCHES
from diff3ds.tasks.exact_prior.folder_phrase import Name, asked_of, fits, named

NAMES = [
    ("chair_01", Name("chair", (), "chair")),
    ("chair12", Name("chair", (), "chair")),
    ("Rocking-Chair_2_3", Name("chair", ("rocking",), "rocking chair")),
    (
        "tall_chair_with_armrests_and_a_cushion",
        Name("chair", ("tall", "armrests", "cushion"), "tall chair with armrests and a cushion"),
    ),
    ("chair_without_arms", Name("chair", ("without arms",), "chair without arms")),
    ("a_mug", Name("mug", (), "a mug")),
    ("woman_in_red_2", Name("woman", ("red",), "woman in red")),
    ("cat_🐱", Name("cat", (), "cat")),
    # Composed or not, as file systems have it.
    ("gru\u0308ner_stuhl_1", Name("stuhl", ("grüner",), "grüner stuhl")),
]


@pytest.mark.parametrize(("said", "name"), NAMES)
def test_names_of_files(said, name):
    assert named(said) == name


@pytest.mark.parametrize("said", ["01", "_", "with_arms", "2024-11-22"])
def test_names_that_say_nothing(said):
    assert named(said) is None


def names_of(*said: str) -> list[Name]:
    return [named(one) for one in said]


THERE = names_of("chair_1", "rocking_chair", "rocking_chair_with_armrest", "chair_without_back", "red_lamp", "shelf")


@pytest.mark.parametrize(
    ("phrase", "meant"),
    [
        ("a chair", [0, 1, 2, 3]),
        ("two Chairs", [0, 1, 2, 3]),
        ("a rocking chair", [1, 2]),
        ("a drawing of a blue rocking chair with armrests", [2]),
        ("a chair without a back", [3]),
        ("a tall lamp", [4]),
        ("three shelves", [5]),
    ],
)
def test_which_members_a_phrase_means(phrase, meant):
    request = asked_of(THERE, phrase, "here")
    assert [i for i, name in enumerate(THERE) if fits(name, request)] == meant


def test_counts_colours_and_proportions_of_a_phrase():
    request = asked_of(THERE, "two tall blue chairs", "here")
    assert (request.count, request.color, request.stretch) == (2, COLORS["blue"], STRETCHES["tall"])
    assert asked_of(THERE, "a pair of chairs", "here").count == 2
    # A word of a name comes before a colour.
    assert asked_of(THERE, "a red lamp", "here").color is None
    assert asked_of(THERE, "a red chair", "here").color == COLORS["red"]
    assert asked_of(THERE, "a small chair", "here").ignored == ("small",)
    assert asked_of(THERE, "2 chairs in blue", "here") == Request("chair", count=2, color=COLORS["blue"])
    assert asked_of(THERE, "a chair with no back", "here").attributes == ("without back",)


@pytest.mark.parametrize(
    ("phrase", "message"),
    [
        ("", "names nothing"),
        ("with arms", "names nothing"),
        ("a chiar", "nothing in here is named 'chiar'; the nearest there: chair"),
        ("a rockingchair", "the nearest there: rocking chair"),
        ("a xyz", "it has chair, chair without back, lamp, red lamp, rocking chair"),
        ("a rokcing chair", "named 'rokcing'; the nearest there: rocking"),
        ("a chair with armrsets", "named 'armrsets'; the nearest there: armrest"),
        ("a shelf with doors", "named 'doors'; it has shelf"),
        ("a blue red chair", "one colour"),
        ("two three chairs", "one number of things"),
        ("chairs", "say how many: two chairs, or one"),
        ("four pairs of chairs", "8 things are too many"),
        ("a chair, tall", "put 'tall' before what it is of"),
        ("a chair and a lamp", "one kind of thing at a time, and 'chair' and 'lamp' are two"),
        ("a new chair", "named 'new'"),
        ("a chair 🐱", "named '🐱'"),
        ("a tall short chair", "'tall' and 'short' are along one axis"),
        ("a rocking chair without a back", "none in here is all of rocking, without back; it has chair, chair without"),
    ],
)
def test_what_a_phrase_may_not_be(phrase, message):
    with pytest.raises(ValueError, match=message):
        asked_of(THERE, phrase, "here")
