"""The document on the vocabulary is what the code says, and what it shows is understood."""

import re
import runpy
from pathlib import Path

from sweep import sweep

from diff3ds.library import CATEGORIES
from diff3ds.library.phrase import Request, parse

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/reference/vocabulary.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in row.strip("|").split("|")] for row in re.findall(r"^\|.*\|$", TEXT, re.MULTILINE)]
KINDS = [row for row in ROWS if len(row) == 4][2:]


def test_it_is_up_to_date():
    assert runpy.run_path(str(ROOT / "benchmarks/vocabulary.py"))["document"]() == TEXT, (
        "run python benchmarks/vocabulary.py"
    )


def test_it_has_all_kinds():
    assert [row[0] for row in KINDS] == [*CATEGORIES]


@sweep(("kind", "nouns", "attributes", "parts"), KINDS)
def test_what_it_says_of_a_kind_is_understood(kind, nouns, attributes, parts):
    """As a reader of the page would say it."""
    for noun in filter(None, nouns.split(", ")):
        assert parse(f"the {noun}") == Request(kind)
    for part in filter(None, parts.split(", ")):
        assert parse(f"the {kind} with {part}") == Request(kind)
    names = [attribute.name for attribute in CATEGORIES[kind].attributes]
    for name, said in zip(names, attributes.split("; "), strict=True):
        ways, _, implied = said.removesuffix(")").partition(" (")
        for way in ways.split(" or "):
            phrase = f"the {kind} {way}" if way.startswith("with") else f"the {way} {kind}"
            assert parse(phrase) == Request(kind, (name,))
        for noun in filter(None, implied.split(", ")):
            assert parse(f"the {noun}") == Request(kind, (name,))


@sweep("row", [row for row in ROWS if len(row) == 2][2:])
def test_words_of_every_kind_are_understood(row):
    for word in re.findall(r"(?:^|, |; |: | or )([a-z0-9]+)(?=[,;:]| or |$)", row[1]):
        assert parse(f"{word} lamp").category == "lamp"
