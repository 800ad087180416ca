"""Figures on the pages and in the README are those of the benchmarks' files."""

import json
import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs/results").glob("*.md"))
# What the script imports beside it.
sys.path.append(str(ROOT / "benchmarks"))
TABLES = runpy.run_path(str(ROOT / "benchmarks/tables.py"))
RENDERER = runpy.run_path(str(ROOT / "benchmarks/tables_renderer.py"))
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_tables_are_up_to_date(path):
    assert TABLES["page"](path) == path.read_text(encoding="utf-8"), "run python benchmarks/tables.py"


def test_every_table_is_on_one_page():
    placed = [name for path in PAGES for name in re.findall(r"<!-- table (\w+) -->", path.read_text(encoding="utf-8"))]
    assert sorted(placed) == sorted(table.__name__ for table in TABLES["TABLES"])


def test_every_file_of_results_is_shown():
    shown = "".join(path.read_text(encoding="utf-8") for path in PAGES)
    assert [file.name for file in (ROOT / "benchmarks/results").glob("*.json") if f"/{file.name})" not in shown] == []


def test_the_speed_in_the_readme_is_that_of_the_benchmark():
    figures = json.loads((ROOT / "benchmarks/results/render.json").read_text(encoding="utf-8"))["figures"]
    digits, both = RENDERER["digits"], "forward + backward"
    for key, name in RENDERER["WORKLOADS"].items():
        times = [figures["ms"][key][threads][both][0] for threads in "12"] + [figures["reference_ms"][key][both]]
        assert f"| {name} | {' | '.join(map(digits, times))} |" in README


def test_the_accuracy_in_the_readme_is_that_of_the_benchmark():
    kernels = json.loads((ROOT / "benchmarks/results/accuracy.json").read_text(encoding="utf-8"))["figures"]["kernels"]
    assert f"{100 * kernels['within']:.3f} % of {kernels['ink']:,} pixels" in README
    errors = [row["error"] for row in kernels["gradients"]["colour and alpha, all pixels"].values()]
    assert f"gradients of colour and alpha | within {max(errors):.1e}".replace("e-0", "e-") in README


def test_the_scores_in_the_readme_are_those_of_the_benchmark():
    runs = json.loads((ROOT / "benchmarks/results/views.json").read_text(encoding="utf-8"))["runs"]
    for run in runs:
        scores = [row["F5"] for row in run["rows"]]
        if "--seeds 30-59" in run["command"]:
            mean, worst = (f"{score:.3f}".removeprefix("0") for score in (sum(scores) / len(scores), min(scores)))
            assert f"{mean}, worst {worst}" in README
        elif run["command"].endswith("00004926"):
            for row in run["rows"]:
                score = f"{row['F5']:.3f}".removeprefix("0")
                assert re.search(
                    rf"{row['object']}.*\| {score}, {row['curves']} curves of {row['curves_truth']}", README
                )


def test_the_coloured_strokes_in_the_readme_are_those_of_the_benchmark():
    rows = json.loads((ROOT / "benchmarks/results/color_views.json").read_text(encoding="utf-8"))["figures"]["rows"]
    chair = {row["strokes"]: row for row in rows if (row["scene"], row["order"]) == ("chair", "depth")}
    worst, middle, best = (f"{chair[strokes]['psnr']:.1f}" for strokes in (64, 256, 1024))
    assert f"{worst}, {middle} and {best} dB for 64, 256 and 1,024 strokes" in README
    within_the_readme([row["seconds"] / 60 for row in chair.values()], r"min \(100 views of 400²\)")


def within_the_readme(values: list[float], unit: str) -> None:
    """Between the bounds that the README has before a unit, in some of its rows."""
    bounds = [(float(low), float(high)) for low, high in re.findall(rf"\| ([\d.]+) to ([\d.]+) {unit}", README)]
    assert len(values) > 1
    assert any(low <= min(values) <= max(values) <= high for low, high in bounds), (values, bounds)


def test_the_times_in_the_readme_are_those_of_the_benchmark():
    """Of edge maps and of the edges of photographs, of 50 views, on a machine with nothing else to do."""
    runs = json.loads((ROOT / "benchmarks/results/views.json").read_text(encoding="utf-8"))["runs"]
    for end, unit in (("00004926", r"s \(50 views of 400²\)"), ("--target color-edges", r"s \|")):
        (run,) = [r for r in runs if r["command"].endswith(end)]
        assert "nothing else running" in run["machine"]
        within_the_readme([row["seconds"] for row in run["rows"]], unit)


def test_the_readme_repeats_what_the_pages_of_results_say():
    """Of figures that no file of results has."""
    page = (ROOT / "docs/results/edges.md").read_text(encoding="utf-8")
    assert "whose published curves score .123" in page
    assert "NEF's published curves: .123" in README
    assert "23 of 62 quarter circles" in page
    assert "23 of 62 quarter circles" in README
