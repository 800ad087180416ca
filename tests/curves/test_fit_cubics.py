"""Cubics through points: what points were taken of is found again, within the tolerance, smooth but at corners."""

import math

import numpy as np
import pytest

from diff3ds.bezier.curves import bernstein
from diff3ds.curves.directions import turns
from diff3ds.curves.fit_cubics import fit_outline, fit_outlines, fit_points, fit_rows, is_straight, through_points


def dense(cubics):
    return (bernstein(np.linspace(0, 1, 200), 3) @ cubics).reshape(-1, cubics.shape[-1])


def away(points, cubics):
    """Of each point from the cubics."""
    return np.linalg.norm(dense(cubics)[None] - points[:, None], axis=-1).min(1)


@pytest.mark.parametrize("dimension", [2, 3])
def test_points_of_a_cubic_give_that_cubic(dimension):
    control = np.array([[0.0, 0, 0], [1, 1, 0.5], [2, 1.2, 1.5], [3, 0.5, 2]])[:, :dimension]
    points = bernstein(np.linspace(0, 1, 80), 3) @ control
    found = fit_rows(points, np.array([0]), np.array([79]), 0.02)
    assert len(found.control) == 1
    assert away(points, found.control).max() < 0.022
    one, distances = fit_points(points)
    assert distances.max() < 0.02
    assert np.abs(dense(one[None])[[0, -1]] - control[[0, 3]]).max() < 0.05


def wave(count=300):
    t = np.linspace(0, 4 * math.pi, count)
    return np.stack([10 * t, 30 * np.sin(t), 20 * np.cos(t)], 1)


@pytest.mark.parametrize("tolerance", [0.02, 0.2, 2.0])
def test_rows_keep_the_tolerance_and_say_where_each_point_lies(tolerance):
    points = np.concatenate([wave(), wave()[::-1] + 100])
    found = fit_rows(points, np.array([0, 300]), np.array([299, 599]), tolerance)
    assert (found.start[1:] >= found.stop[:-1]).all()
    assert set(found.start[found.start % 300 == 0]) == {0, 300}
    for control, start, stop in zip(found.control, found.start, found.stop, strict=True):
        inside = np.arange(start + 1, stop)
        there = bernstein(found.t[inside], 3) @ control
        assert np.linalg.norm(there - points[inside], axis=1).max(initial=0) <= tolerance
        assert np.allclose(control[[0, 3]], points[[start, stop]], rtol=0, atol=1e-12)
    half = fit_rows(points, np.array([0, 300]), np.array([299, 599]), tolerance / 2)
    assert len(half.control) >= len(found.control)


@pytest.mark.parametrize("columns", [[0, 1], [0, 1, 2]])
def test_an_outline_is_smooth_at_its_joints(columns):
    points = wave()[:, columns]
    cubics = fit_outline(points, 0.05)
    assert 4 < len(cubics) < 40
    assert away(points, cubics).max() < 0.5
    assert np.array_equal(cubics[1:, 0], cubics[:-1, 3])
    assert turns(cubics[:-1, 3] - cubics[:-1, 2], cubics[1:, 1] - cubics[1:, 0]).max() < 1e-6


def test_a_circle_closes_smoothly_and_a_drop_at_its_corner():
    t = np.linspace(0, 2 * math.pi, 100)[:-1]
    ring = 50 * np.stack([np.cos(t), np.sin(t)], 1)
    cubics = fit_outline(ring, 0.05, closed=True)
    assert np.abs(np.linalg.norm(dense(cubics), axis=1) - 50).max() < 0.1
    joints = turns(cubics[:, 3] - cubics[:, 2], np.roll(cubics[:, 1] - cubics[:, 0], -1, axis=0))
    assert joints.max() < 1e-6
    drop = np.stack([np.sin(t / 2) * np.cos(t / 2), np.sin(t / 2)], 1) * 50
    # Begun anywhere, it is cut at its corner alone.
    cubics = fit_outline(np.roll(drop, 30, axis=0), 0.05, closed=True)
    joints = turns(cubics[:, 3] - cubics[:, 2], np.roll(cubics[:, 1] - cubics[:, 0], -1, axis=0))
    assert (joints > 0.6).sum() == 1
    assert np.abs(cubics[joints.argmax(), 3]).max() < 1e-9


def test_corners_and_straight_lines_stay():
    square = np.array([[0.0, 0], [5, 0], [10, 0], [10, 10], [0, 10]])
    cubics = fit_outline(square, 0.05, closed=True)
    assert [is_straight(c) for c in cubics] == [True] * 4
    assert {tuple(p) for p in cubics[:, 0].tolist()} == {(0, 0), (10, 0), (10, 10), (0, 10)}
    bent = fit_outline(square, 0.05, closed=True, corner=3.0)
    assert not all(is_straight(c) for c in bent)


def test_cubics_go_through_all_points_smoothly_but_at_corners():
    t = np.linspace(0, 2 * math.pi, 60)[:-1]
    ring = 50 * np.stack([np.cos(t), np.sin(t)], 1)
    line = np.array([[0.0, 0], [99, 0], [100, 0], [100.2, 0.02], [100.4, 0.06], [100.4, 60]])
    around, along, none = through_points([ring, line, line[:1]], [True, False, False])
    # Of 59 parts each is off by the fourth power of its angle.
    assert np.abs(np.linalg.norm(dense(around), axis=1) - 50).max() < 0.01
    assert np.array_equal(around[:, 3], np.roll(around[:, 0], -1, axis=0))
    joints = turns(around[:, 3] - around[:, 2], np.roll(around[:, 1] - around[:, 0], -1, axis=0))
    assert joints.max() < 1e-6
    # Long lines stay straight beside short steps, and corners are corners.
    assert np.abs(dense(along[:1])[:, 1]).max() < 1e-9
    assert np.abs(dense(along[-1:])[:, 0] - 100.4).max() < 1e-9
    assert none.shape == (0, 4, 2)


def test_few_or_no_points():
    assert fit_outline(np.zeros((0, 2)), 0.1).shape == (0, 4, 2)
    assert fit_outline(np.zeros((3, 2)), 0.1).shape == (0, 4, 2)
    two = fit_outline(np.array([[0.0, 0], [3, 4]]), 0.1)
    assert is_straight(two[0])
    assert len(fit_rows(wave(), np.zeros(0, np.int64), np.zeros(0, np.int64), 1.0).control) == 0


def test_outlines_of_many_lines_are_those_of_each():
    t = np.linspace(0, 1, 60)[:, None]
    wave = np.hstack([80 * t, 9 * np.sin(11 * t)])
    ring = 20 * np.hstack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)])[:-1]
    square = np.array([[0.0, 0], [5, 0], [9, 0], [9, 9], [0, 9]])
    outlines, closed = [wave, np.zeros((3, 2)), ring, square, wave[::-7]], [False, False, True, True, False]
    for one, points, loop in zip(fit_outlines(outlines, closed, 0.05), outlines, closed, strict=True):
        np.testing.assert_array_equal(one, fit_outline(points, 0.05, loop))
    assert fit_outlines([], [], 0.05) == []
