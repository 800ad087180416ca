"""What members of the library are called."""

import torch
from sweep import sweep

from diff3ds.library import CATEGORIES, Attribute, Category, member


def captions(name, *attributes):
    return member(name, torch.Generator().manual_seed(0), attributes).captions


def test_adjectives_go_before_the_noun_and_with_behind_it():
    assert captions("chair") == ("a chair", "a seat")
    assert captions("chair", "armrests")[0] == "a chair with armrests"
    assert "an armchair" in captions("chair", "armrests")
    assert captions("chair", "rocking", "armrests")[0] == "a rocking chair with armrests"
    assert "a rocking armchair" in captions("chair", "rocking", "armrests")
    assert captions("chair", "armrests", "high back")[0] == "a chair with armrests and a high back"


def test_without_goes_last():
    assert captions("candle", "holder", "unlit")[0] == "a candle with a holder and without a flame"


def test_articles():
    assert captions("airplane")[0] == "an airplane"
    assert captions("glasses", "round")[0] == "a pair of round glasses"
    assert "a unicycle" in captions("bicycle", "one wheel")
    assert member("mug", torch.Generator()).caption == "a mug"


@sweep("name", CATEGORIES)
def test_the_usual_caption_names_category_and_attributes(name):
    category = CATEGORIES[name]
    for attributes in category.combinations():
        first, *others = category.captions(attributes)
        assert name in first
        rest = first.replace(name, "", 1)
        for attribute in category.attributes:
            assert (attribute.phrases[0].removeprefix("with ") in rest) == (attribute.name in attributes)
        assert len({first, *others}) == 1 + len(others)
        assert all(caption == caption.strip() and "  " not in caption for caption in (first, *others))


@sweep("name", CATEGORIES)
def test_no_caption_means_two_sets_of_attributes(name):
    category = CATEGORIES[name]
    said = [caption for attributes in category.combinations() for caption in category.captions(attributes)]
    assert len(said) == len(set(said))


def test_no_noun_means_two_categories():
    nouns = [n for c in CATEGORIES.values() for n in {c.name, *c.synonyms, *(n for a in c.attributes for n in a.nouns)}]
    assert len(nouns) == len(set(nouns))


@sweep("category", CATEGORIES.values())
def test_attributes_exclude_others_of_their_category(category):
    names = [attribute.name for attribute in category.attributes]
    assert len(names) == len(set(names)) <= 4
    for attribute in category.attributes:
        assert set(attribute.excludes) <= set(names) - {attribute.name}


def test_combinations_leave_out_what_excludes_each_other():
    a, b, c = Attribute("a", ("a",), excludes=("c",)), Attribute("b", ("b",)), Attribute("c", ("c",))
    category = Category("thing", lambda vary, attributes: [], attributes=(a, b, c))
    assert category.combinations() == ((), ("a",), ("b",), ("c",), ("a", "b"), ("b", "c"))
