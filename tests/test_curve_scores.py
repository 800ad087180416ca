"""The scorer of 3D curves (benchmarks/curve_scores.py) on lines and circles whose figures are known."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from curve_scores import bezier, circle_of, score


def line_truth(length=0.6):
    return {"curves": [{"type": "line", "points": [[0.2, 0.5, 0.5], [0.2 + length, 0.5, 0.5]]}]}


def line_sketch(start=0.2, stop=0.8, beside=0.0):
    return {"control_points": [[[start, 0.5 + beside, 0.5], [stop, 0.5 + beside, 0.5]]]}


def arcs(radius, center=(0.5, 0.5, 0.5), count=4):
    """A circle about the z axis as rational quadratic arcs of equal angle."""
    half = math.pi / count
    points = []
    for k in range(count):
        at = [(2 * k * half, 1), ((2 * k + 1) * half, 1 / math.cos(half)), ((2 * k + 2) * half, 1)]
        points.append(
            [(center[0] + radius * r * math.cos(a), center[1] + radius * r * math.sin(a), center[2]) for a, r in at]
        )
    return {"control_points": points, "weights": [[1, math.cos(half), 1]] * count}


def circle_truth(radius, angle=2 * math.pi):
    t = np.linspace(0, angle, 400)
    points = np.column_stack([0.5 + radius * np.cos(t), 0.5 + radius * np.sin(t), np.full(400, 0.5)])
    known = {"type": "circle", "radius": radius, "center": [0.5] * 3, "normal": [0, 0, 1], "angle": angle}
    return {"curves": [{**known, "points": points.tolist()}]}


@pytest.mark.parametrize(("beside", "right"), [(0.003, (1, 1, 1)), (0.006, (0, 1, 1)), (0.015, (0, 0, 1))])
def test_a_line_beside_the_truth_is_off_by_its_distance(beside, right):
    figures = score(line_sketch(beside=beside), line_truth())
    # Samples of the truth are 5 mm apart and voxels 7.8 mm wide: nearest samples lie up to half of that further along.
    assert 1000 * beside <= figures["acc_mm"] <= math.hypot(1000 * beside, 2.5)
    assert 1000 * beside <= figures["comp_mm"] <= math.hypot(1000 * beside, 3.9)
    assert tuple(figures[f"F{mm}"] for mm in (5, 10, 20)) == right


def test_half_of_a_line_recalls_half():
    figures = score(line_sketch(stop=0.5), line_truth())
    assert figures["P5"] == 1
    assert figures["R5"] == pytest.approx(0.5, abs=0.02)  # the 5 mm of the threshold are .008 of the line
    assert figures["F5"] == pytest.approx(2 / 3, abs=0.02)


def test_a_curve_drawn_twice_counts_as_two_but_scores_as_one():
    once, twice = line_sketch(), {"points": 2 * line_sketch()["control_points"]}
    one, two = score(once, line_truth()), score(twice, line_truth())
    assert (one["curves"], two["curves"], one["curves_truth"]) == (1, 2, 1)
    assert two["acc_mm"] == pytest.approx(one["acc_mm"], abs=1e-9)


def test_no_curves_score_nothing():
    figures = score({"control_points": []}, line_truth())
    assert (figures["F5"], figures["curves"], figures["acc_mm"]) == (0, 0, math.inf)


def test_a_sketch_without_points_is_refused():
    with pytest.raises(ValueError, match="control_points"):
        score({"curves": []}, line_truth())


@pytest.mark.parametrize("count", [3, 4, 7])
def test_rational_arcs_of_one_circle_are_one_curve_found_exactly(count):
    figures = score(arcs(0.2, count=count), circle_truth(0.2))
    assert (figures["curves"], figures["curves_joined"], figures["curves_truth"]) == (count, 1, 1)
    assert (figures["circles"], figures["circles_found"], figures["circles_exact"]) == (1, 1, 1)
    assert figures["radius_error_worst"] == pytest.approx(0, abs=1e-6)
    assert figures["F5"] == 1


def test_arcs_of_two_circles_stay_two():
    one, other = arcs(0.2), arcs(0.2, center=(0.5, 0.5, 0.7))
    both = {key: one[key] + other[key] for key in one}
    assert score(both, circle_truth(0.2))["curves_joined"] == 2


def test_arcs_of_one_circle_that_do_not_touch_stay_two():
    whole = arcs(0.2)
    opposite = {key: whole[key][::2] for key in whole}
    assert score(opposite, circle_truth(0.2))["curves_joined"] == 2


@pytest.mark.parametrize(("radius", "found"), [(0.2008, 1), (0.1992, 1), (0.202, 0), (0.198, 0)])
def test_a_circle_is_found_to_half_a_percent_of_its_radius(radius, found):
    figures = score(arcs(radius), circle_truth(0.2))
    assert (figures["circles_found"], figures["circles_radius"]) == (found, found)
    assert figures["radius_error_median"] == pytest.approx(100 * abs(radius / 0.2 - 1), abs=1e-6)


@pytest.mark.parametrize(("off", "found"), [(0.0018, 1), (0.0022, 0)])
def test_a_circle_is_found_to_one_percent_of_its_centre(off, found):
    figures = score(arcs(0.2, center=(0.5 + off, 0.5, 0.5)), circle_truth(0.2))
    assert (figures["circles_found"], figures["circles_exact"], figures["circles_radius"]) == (found, found, 1)


def test_small_and_short_circles_are_not_asked_for():
    assert score(arcs(0.2), circle_truth(0.029))["circles"] == 0
    assert score(arcs(0.2), circle_truth(0.2, angle=1.5))["circles"] == 0


def test_a_polynomial_quarter_circle_is_found_but_not_exact():
    k = 0.2 * 4 / 3 * math.tan(math.pi / 8)
    cubic = [[0.7, 0.5, 0.5], [0.7, 0.5 + k, 0.5], [0.5 + k, 0.7, 0.5], [0.5, 0.7, 0.5]]
    figures = score({"control_points": [cubic]}, circle_truth(0.2, angle=math.pi / 2))
    assert (figures["circles_found"], figures["circles_exact"], figures["circles_radius"]) == (1, 0, 0)


def test_lines_and_waves_have_no_circle():
    assert circle_of(bezier(np.array([[0.0, 0, 0], [1, 1, 1]]), None)) is None
    assert circle_of(bezier(np.array([[0.0, 0, 0], [1, 1, 0], [2, -1, 0], [3, 0, 0]]), None)) is None
    assert circle_of(bezier(np.array([[0.0, 0, 0], [0, 1, 0], [1, 1, 1], [1, 0, 1]]), None)) is None


def test_published_curves_of_a_real_object_have_their_known_score(data_folder):
    folder = data_folder / "abc_nef" / "00000952"
    sketch, truth = (json.loads((folder / f"{name}.json").read_text()) for name in ("nef_curves", "ground_truth"))
    figures = score(sketch, truth)
    # The figures of an independent implementation of the protocol.
    assert (figures["curves"], figures["curves_truth"]) == (32, 30)
    for name, value in {"acc_mm": 8.190, "comp_mm": 8.329, "F5": 0.123, "F10": 0.771, "F20": 0.999}.items():
        assert figures[name] == pytest.approx(value, abs=5e-4)
