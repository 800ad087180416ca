"""Sketches that are bent towards the lines of a drawing: towards their own after a known map."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.library import member
from diff3ds.recognition.bend import bend_to, seen_by
from diff3ds.recognition.picture_lines import Lines
from diff3ds.recognition.side_seen import PlacedLines, cameras_at

CAMERA = cameras_at([(35.0, 15.0)])


def drawn(name: str) -> ds.Sketch:
    return member(name, torch.Generator().manual_seed(0)).sketch


def points_seen(sketch: ds.Sketch, count: int = 65) -> torch.Tensor:
    t = torch.linspace(0, 1, count, dtype=torch.float64)
    places = ds.bezier.evaluate(sketch.points.double(), sketch.weights.double(), t)
    return seen_by(places.flatten(0, 1), CAMERA)[0].reshape(len(sketch), count, 2)


def lines_of(sketch: ds.Sketch) -> PlacedLines:
    """What the camera sees, as a drawing in which nothing is hidden."""
    seen = points_seen(sketch).numpy()
    middles, tangents = (seen[:, 1:] + seen[:, :-1]) / 2, seen[:, 1:] - seen[:, :-1]
    low, high = middles.min((0, 1)), middles.max((0, 1))
    side, middle = float((high - low).max()), (low + high) / 2
    lines = Lines(((middles - middle) / side).reshape(-1, 2), (tangents / side).reshape(-1, 2))
    return PlacedLines(lines, CAMERA, side, tuple(middle.tolist()))


def away(sketch: ds.Sketch, lines: PlacedLines) -> float:
    seen = points_seen(sketch).reshape(-1, 2).numpy()
    there, back = cKDTree(lines.points).query(seen)[0], cKDTree(seen).query(lines.points)[0]
    return float(there.mean() + back.mean()) / 2


def test_the_camera_sees_points_where_it_draws_them_and_slopes_are_derivatives():
    places = torch.tensor([[0.3, -0.2, 0.4], [0.0, 0.0, 0.0]], dtype=torch.float64)
    (points, slope), camera = seen_by(places, CAMERA), CAMERA.resize(200)
    pixels = camera.seen(torch.cat([places, torch.ones(2, 1)], 1).double() @ camera.projection[0].T)[0]
    assert torch.allclose(points * 200, pixels)
    exact = torch.autograd.functional.jacobian(lambda p: seen_by(p[None], CAMERA)[0][0], places[0])
    assert torch.allclose(slope[0], exact)


@pytest.mark.parametrize("name", ["mug", "chair", "house"])
def test_proportions_that_a_drawing_changes_are_followed(name):
    sketch = drawn(name)
    stretched = replace(sketch, points=sketch.points * torch.tensor([1.0, 0.85, 1.2]))
    lines = lines_of(stretched)
    assert away(bend_to(sketch, lines, True).sketch(sketch), lines) < 0.3 * away(sketch, lines)


def test_its_own_lines_leave_it_where_it_is():
    sketch = drawn("house")
    assert float((bend_to(sketch, lines_of(sketch), True).sketch(sketch).points - sketch.points).abs().max()) < 1e-4


def test_both_sides_stay_alike_straight_lines_straight_and_ends_together():
    sketch = drawn("house")
    z = sketch.points[..., 2:]
    wavy = replace(sketch, points=sketch.points + 0.15 * z.square() * torch.tensor([1.0, 1.0, 0.0]))
    bent = bend_to(sketch, lines_of(wavy), True).sketch(sketch)
    assert float((bent.points - sketch.points).abs().max()) > 0.02
    ours, others = (
        cKDTree(s.points.reshape(-1, 3).numpy())
        for s in (bent, replace(bent, points=bent.points * torch.tensor([1.0, -1, 1])))
    )
    assert float(np.abs(ours.query(others.data)[0]).max()) < 1e-5
    # All strokes of this house are straight.
    chord = torch.nn.functional.normalize(bent.points[:, 3:] - bent.points[:, :1], dim=-1)
    offset = bent.points - bent.points[:, :1]
    assert float((offset - (offset * chord).sum(-1, keepdim=True) * chord).abs().max()) < 1e-5
    ends, before = bent.points[:, [0, 3]].reshape(-1, 3), sketch.points[:, [0, 3]].reshape(-1, 3)
    meet = torch.cdist(before, before) < 1e-6
    assert int(meet.sum()) > len(ends)
    assert float(torch.cdist(ends, ends)[meet].max()) < 1e-5


def test_a_bend_takes_points_where_it_takes_the_control_points_of_strokes():
    sketch = drawn("mug")
    bend = bend_to(sketch, lines_of(replace(sketch, points=sketch.points * torch.tensor([1.0, 0.85, 1.2]))), True)
    bent = bend.sketch(sketch)
    assert float((bent.points - sketch.points).abs().max()) > 0.05
    # Ends of strokes are control points, of straight ones too.
    torch.testing.assert_close(bend.places(sketch.points[:, [0, 3]]).float(), bent.points[:, [0, 3]])
