"""Figures in docs/howto/phrase.md are those of the benchmarks' files."""

import json
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/howto/phrase.md").read_text(encoding="utf-8")
DISTILL = json.loads((ROOT / "benchmarks/results/distill.json").read_text())


def rows(header: str) -> list[list[str]]:
    """The cells of the table whose header starts so, without the line below that."""
    lines = PAGE[PAGE.index(header) :].split("\n\n")[0].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [cells[0], *cells[2:]]


def short(value: float, digits: int = 2) -> str:
    return f"{value:.{digits}f}".removeprefix("0")


def test_the_known_answers_are_those_of_the_benchmark():
    (_, *shapes), *table = rows("| | chair | table |")
    figures = DISTILL["shapes"]["figures"]
    assert sorted(shapes) == sorted(figures)
    for (_, *values), name, digits in zip(table, ("F5", "F2", "chamfer_percent"), (2, 2, 1), strict=True):
        assert values == [short(figures[shape][name], digits) for shape in shapes]


def test_every_ablation_of_the_benchmark_is_in_the_table():
    _, *table = rows("| | F at 5 % | F at 2 % | strokes left |")
    figures = DISTILL["ablations"]["figures"].values()
    for column, name in ((1, "F5"), (2, "F2")):
        values = [value for row in table for value in row[column].split("; ")]
        assert sorted(values) == sorted(short(run[name]) for run in figures)


def test_the_cost_of_a_step_is_that_of_the_benchmark():
    figures = json.loads((ROOT / "benchmarks/results/step_cost.json").read_text())["figures"]["MVDream, 4 x 256²"]
    milliseconds, percent = figures["ms"][0], figures["percent_of_published_step"]
    assert f"{milliseconds:.1f} ms of such a step" in PAGE
    assert f"{short(percent)} % of the .9 s" in PAGE
