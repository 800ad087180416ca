"""Ends of curves that were placed one by one, brought together where they meet."""

from dataclasses import replace

import numpy as np
import torch
from edge_scenes import circular_arc, lines_between, whole

from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import fit_circle
from diff3ds.edges.measure.vertices import met

X, Y, Z = np.eye(3)


def joined_at(curves: Curves, *vertices: tuple[int, int]) -> Curves:
    """The curves with these vertices."""
    return replace(curves, vertex=torch.tensor(vertices))


def corner(*off: float) -> Curves:
    """Three edges of a cube, each beside its place by so much."""
    a, b, c = off
    return lines_between((a * Y, X + a * Y), (b * Z, Y + b * Z), (c * X, Z + c * X))


def test_three_lines_meet_where_they_are_nearest():
    curves = joined_at(corner(0.003, -0.002, 0.004), (0, 1), (0, 2), (0, 3))
    old = joined_at(corner(0, 0, 0), (0, 1), (0, 2), (0, 3)).points.double().numpy()
    better = met(curves, old, np.ones(3, bool), 0.01)
    # Each axis is asked for by two lines: one off, one through zero.
    np.testing.assert_allclose(better.points[:, 0].numpy(), [[0.002, 0.0015, -0.001]] * 3, rtol=0, atol=1e-5)
    np.testing.assert_allclose(better.points[:, 3], curves.points[:, 3], rtol=0, atol=1e-5)


def test_curves_that_were_not_placed_follow():
    curves = joined_at(corner(0.003, -0.002, 0.004), (0, 1), (0, 2), (0, 3))
    old = joined_at(corner(0, 0, 0), (0, 1), (0, 2), (0, 3)).points.double().numpy()
    better = met(curves, old, np.array([True, False, False]), 0.01)
    # Along the line that was placed, nothing says to move.
    np.testing.assert_allclose(better.points[:, 0].numpy(), [[0.0, 0.003, 0.0]] * 3, rtol=0, atol=1e-5)


def test_what_would_move_far_stays_together():
    curves = joined_at(corner(0.03, -0.02, 0.04), (0, 1), (0, 2), (0, 3))
    old = joined_at(corner(0, 0, 0), (0, 1), (0, 2), (0, 3)).points.double().numpy()
    better = met(curves, old, np.ones(3, bool), 0.01)
    np.testing.assert_allclose(better.points[:, 0], np.zeros((3, 3)), rtol=0, atol=1e-7)


def test_an_arc_stays_on_its_circle_where_a_line_goes_on():
    bow = curves_of([circular_arc(np.zeros(3), X, Y, 0, 2.2)])
    line = lines_between((X + 0.02 * Y, X - Y))
    curves = joined_at(concatenated(bow, line), (0, 1), (0, 2))
    old = curves.constrained(curves.points)[0].double().numpy()
    better = met(curves, old, np.ones(2, bool), 0.02)
    circle = fit_circle(sampled(better)[0])
    # The ends are off by the square of the angle between them, half each.
    assert abs(circle.radius - 1) < 2e-3
    assert np.linalg.norm(circle.center) < 2e-3
    _, weights = better.constrained(better.points)
    assert weights[0, 1] < 0.9


def test_whole_circles_are_left_alone():
    curves = curves_of([whole(np.zeros(3), X, Y)])
    assert torch.equal(met(curves, curves.points.double().numpy(), np.ones(1, bool), 0.01).points, curves.points)
