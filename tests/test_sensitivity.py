"""The constants of edges, as `benchmarks/constants.py` reads them and `benchmarks/sensitivity.py` changes them."""

import math
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.append(str(BENCHMARKS))

import constants as known  # noqa: E402
from sensitivity import changed_source, changes, scaled  # noqa: E402

ALL = {f"{c.module}.{c.name}": c for c in known.constants()}


def test_every_constant_of_edges_says_its_unit_and_what_it_was_chosen_on():
    assert len(ALL) > 200
    near, slant = ALL["edges.evidence.support.NEAR"], ALL["edges.evidence.support.SLANT"]
    assert (near.value, near.unit, near.chosen) == ("2.5", "px", "empirical")
    assert (slant.value, slant.unit, slant.about) == ("0.436", "sine", near.about)
    assert ALL["edges.evidence.bias.CLOSED[2]"].value == "8.0"
    assert ALL["edges.measure.holes.PARALLEL"].value == "np.cos(np.deg2rad(4.0))"
    # What follows from others is none.
    assert "edges.evidence.support.SEGMENT" not in ALL


@pytest.mark.parametrize(
    "comment", ["", "# Pixels.", "# [px] Of what?", "# [px; guessed] What?", "# [px, px, px; empirical] What?"]
)
def test_a_constant_without_its_unit_is_an_error(tmp_path, monkeypatch, comment):
    monkeypatch.setattr(known, "PACKAGE", tmp_path)
    (tmp_path / "edges").mkdir()
    (tmp_path / "edges/new.py").write_text(f"{comment}\nONE, TWO = 1.0, 2.0\n")
    with pytest.raises(
        ValueError, match=r"new\.py:2: the comment above a constant has to begin with its units .* or 2"
    ):
        known.constants()


def test_a_changed_constant_changes_what_follows_from_it():
    constant = ALL["edges.evidence.support.SAMPLES"]
    source = (known.PACKAGE / "edges/evidence/support.py").read_text()
    for factor, samples in ((0.7, 4), (1.4, 7)):
        inner = {}
        exec(compile(changed_source(source, constant, factor), "support", "exec"), inner)
        assert (inner["SAMPLES"], inner["SEGMENT"], inner["PARTS"]) == (samples, 6 * samples, 6)
    # Of the cosine of an angle, the angle.
    holes = (known.PACKAGE / "edges/measure/holes.py").read_text()
    assert "np.cos(np.deg2rad(5.6))" in changed_source(holes, ALL["edges.measure.holes.PARALLEL"], 1.4)


def test_values_stay_what_they_are():
    assert scaled(2.5, "px", 0.7) == pytest.approx(1.75)
    assert scaled(0.85, "fraction", 1.4) == 1.0
    assert (scaled(98, "%", 1.4), scaled(98, "%", 0.7)) == (100, 69)
    assert scaled(0.5, "fraction", 1.4) == pytest.approx(0.7)
    assert scaled(math.cos(0.5), "cosine", 1.4) == pytest.approx(math.cos(0.7))
    assert (scaled(5, "points", 0.7), scaled(1, "rounds", 0.7), scaled(1, "rounds", 1.4)) == (4, 0, 2)


def test_the_constants_that_matter_come_first():
    scores = {
        "": {"a": 0.9, "b": 0.8},
        "m.X x 0.7": {"a": 0.9, "b": 0.8},
        "m.X x 1.4": {"a": 0.9, "b": 0.8},
        "m.Y x 0.7": {"a": 0.7, "b": 0.7},
        "m.Y x 1.4": {"a": 1.0},
        "m.Z x 0.7": {"a": 0.95, "b": 0.8},
    }
    # Of Y only one folder has both factors, of Z none.
    (first, less, more), second = changes(scores)
    assert first == "m.Y"
    assert (less, more) == pytest.approx((-0.2, 0.1))
    assert second == ("m.X", 0.0, 0.0)
