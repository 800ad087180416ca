"""Strokes that are fitted to line drawings: on a ball, whose drawings are circles."""

import numpy as np
import pytest
import torch
from solids import icosphere

import diff3ds as ds
from diff3ds.surfaces.draw import visible_lines
from diff3ds.surfaces.fitted_strokes import fit_strokes
from diff3ds.surfaces.line_drawings import all_around, mean_distances, points_along

# Where on earth a map would have it: positions take more digits than float32 has.
AT = np.array([4e5, 5e6, 100.0])
NOTHING = ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64))


def circles(radius: float) -> ds.Sketch:
    """Three about one centre, of four cubics each."""
    k = 4 / 3 * (2**0.5 - 1)
    quarter = torch.tensor([[1.0, 0], [1, k], [k, 1], [0, 1]], dtype=torch.float64)
    turn = torch.tensor([[0.0, -1], [1, 0]], dtype=torch.float64)
    arcs = [quarter]
    for _ in range(3):
        arcs.append(arcs[-1] @ turn.T)
    flat = torch.nn.functional.pad(torch.stack(arcs), (0, 1))
    points = torch.cat([flat.roll(i, -1) for i in range(3)])
    chains = ds.Chains.of([4, 4, 4], [True, True, True])
    return ds.Sketch(radius * points + torch.from_numpy(AT), chains=chains)


@pytest.fixture(scope="module")
def ball() -> ds.TriangleMesh:
    vertices, faces = icosphere(2)
    return ds.TriangleMesh(vertices + AT, faces)


def missing(sketch: ds.Sketch, mesh: ds.TriangleMesh) -> float:
    """How far the lines of drawings that no fit has seen are from the strokes, in the mean."""
    cameras = all_around(mesh, 5, turn=50)
    found = []
    for view in range(5):
        lines = visible_lines(NOTHING, cameras[view], mesh)[0].strokes(True)
        found.append(mean_distances(points_along(lines, cameras[view]), points_along(sketch, cameras[view]))[0])
    return float(np.mean(found))


def test_strokes_come_to_the_lines_and_held_ones_stay(ball):
    start = circles(0.8)
    told = []
    fitted = fit_strokes(ball, NOTHING, start, 1, lambda done, of: told.append((done, of)))
    assert missing(fitted, ball) < 0.7 * missing(start, ball)
    stroke = start.chains.stroke
    assert torch.equal(fitted.points[stroke == 0], start.points[stroke == 0])
    # On the surface, where drawings alone would have them grow out of it.
    t = torch.linspace(0, 1, 9, dtype=torch.float64)
    radius = (ds.bezier.evaluate(fitted.points, fitted.weights, t) - torch.from_numpy(AT)).norm(dim=-1)[stroke > 0]
    assert float((radius - 1).abs().max()) < 0.03
    assert told[-1] == (len(told), len(told))
    # Closed strokes stay closed, and smooth where they were.
    ends, starts = start.chains.joints
    assert torch.equal(fitted.points[starts, 0], fitted.points[ends, -1])
    points = fitted.points
    before, after = points[ends, -1] - points[ends, -2], points[starts, 1] - points[starts, 0]
    cosine = torch.nn.functional.cosine_similarity(before, after, dim=-1)
    assert float(cosine.min()) > 1 - 1e-4


def test_distances_between_lines_are_what_they_are():
    cameras = ds.orbit(0.0, 90.0, 5.0, fov=None, height=2.0, size=100).to(torch.float64)

    def line(y: float, length: float) -> ds.Sketch:
        return ds.Sketch(torch.tensor([[[0.0, y, 0], [length, y, 0]]], dtype=torch.float64))

    one, other = (points_along(line(y, length), cameras) for y, length in ((0.0, 0.5), (0.1, 0.5)))
    assert mean_distances(one, other) == pytest.approx((5.0, 5.0))
    assert mean_distances(points_along(NOTHING, cameras), one) == (0.0, float("inf"))
