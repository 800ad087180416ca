"""The runs of the paper's comparisons (benchmarks/paper.py): which prior each has, and what alone differs."""

import importlib.util
import shlex
import sys
from pathlib import Path

import pytest
import torch

from diff3ds.formats import save_png
from diff3ds.tasks.text_image.prior_options import FOR_PHRASES, FOR_PICTURES

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.append(str(BENCHMARKS))
# Not by its name, which another module may have.
spec = importlib.util.spec_from_file_location("paper_tables", BENCHMARKS / "paper.py")
assert spec is not None
assert spec.loader is not None
paper = importlib.util.module_from_spec(spec)
spec.loader.exec_module(paper)


@pytest.fixture
def runs(tmp_path, monkeypatch, capsys):
    """The commands of a table, as words, without -o."""
    save_png(tmp_path / "mug.png", torch.ones(8, 8, 3))

    def dry(table: str, *more: str) -> list[list[str]]:
        given = [table, "-o", str(tmp_path / "out"), "--pictures", str(tmp_path), "--first", "1", "--dry", *more]
        monkeypatch.setattr(sys, "argv", ["paper.py", *given])
        paper.main()
        lines = [shlex.split(line) for line in capsys.readouterr().out.splitlines()]
        return [words[: words.index("-o")] + words[words.index("-o") + 2 :] for words in lines]

    return dry


@pytest.mark.parametrize("table", paper.TABLES)
def test_every_run_names_a_prior_that_is_a_network(table, runs):
    """Without one, a machine without a GPU would take the built-in prior, whose preset is another."""
    for words in runs(table):
        known = FOR_PICTURES if words[1] == "image" else FOR_PHRASES
        assert words[words.index("--prior") + 1] in known


def test_the_runs_of_a_table_differ_in_what_is_compared_alone(runs):
    for option, table in (("--guidance", "guidance"), ("--radius", "radius"), ("--strokes", "strokes")):
        found = runs(table)
        values = [float(words.pop(words.index(option) + 1)) for words in found]
        assert len(values) == len(set(values)) == 4
        assert all(words == found[0] for words in found)
    assert [words[1:] for words in runs("text", "--options=--seed 3")] == [
        ["text", "a chair", "--prior", prior, "--seed", "3"] for prior in ("stable-diffusion", "mvdream")
    ]
