"""The document on the library: its code runs, and the category that it adds is a good one."""

import re
from pathlib import Path

import torch

from diff3ds.library import CATEGORIES, member

TEXT = (Path(__file__).parents[2] / "docs/reference/library.md").read_text(encoding="utf-8")
CODE = re.findall(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


def run(code):
    names = {"__name__": "document"}
    exec(compile(code, "docs/reference/library.md", "exec"), names)
    return names


def test_what_it_shows_is_what_one_gets():
    drawn = run(CODE[0])["drawn"]
    assert "25 black cubics" in CODE[0]
    assert len(drawn.sketch) == 25
    shown = re.search(r"# \((.*)\)", CODE[0])[1].split(", ..., ")
    assert f'"{drawn.captions[0]}", "{drawn.captions[1]}"' == shown[0]
    assert f'"{drawn.captions[-1]}"' == shown[1]


def test_its_kite_can_be_drawn(monkeypatch):
    kite = run(CODE[1])["CATEGORY"]
    monkeypatch.setitem(CATEGORIES, kite.name, kite)
    drawn = member("kite", torch.Generator().manual_seed(0), ("tail",))
    assert drawn.caption == "a kite with a tail"
    assert len(drawn.sketch) == 9


def test_it_counts_the_categories():
    assert "things of nearly eighty kinds" in TEXT
    assert 75 <= len(CATEGORIES) < 80
