"""Curves keep their kinds: straight lines, exact arcs, closed circles, shared vertices, gradients through all of it."""

import math

import numpy as np
import pytest
import torch
from edge_scenes import circular_arc, turned, whole
from hypothesis import given
from hypothesis import strategies as st

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of
from diff3ds.curves.shapes.primitives import Kind, Primitive, line_control

T = torch.linspace(0, 1, 33, dtype=torch.float64)
U, V, _ = turned(5)


def some_curves():
    """A line, an arc and a cubic that share vertices, and a circle."""
    return Curves(
        torch.zeros(4, 4, 3),
        torch.tensor([Kind.LINE, Kind.ARC, Kind.FREE, Kind.CIRCLE]),
        torch.tensor([[0, 1], [1, 2], [2, 0], [3, 4]]),
    )


def random_points(seed, scale=1.0):
    """Control points in which arcs bulge to one side, and ends do not meet."""
    generator = torch.Generator().manual_seed(seed)
    points = torch.rand(4, 4, 3, dtype=torch.float64, generator=generator) * 0.3
    points += torch.tensor([[0, 0, 0], [1, 1, 0], [2, 1, 0], [3, 0, 0]], dtype=torch.float64)
    return scale * points


@given(st.integers(0, 10_000), st.floats(0.01, 100))
def test_constrained_gives_curves_of_the_kinds_and_leaves_its_results_alone(seed, scale):
    curves, points = some_curves(), random_points(seed, scale)
    found, weights = curves.constrained(points)
    again, same = curves.constrained(found)
    torch.testing.assert_close(again, found, rtol=0, atol=1e-6 * scale)
    torch.testing.assert_close(same, weights, rtol=0, atol=1e-6)
    assert (weights > 0).all()
    # Shared vertices are the means of the ends.
    ends = found[:, [0, 3]]
    for vertex in range(5):
        mine = curves.vertex == vertex
        torch.testing.assert_close(ends[mine], points[:, [0, 3]][mine].mean(0).expand(int(mine.sum()), 3))
    segments = curves.segments(points)
    torch.testing.assert_close(segments[0][:4], found, rtol=0, atol=0)
    on = ds.bezier.evaluate(*segments, T)
    # Straight, with even speed.
    torch.testing.assert_close(on[0], torch.lerp(ends[0, 0], ends[0, 1], T[:, None]))
    # A free curve keeps its inner points.
    torch.testing.assert_close(found[2, 1:3], points[2, 1:3], rtol=0, atol=0)
    for i in (1, 3, 4):
        center, radius = circle_through(on[i, 0], on[i, 13], on[i, 32])
        torch.testing.assert_close((on[i] - center).norm(dim=1), radius.expand(33), rtol=1e-5, atol=0)
    # Both halves on one circle, whose diameter is their chord, opposite each other.
    torch.testing.assert_close(on[3, 16] + on[4, 16], on[3, 0] + on[3, 32], rtol=0, atol=1e-6 * scale)
    chord = (on[3, 32] - on[3, 0]).norm()
    torch.testing.assert_close((on[3, 16] - on[4, 16]).norm(), chord, rtol=1e-6, atol=0)
    torch.testing.assert_close(on[3, 0], on[4, 32], rtol=0, atol=1e-12 * scale)


def circle_through(a, b, c):
    """Centre and radius of the circle through three points."""
    p, q = b - a, c - a
    n = torch.linalg.cross(p, q)
    toward = torch.linalg.cross((p @ p) * q - (q @ q) * p, n) / (2 * n @ n)
    toward = -toward if (a + toward - b).norm().sub(toward.norm()).abs() > 1e-3 * toward.norm() else toward
    return a + toward, toward.norm()


@pytest.mark.parametrize("sweep", [1, 30, 90, 180, 200, 235])
def test_an_arc_keeps_its_radius_and_sweep(sweep):
    half = math.radians(sweep) / 2
    exact = circular_arc((1, 2, 3), 2 * U, 2 * V, -half, half)
    curves = curves_of([exact])
    points, weights = curves.constrained(torch.from_numpy(exact.control)[None])
    np.testing.assert_allclose(points[0].numpy(), exact.control, rtol=0, atol=1e-7)
    on = ds.bezier.evaluate(points, weights, T)[0].numpy()
    np.testing.assert_allclose(np.linalg.norm(on - [1, 2, 3], axis=1), 2, rtol=1e-6)


def test_gradients_are_those_of_finite_differences():
    curves = some_curves()
    points = random_points(7).requires_grad_()
    assert torch.autograd.gradcheck(curves.constrained, (points,), eps=1e-6, atol=1e-5)


@pytest.mark.parametrize("points", [torch.zeros(4, 4, 3), torch.tensor([0, 1, 2, 3.0])[None, :, None].expand(4, 4, 3)])
def test_gradients_of_collapsed_and_of_straight_curves_are_finite(points):
    points = points.clone().requires_grad_()
    found, weights = some_curves().constrained(points)
    (found.square().sum() + weights.sum()).backward()
    assert found.isfinite().all()
    assert weights.isfinite().all()
    assert points.grad.isfinite().all()


def test_curves_of_primitives():
    line = Primitive(Kind.LINE, line_control(np.zeros(3), np.ones(3)), np.zeros(0))
    curves = curves_of([line, circular_arc((0, 0, 0), U, V, 0, math.pi), whole((0, 0, 0), U, V)])
    assert curves.kind.tolist() == [Kind.LINE, Kind.ARC, Kind.CIRCLE]
    assert curves.closed.tolist() == [False, False, True]
    assert len(curves.vertex.unique()) == 6
    np.testing.assert_allclose(np.linalg.norm(curves.at(T.float())[1:].numpy(), axis=2), 1, rtol=1e-5)
    assert len(curves_of([])) == 0
    assert curves_of([]).at(T.float()).shape == (0, 33, 3)
    assert curves_of([]).segments(curves_of([]).points)[0].shape == (0, 4, 3)


@pytest.mark.parametrize(("kind", "b"), [(Kind.CIRCLE, 1.0), (Kind.ELLIPSE, 0.6)])
def test_a_closed_curve_is_one_and_goes_all_around(kind, b):
    center = np.array([1.0, 2, 3])
    curves = concatenated(curves_of([circular_arc(center, U, V, 0, 1)]), curves_of([whole(center, U, b * V, kind)]))
    on = (curves.at(T.float())[1].numpy() - center) @ np.stack([U, V / b], 1)
    np.testing.assert_allclose(np.linalg.norm(on, axis=1), 1, rtol=1e-5)
    # The middle lies opposite the seam, and the way there is the way back, reflected.
    np.testing.assert_allclose(on[[0, 16, 32]], [[1, 0], [-1, 0], [1, 0]], rtol=0, atol=1e-5)
    np.testing.assert_allclose(on[:16] + on[16:32], 0, rtol=0, atol=1e-5)
    assert (on[1:16, 1] > 0).all()
    # It is drawn by two segments, side by side.
    assert curves.owner.tolist() == [0, 1, 1]
    points, weights = curves.segments(curves.points)
    assert len(points) == 3
    both = ds.bezier.evaluate(points[1:], weights[1:], T.float()).numpy()
    expected = np.insert(curves.at(T.float())[1].numpy(), 16, center - U, axis=0)
    np.testing.assert_allclose(both[:, ::2].reshape(-1, 3), expected, rtol=0, atol=1e-5)


def test_circles_are_known_by_their_numbers():
    center = np.array([0.1, -0.2, 0.3])
    line = Primitive(Kind.LINE, line_control(np.zeros(3), np.ones(3)), np.zeros(0))
    curves = curves_of([line, whole(center, 0.5 * U, 0.5 * V), whole(center, U, 0.5 * V, Kind.ELLIPSE)])
    ((row, circle),) = curves.circles.items()
    assert row == 1
    np.testing.assert_allclose(circle.center, center, rtol=0, atol=1e-6)
    np.testing.assert_allclose([circle.u, circle.v], [U, V], rtol=0, atol=1e-6)
    assert circle.radius == pytest.approx(0.5, abs=1e-6)
    assert lines_only(curves).circles == {}


def lines_only(curves):
    return curves[curves.kind == Kind.LINE]


def test_some_of_the_curves():
    curves = some_curves()
    assert curves[torch.tensor([0, 3])].kind.tolist() == [Kind.LINE, Kind.CIRCLE]
    assert curves[curves.closed].vertex.tolist() == [[3, 4]]
    assert curves[torch.tensor([2])].vertex.tolist() == [[2, 0]]


def test_moved_curves_and_their_segments():
    curves = some_curves().moved(random_points(1).float())
    torch.testing.assert_close(curves.constrained(curves.points)[0], curves.points, rtol=0, atol=1e-5)
    points, weights = curves.segments(curves.points)
    torch.testing.assert_close(points[:4], curves.points, rtol=0, atol=1e-5)
    assert (weights[[0, 2]] == 1).all()
    t = torch.linspace(0, 1, 9)
    torch.testing.assert_close(curves.at(t)[:3], ds.bezier.evaluate(points, weights, t)[:3])
