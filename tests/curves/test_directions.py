"""Angles between directions: in closed form, down to the smallest, in two and three dimensions."""

import math

import numpy as np
import pytest

from diff3ds.curves.directions import dot, turns, unit


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 0.5, math.pi / 2, 3.0, math.pi - 1e-9, math.pi])
@pytest.mark.parametrize("size", [1e-20, 1.0, 1e20])
def test_a_turn_is_the_angle_between_two_directions(angle, size):
    before, after = np.array([3.0, 0.0]), size * np.array([math.cos(angle), math.sin(angle)])
    assert turns(before, after) == pytest.approx(angle, abs=1e-15, rel=1e-12)
    space = np.array([[1.0, 2.0, 2.0], [2.0, 1.0, -2.0]]) / 3
    assert turns(before @ space, after @ space) == pytest.approx(angle, abs=1e-15, rel=1e-7)


@pytest.mark.parametrize("size", [2, 3, 4])
def test_unit_vectors_and_products_are_the_same_in_any_layout(size):
    vectors = np.random.default_rng(size).normal(size=(5, 7, size))
    rows = np.moveaxis(np.ascontiguousarray(np.moveaxis(vectors, -1, 0)), 0, -1)
    assert np.array_equal(unit(vectors), unit(rows))
    assert np.linalg.norm(unit(vectors), axis=-1) == pytest.approx(np.ones((5, 7)), rel=1e-11)
    assert dot(rows, vectors[:1]) == pytest.approx(np.einsum("abk,bk->ab", vectors, vectors[0]), rel=1e-12)


def test_no_direction_goes_on_in_none():
    nothing, one = np.zeros((2, 3)), np.array([[0.0, 0, 0], [1, 0, 0]])
    assert turns(nothing, one).tolist() == [math.pi / 2] * 2
    assert unit(one).tolist() == [[0, 0, 0], [pytest.approx(1), 0, 0]]
