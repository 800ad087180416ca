"""Lines on the page: on the exact projected curve, with their arc length, whole where strokes are."""

import math

import numpy as np
import pytest
import torch
from style_pages import circle, lines, stroke

import diff3ds as ds


def test_a_circle_is_one_closed_line_of_the_right_length():
    (line,) = lines(circle(0.5))
    assert line.closed
    assert (line.points[0] == line.points[-1]).all()
    radius = np.linalg.norm(line.points - 128, axis=1)
    assert np.abs(radius - 64).max() < 1e-9
    assert line.length == pytest.approx(2 * math.pi * 64, rel=1e-4)
    assert abs(line.angle[-1] - line.angle[0]) == pytest.approx(2 * math.pi, abs=1e-9)


def test_between_samples_lines_keep_to_the_curve():
    (line,) = lines(circle(0.5))
    fine = line.refined(0.5)
    assert np.diff(fine.along).max() <= 0.5 + 1e-9
    assert np.abs(np.linalg.norm(fine.points - 128, axis=1) - 64).max() < 1e-3


def test_perspective_and_weights_are_exact():
    g = torch.Generator().manual_seed(2)
    sketch = ds.Sketch(
        torch.rand(6, 4, 3, generator=g, dtype=torch.float64) - 0.5, 10 ** torch.rand(6, 4, generator=g).double()
    )
    camera = ds.orbit(30.0, 20.0, 2.0, size=256)
    cubics = ds.project(sketch, camera).cubics[0]
    t = torch.linspace(0, 1, 20001, dtype=torch.float64)
    for line in lines(sketch, camera):
        x, y, z, _ = (ds.bezier.curves.bernstein(t, 3) @ cubics[line.stroke]).unbind(-1)
        curve = torch.stack([x / z, y / z], -1)
        off = torch.cdist(torch.from_numpy(line.refined(3.0).points), curve).amin(1)
        # Half a step of the dense curve.
        assert off.max() < 0.02
        assert line.length == pytest.approx(float((curve[1:] - curve[:-1]).norm(dim=1).sum()), rel=2e-4)


def test_a_corner_turns_on_the_spot_by_the_shorter_way():
    sketch = ds.Sketch(
        torch.tensor([[[0.0, -0.5, 0.0], [0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.5]]]),
        chains=ds.Chains.of([2]),
    )
    (line,) = lines(sketch)
    at_corner = np.flatnonzero(np.isclose(line.along, 64))
    assert len(at_corner) >= 5
    assert line.angle[-1] - line.angle[0] == pytest.approx(-math.pi / 2)
    assert len(lines(sketch)[0].refined(1.0).points) == 128 + len(at_corner)


def test_parts_have_their_length_and_ends_where_the_line_has():
    (line,) = lines(stroke((-0.5, 0.0), (0.5, 0.0)))
    first, inner = line.part(0.0, 50.0), line.part(10.0, 50.0)
    assert (first.begins, first.ends, inner.begins) == (True, False, False)
    assert inner.along[[0, -1]].tolist() == [0.0, 40.0]
    assert inner.points[[0, -1], 0].tolist() == pytest.approx([74.0, 114.0])
    (ring,) = lines(circle(0.5))
    part = ring.part(0.0, 20.0)
    assert (part.closed, part.begins, part.ends) == (False, False, False)


def test_what_the_page_cuts_has_no_ends_there():
    (line,) = lines(stroke((-0.5, 0.0), (9.0, 0.0)))
    assert line.begins
    assert not line.ends
    ring = circle(3.0)
    ring = circle(3.0, (-ring.points[0, 0]).tolist())
    (line,) = lines(ring)
    # Its seam lies in the middle of the page: both parts are one line, with neither beginning nor end.
    assert (line.closed, line.begins, line.ends) == (False, False, False)
    assert np.linalg.norm(line.points - 128, axis=1).min() < 1e-6


def test_what_lies_behind_the_camera_is_left_out():
    camera = ds.orbit(0.0, 0.0, 3.0, size=256)
    assert lines(ds.Sketch(torch.tensor([[[4.0, 0.0, 0.0], [5.0, 1.0, 0.0]]])), camera) == []
    (line,) = lines(ds.Sketch(torch.tensor([[[0.0, 0.1, 0.0], [5.0, 0.1, 0.0]]])), camera)
    assert line.begins
    assert not line.ends


def test_a_stroke_without_length_is_one_sample():
    (line,) = lines(stroke((0.25, 0.0), (0.25, 0.0), width=0.1))
    assert line.points.tolist() == [[160.0, 128.0]]
    assert line.half_width.tolist() == pytest.approx([12.8])


@pytest.mark.parametrize(
    ("points", "wide"), [([[0.0, -0.5, 0], [0, 0.5, 0]], 1.0), ([[0.0, 0, -0.5], [0, 0, 0.5]], 1 / 3)]
)
def test_widths_are_across_the_line_where_pixels_are_oblong(points, wide):
    sketch = ds.Sketch(torch.tensor([points], dtype=torch.float64), width=0.1, width_space="world")
    camera = ds.orbit(0.0, 0.0, 3.0, fov=60, size=(256, 768)).resize(256)
    (line,) = lines(sketch, camera)
    focal = 128 / math.tan(math.radians(30))
    assert line.half_width.tolist() == pytest.approx([focal * 0.05 / 3 * wide] * len(line.points), rel=1e-6)


def test_widths_and_depths_are_those_of_the_renderer():
    points = torch.tensor([[[0.0, -0.5, 0.0], [1.0, 0.5, 0.0]]], dtype=torch.float64)
    sketch = ds.Sketch(points, width=torch.tensor([[0.1, 0.2]], dtype=torch.float64), width_space="world")
    camera = ds.orbit(0.0, 0.0, 3.0, fov=60, size=256)
    (line,) = lines(sketch, camera)
    focal = 128 / math.tan(math.radians(30))
    assert line.depth[[0, -1]].tolist() == pytest.approx([3.0, 2.0])
    assert line.half_width[[0, -1]].tolist() == pytest.approx([focal * 0.05 / 3, focal * 0.1 / 2])
