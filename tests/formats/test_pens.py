"""What a pen draws: nothing twice, joined at the ends, in short ways; counted by what is known of the drawing."""

import itertools
import math
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.formats import save_pdf, save_svg
from diff3ds.page.drawn_paths import DrawnPath
from diff3ds.page.pens.pen_paths import pen_paths, travel
from diff3ds.page.sheet.page_setup import PageSetup

# 100 mm wide, as the cameras' pictures.
PAGE = PageSetup(100, 100, 0, "none")
PATH = "{http://www.w3.org/2000/svg}path"
# Quarters of a circle as cubics are off by less than 3e-4 of the radius.
QUARTER = 4 / 3 * (math.sqrt(2) - 1)


def path(points, number, width=2.0, closed=False):
    """Straight lines through points, run through evenly."""
    points = np.array(points, float)
    inner = [points[:-1] + np.diff(points, axis=0) * share for share in (1 / 3, 2 / 3)]
    curve = np.concatenate([points[:1], np.stack([*inner, points[1:]], 1).reshape(-1, 2)])
    return DrawnPath((number,), [curve], closed, width, (0.0, 0.0, 0.0), 1.0)


def circle(x, y, radius, number, turn=0.0):
    angles = turn + np.arange(4) * math.pi / 2
    out = np.stack([np.cos(angles), np.sin(angles)], -1)
    along = np.stack([-np.sin(angles), np.cos(angles)], -1)
    rows = [out, out + QUARTER * along, np.roll(out - QUARTER * along, -1, 0), np.roll(out, -1, 0)]
    cubics = np.array([x, y]) + radius * np.stack(rows, 1)
    curve = np.concatenate([cubics[:1, 0], cubics[:, 1:].reshape(-1, 2)])
    return DrawnPath((number,), [curve], True, 2.0, (0.0, 0.0, 0.0), 1.0)


def of(paths, pen=None):
    drawn = pen_paths(paths, pen)
    return drawn, travel([drawn], 1.0)


def test_edges_of_a_cube_are_four_paths_and_each_is_drawn_once():
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    flat = corners @ np.array([[100, 10], [35, 25], [0, 90]]) + 20
    pairs = [(a, b) for a, b in itertools.combinations(range(8), 2) if np.abs(corners[a] - corners[b]).sum() == 1]
    drawn, way = of([path(flat[[a, b]], i) for i, (a, b) in enumerate(pairs)])
    # Eight corners with three ends each: every path begins and ends at one of these.
    assert len(drawn) == way.lifts == 4
    assert sorted(stroke for some in drawn for stroke in some.strokes) == list(range(12))
    assert way.drawn == pytest.approx(4 * sum(math.hypot(*row) for row in ((100, 10), (35, 25), (0, 90))), rel=1e-9)


def test_loops_that_meet_are_one_loop():
    squares = [[(50, 50), (50, 90), (90, 90), (90, 50)], [(50, 50), (50, 10), (10, 10), (10, 50)]]
    lines = [(s[k], s[(k + 1) % 4]) for s in squares for k in range(4)]
    [drawn], way = of([path(line, i) for i, line in enumerate(lines)])
    assert drawn.closed
    assert way == (1, pytest.approx(320.0), 0.0)
    # As strokes that are closed by themselves, too.
    [drawn], way = of([path([*s, s[0]], i, closed=True) for i, s in enumerate(squares)])
    assert drawn.closed
    assert way == (1, pytest.approx(320.0), 0.0)


@pytest.mark.parametrize(("gap", "left"), [(1.9, 1), (2.1, 2)])
def test_ends_meet_within_the_width_of_the_pen(gap, left):
    drawn, way = of([path([(10, 10), (50, 10)], 0), path([(50 + gap, 10), (90, 10)], 1)])
    assert len(drawn) == left
    assert way.drawn == pytest.approx(80.0 if left == 1 else 80.0 - gap)


def test_what_lies_on_ink_is_not_drawn_again():
    twice = [path([(10, 10), (90, 10)], 0), path([(90, 10.3), (10, 10.3)], 1)]
    assert of(twice)[1] == (1, pytest.approx(80.0), 0.0)
    # Parts of lines that lie on each other: as long as both together.
    drawn, way = of([path([(10, 10), (60, 10)], 0), path([(40, 10), (90, 10)], 1)])
    assert len(drawn) == 1
    # Cut to cells of half a pixel.
    assert way.drawn == pytest.approx(80.0, abs=1.0)
    # There and back again, as a circle that is seen from its edge.
    assert of([path([(10, 10), (90, 10), (10, 10)], 0)])[1].drawn == pytest.approx(80.0, abs=5.0)


def test_lines_that_cross_or_part_stay_whole():
    tilt = math.radians(8)
    end = (10 + 160 * math.cos(tilt), 50 + 160 * math.sin(tilt))
    crossing = [path([(10, 50), (170, 50)], 0), path([(10, 50 - 11), (end[0], end[1] - 11)], 1)]
    assert of(crossing)[1] == (2, pytest.approx(320.0), pytest.approx(of(crossing)[1].moved))
    parting = [path([(10, 50), (170, 50)], 0), path([(10, 50), end], 1)]
    assert of(parting)[1] == (1, pytest.approx(320.0), 0.0)
    # Two pens' widths apart both are seen.
    assert of([path([(10, 10), (90, 10)], 0), path([(10, 14), (90, 14)], 1)])[1].drawn == pytest.approx(160.0)


def test_ways_in_the_air_are_short():
    # Steps of ten to and fro, in any order and direction: nine gaps of ten.
    lines = [path([(x, 10), (x, 60)][:: 1 if k % 3 else -1], k) for k, x in enumerate(range(10, 110, 10))]
    order = np.random.default_rng(0).permutation(10)
    drawn, way = of([lines[k] for k in order])
    assert way == (10, pytest.approx(500.0), pytest.approx(90.0))
    assert sorted(some.strokes[0] for some in drawn) == list(range(10))


def test_loops_begin_where_the_pen_is_near():
    # Circles in a row, whose files begin on the far side of each: two gaps of ten, but for steps of a pen's width.
    row = [circle(30 + 50 * k, 40, 20, k, turn=math.pi / 3) for k in range(3)]
    drawn, way = of([row[2], row[0], row[1]])
    assert [some.closed for some in drawn] == [True] * 3
    assert way.drawn == pytest.approx(3 * 40 * math.pi, rel=1e-3)
    # From the left side of the middle one to the next: once over, or around, there is a diameter for each.
    assert way.moved <= 2 * 10 + 40 + 2


def test_a_loop_that_is_met_anywhere_is_drawn_without_a_lift():
    # A line that ends on a circle, which begins elsewhere.
    [drawn], way = of([circle(60, 40, 20, 0, turn=0.3), path([(5, 40), (40, 40)], 1)])
    assert not drawn.closed
    assert way == (1, pytest.approx(35 + 40 * math.pi, abs=2.0), 0.0)


def test_a_pen_a_layer_and_what_is_told(tmp_path):
    angle = torch.linspace(0, 2 * math.pi, 9, dtype=torch.float64)
    ring = torch.stack([angle.cos(), angle.sin(), 0 * angle], -1)
    sketch = ds.Sketch(
        torch.stack([ring[:-1], ring[1:]], 1), color=torch.eye(3, dtype=torch.float64)[[0] * 4 + [2] * 4]
    )
    camera = ds.orbit(0.0, 90.0, height=4.0, size=400)
    told = save_svg(tmp_path / "a.svg", sketch, camera, centerline=True, page=PAGE, pen_mm=0.3)
    paths = list(ElementTree.parse(tmp_path / "a.svg").iter(PATH))
    # Half a ring of 4 sides for each colour, on 25 mm a world unit.
    assert [found.get("id") for found in paths] == ["strokes-3-2-1-0", "strokes-4-5-6-7"]
    assert [float(found.get("stroke-width")) for found in paths] == pytest.approx([3.0, 3.0])  # ten pixels a millimetre
    assert told == (2, pytest.approx(16 * math.sin(math.pi / 8) * 25, rel=1e-4), 0.0)
    assert save_pdf(tmp_path / "a.pdf", sketch, camera, centerline=True, page=PAGE, pen_mm=0.3) == told
    assert (
        told.told("mm", 10.0)
        == "the pen is lifted 2 times: 153 mm drawn, 0 mm in the air, 0 min 15 s at 10 mm a second"
    )
    one = save_svg(tmp_path / "b.svg", sketch, camera, centerline=True, layers=["ring"] * 8)
    labels = re.findall('inkscape:label="([^"]*)"', (tmp_path / "b.svg").read_text())
    # Two colours in a layer are a pen each.
    assert (one.lifts, labels) == (2, ["1 ring", "#ff0000", "#0000ff"])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"pen_mm": 0.3}, "give centerline and a page"),
        ({"pen_mm": 0.3, "centerline": True}, "give centerline and a page"),
        ({"pen_mm": 0.0, "centerline": True, "page": PAGE}, "must be positive"),
    ],
)
def test_pens_that_no_page_has(tmp_path, given, said):
    sketch = ds.Sketch(torch.tensor([[[0.0, 0, 0], [1, 0, 0]]]))
    with pytest.raises(ValueError, match=said):
        save_svg(tmp_path / "a.svg", sketch, ds.orbit(0.0, 20.0), **given)
    assert not (tmp_path / "a.svg").exists()
