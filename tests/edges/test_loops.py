"""Closed loops of coplanar curves, and which points lie inside."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import lines_between, turned, whole

from diff3ds.curves.shapes.curve_set import curves_of
from diff3ds.edges.complete.loops import find_loops

PIXEL = 0.01
TILT = turned(2)
SQUARE = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def polygon(corners, names):
    """Lines from corner to corner and back to the first, vertices by these names."""
    count = len(corners)
    lines = lines_between(*((corners[k] @ TILT.T, corners[(k + 1) % count] @ TILT.T) for k in range(count)))
    return replace(lines, vertex=torch.tensor([[names[k], names[(k + 1) % count]] for k in range(count)]))


def test_a_square_is_a_loop_and_holds_its_inner_side():
    (loop,) = find_loops(polygon(SQUARE, range(4)), PIXEL)
    assert sorted(loop.members) == [0, 1, 2, 3]
    assert abs(loop.normal @ TILT[:, 2]) == pytest.approx(1, abs=1e-6)
    x = np.random.default_rng(0).uniform(-1, 1, (2000, 3)) * [1, 1, 0]
    assert np.array_equal(loop.holds(x @ TILT.T), (np.abs(x) < 0.5).all(1))


@pytest.mark.parametrize("order", [1, -1])
def test_places_go_around_with_their_inner_side(order):
    (loop,) = find_loops(polygon(SQUARE[::order], range(4)), PIXEL)
    x, tangents, inwards = (v @ TILT for v in loop.sample_points(40))
    assert np.abs(np.abs(x[:, :2]).max(1) - 0.5).max() < 1e-6
    step = np.roll(x, -1, 0) - x
    straight = np.linalg.norm(step, axis=1) > 0.09
    assert straight.sum() == 36
    assert np.allclose(step[straight], 0.1 * tangents[straight], atol=1e-6)
    assert np.allclose((inwards * x).sum(1), -0.5, atol=1e-5)
    assert np.abs((inwards * tangents).sum(1)).max() < 1e-6


def test_a_loop_need_not_be_convex():
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0]]) / 2.0
    (loop,) = find_loops(polygon(corners, range(4)), PIXEL)
    inside = loop.holds(np.array([[0.9, 0.1, 0], [0.9, 0.7, 0], [0.4, 0.4, 0], [0.45, 0.6, 0]]) @ TILT.T)
    assert inside.tolist() == [True, True, False, False]


def test_curves_that_run_the_other_way_make_a_loop_too():
    curves = polygon(SQUARE, range(4))
    points, vertex = curves.points.clone(), curves.vertex.clone()
    points[[0, 2]], vertex[[0, 2]] = points[[0, 2]].flip(1), vertex[[0, 2]].flip(1)
    (loop,) = find_loops(replace(curves, points=points, vertex=vertex), PIXEL)
    assert loop.holds(np.zeros((1, 3))).all()
    assert not loop.holds(np.array([[0.6, 0, 0], [0, -0.6, 0]]) @ TILT.T).any()


def test_a_whole_circle_is_a_loop():
    u, v = TILT[:, 0], TILT[:, 1]
    (loop,) = find_loops(curves_of([whole(0.1 * u, 0.4 * u, 0.4 * v)]), PIXEL)
    assert loop.members == (0,)
    assert loop.holds(np.stack([0.49 * u, -0.29 * u])).all()
    assert not loop.holds(np.stack([0.51 * u, -0.31 * u])).any()


def test_every_face_of_a_box_is_a_loop():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) / 2.0
    edges = [(i, k) for i in range(8) for k in range(i) if bin(i ^ k).count("1") == 1]
    lines = lines_between(*((corners[i], corners[k]) for i, k in edges))
    loops = find_loops(replace(lines, vertex=torch.tensor(edges)), PIXEL)
    assert len(loops) == 6
    assert all(len(loop.members) == 4 for loop in loops)


def test_open_branching_and_twisted_rims_are_none():
    square = polygon(SQUARE, range(4))
    assert find_loops(square[torch.tensor([0, 1, 2])], PIXEL) == []
    twisted = SQUARE + np.outer([0, 0, 1, 0], [0, 0, 0.1])
    assert find_loops(polygon(twisted, range(4)), PIXEL) == []
    corners = np.concatenate([SQUARE, [[0, 0, 0]]])
    lines = lines_between(
        *((corners[i] @ TILT.T, corners[k] @ TILT.T) for i, k in ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4)))
    )
    branching = replace(lines, vertex=torch.tensor([[0, 1], [1, 2], [2, 3], [3, 0], [0, 4]]))
    assert find_loops(branching, PIXEL) == []
    assert find_loops(lines_between(), PIXEL) == []
