"""Lines, arcs and cubics fitted to points of exact ones, their cuts and circles."""

import math
from itertools import pairwise

import numpy as np
import pytest
import torch
from edge_scenes import arc, circular_arc, segment, turned
from hypothesis import given
from hypothesis import strategies as st

import diff3ds as ds
from diff3ds.bezier.curves import bernstein
from diff3ds.curves.shapes.curve_set import curves_of
from diff3ds.curves.shapes.primitives import Kind, arc_control, fit_arcs, fit_circle, fit_cubic, fit_line
from diff3ds.edges.first.circles import find_circles
from diff3ds.edges.first.segment import segmented
from diff3ds.edges.first.triangulate import EdgePoints
from diff3ds.render.backends import available_backends

CENTER, (U, V, N) = np.array([0.3, -0.2, 0.5]), turned().T
T = torch.linspace(0, 1, 41, dtype=torch.float64)


def drawn(primitives):
    """Points of the rational curves, in double precision."""
    curves = curves_of(primitives)
    points = torch.tensor(np.stack([p.control for p in primitives]))
    return ds.bezier.evaluate(*curves.segments(points), T).numpy()


def radii(points, center=CENTER):
    return np.linalg.norm(points - center, axis=-1)


def test_a_line_through_scattered_points():
    rng = np.random.default_rng(0)
    start, stop = np.array([1.0, 2, 3]), np.array([-1.0, 4, 0])
    # Scatter whose mean and slope are zero leaves the line of least squares where it is.
    t = np.linspace(0, 1, 50)
    off = rng.normal(size=(50, 3)) * 0.01
    off -= np.stack([np.ones(50), t], 1) @ np.linalg.lstsq(np.stack([np.ones(50), t], 1), off, rcond=None)[0]
    fitted = fit_line(start + t[:, None] * (stop - start) + off)
    assert fitted.kind == Kind.LINE
    along = (stop - start) / np.linalg.norm(stop - start)
    sideways = (fitted.control - start) - np.outer((fitted.control - start) @ along, along)
    assert np.abs(sideways).max() < 1e-4
    np.testing.assert_allclose(np.diff(fitted.control, axis=0), np.tile((stop - start) / 3, (3, 1)), rtol=0, atol=0.02)
    expected = np.linalg.norm(off - np.outer(off @ along, along), axis=1)
    np.testing.assert_allclose(fitted.distances, expected, rtol=0, atol=1e-4)


@given(
    st.one_of(st.floats(30, 199), st.floats(201, 319), st.floats(321, 350)),
    st.floats(0.01, 10),
    st.floats(0, 6.3),
    st.booleans(),
)
def test_arcs_are_exact(sweep, radius, start, turned_round):
    angle = math.radians(sweep)
    points = arc(CENTER, radius * U, radius * V, start, start + (-angle if turned_round else angle), 60)
    center, u, v, fitted, distances = fit_circle(points)
    np.testing.assert_allclose(center, CENTER, rtol=0, atol=1e-6 * radius)
    assert fitted == pytest.approx(radius, rel=1e-6)
    assert distances.max() < 1e-6 * radius
    assert abs(u @ v) + abs(u @ N) + abs(v @ N) < 1e-6
    arcs = fit_arcs(points)
    assert [a.kind for a in arcs] == ([Kind.CIRCLE] if sweep > 320 else [Kind.ARC] * (1 if sweep <= 200 else 2))
    on = drawn(arcs)
    np.testing.assert_allclose(radii(on), radius, rtol=1e-6)
    assert np.abs((on - CENTER) @ N).max() < 1e-6 * radius
    # From the first point to the last, the way the points go; what is almost a circle becomes one.
    np.testing.assert_allclose(on[0, 0], points[0], rtol=0, atol=1e-5 * radius)
    if sweep < 320:
        middle = points[round(59 / 2 / len(arcs))]
        np.testing.assert_allclose(on[0, 20], middle, rtol=0, atol=0.06 * radius)
        np.testing.assert_allclose(on[-1, -1], points[-1], rtol=0, atol=1e-5 * radius)
    if sweep > 320:
        np.testing.assert_allclose(on[-1, -1], on[0, 0], rtol=0, atol=1e-6 * radius)


@pytest.mark.parametrize("sweep", [1, 90, 180, 200, 239])
def test_the_rational_cubic_is_circular(sweep):
    half = math.radians(sweep) / 2
    control = arc_control(CENTER, 2 * U, 2 * V, -half, half)
    inner = (1 + 2 * math.cos(half)) / 3
    weights = torch.tensor([1, inner, inner, 1], dtype=torch.float64)
    on = ds.bezier.evaluate(torch.from_numpy(control), weights, T).numpy()
    np.testing.assert_allclose(radii(on), 2, rtol=1e-9)
    np.testing.assert_allclose(on[20], CENTER + 2 * U, rtol=0, atol=1e-9)


def test_what_is_no_arc():
    line = segment((0, 0, 0), (1, 2, 3), 30)
    assert fit_arcs(line + 1e-9 * np.random.default_rng(0).normal(size=(30, 3)), 0.01) == []
    flat = arc(CENTER, U, V, 0, 0.2, 30)
    assert len(fit_arcs(flat, 0.004)) == 1
    # Its rise over the chord is 1 - cos 0.1 = 0.005.
    assert fit_arcs(flat, 0.006) == []
    back = np.concatenate([arc(CENTER, U, V, 0, 2, 30), arc(CENTER, U, V, 2, 0.5, 30)])
    assert fit_arcs(back) == []
    assert fit_circle(line[:2]) is None


def test_a_cubic_through_points_of_one():
    control = np.array([[0, 0, 0], [1, 1, 0], [2, 1, 0.5], [3, 0, 1.0]])
    points = bernstein(np.linspace(0, 1, 80), 3) @ control
    fitted = fit_cubic(points)
    assert fitted.kind == Kind.FREE
    # The pull towards even spacing shortens it a little.
    assert fitted.distances[1:-1].max() < 0.02
    assert fitted.distances.max() < 0.05
    np.testing.assert_allclose(fitted.control[[0, 3]], control[[0, 3]], rtol=0, atol=0.05)
    np.testing.assert_allclose(drawn([fitted])[0, [0, -1]], fitted.control[[0, 3]], rtol=0, atol=1e-6)
    t = np.linspace(0, 1, 7)
    np.testing.assert_allclose(bernstein(t, 3).sum(1), 1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(bernstein(t, 3)[:, 1], 3 * t * (1 - t) ** 2, rtol=0, atol=1e-12)


def rounded_corner(radius=10.0, length=30.0, scatter=0.0):
    """An L with a rounded corner, points about one apart: line, quarter circle, line."""
    parts = [
        segment((-length, radius, 0), (0, radius, 0), 31),
        arc((0, 0, 0), (0, radius, 0), (radius, 0, 0), 0, math.pi / 2, 17),
        segment((radius, 0, 0), (radius, -length, 0), 31),
    ]
    points = np.concatenate([parts[0], parts[1][1:], parts[2][1:]])
    return (points + scatter * np.random.default_rng(0).normal(size=points.shape)) @ turned(1).T


@pytest.mark.parametrize("scatter", [0.0, 0.15])
def test_a_rounded_corner_is_cut_into_line_arc_line(scatter):
    strokes = segmented(rounded_corner(scatter=scatter), 1.0)
    assert [s.kind for s in strokes] == [Kind.LINE, Kind.ARC, Kind.LINE]
    on = drawn([strokes[1]])[0]
    # The circle through start, middle and end of the arc; cuts fall on a grid, a point or two from the true ends.
    assert fit_circle(on)[3] == pytest.approx(10, rel=0.1)
    for before, after in pairwise(strokes):
        assert np.linalg.norm(before.control[3] - after.control[0]) < 1.5


@pytest.mark.parametrize(
    ("chain", "kinds"),
    [
        (segment((0, 0, 0), (20, 5, 1), 20), [Kind.LINE]),
        (segment((0, 0, 0), (2, 0, 0), 3), [Kind.LINE]),
        (arc((0, 0, 0), (12, 0, 0), (0, 12, 0), 0, 2, 30), [Kind.ARC]),
        (arc((0, 0, 0), (12, 0, 0), (0, 12, 0), 0, 6, 80), [Kind.CIRCLE]),
        (np.concatenate([segment((0, 0, 0), (25, 0, 0), 26), segment((25, 1, 0), (25, 25, 0), 25)]), [Kind.LINE] * 2),
    ],
    ids=["line", "three points", "arc", "circle", "corner"],
)
def test_chains_become_the_fewest_strokes(chain, kinds):
    assert [s.kind for s in segmented(chain, 1.0)] == kinds


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without the compiled kernels")
def test_the_kernel_cuts_chains_where_numpy_does(monkeypatch):
    rng = np.random.default_rng(0)
    chains = []
    for _ in range(4):
        # The way turns evenly for a while, a little or fast, and at some points it breaks off.
        way, turn, chain = rng.normal(size=3), np.zeros(3), [np.zeros(3)]
        for _ in range(50):
            turn = rng.normal(size=3) * rng.choice([0, 0.05, 0.2]) if rng.random() < 0.06 else turn
            way = rng.normal(size=3) if rng.random() < 0.03 else way + np.cross(turn, way)
            way /= np.linalg.norm(way)
            chain.append(chain[-1] + way)
        chains.append(np.array(chain) + 0.2 * rng.normal(size=(51, 3)))
    found = [segmented(chain, 1.0) for chain in chains]
    monkeypatch.setattr("diff3ds.edges.first.segment.kernels", lambda: None)
    assert {stroke.kind for strokes in found for stroke in strokes} >= {Kind.LINE, Kind.ARC, Kind.FREE}
    for strokes, chain in zip(found, chains, strict=True):
        expected = segmented(chain, 1.0)
        assert [stroke.kind for stroke in strokes] == [stroke.kind for stroke in expected]
        for stroke, other in zip(strokes, expected, strict=True):
            np.testing.assert_array_equal(stroke.control, other.control)


def circle_points(radius=15.0, scatter=0.3, start=0.0, stop=2 * math.pi):
    """Scattered points on a circle and their directions."""
    rng = np.random.default_rng(0)
    t = rng.uniform(start, stop, int(radius * (stop - start)))[:, None]
    points = CENTER + radius * (np.cos(t) * U + np.sin(t) * V) + scatter * rng.normal(size=(len(t), 3))
    return EdgePoints(points, -np.sin(t) * U + np.cos(t) * V, np.ones(len(t)))


def test_an_arc_grows_to_the_circle_of_its_points():
    found = circle_points()
    line = EdgePoints(segment((40, 0, 0), (60, 0, 0), 20), np.tile([1.0, 0, 0], (20, 1)), np.ones(20))
    every = EdgePoints(*(np.concatenate([getattr(p, n) for p in (found, line)]) for n in vars(found)))
    start = circular_arc(CENTER + 0.3 * U, 15.4 * U, 15.4 * V, 0.2, 1.9)
    circles, rest = find_circles(every, [start, fit_line(line.points)], 1.0)
    assert len(circles) == 1
    assert circles[0].kind == Kind.CIRCLE
    on = drawn(circles)
    # 94 points with a scatter of 0.3.
    np.testing.assert_allclose(radii(on), 15, rtol=0, atol=0.15)
    assert np.linalg.norm(on[0, 20] - on[1, 20]) == pytest.approx(30, abs=0.3)
    # What the circle took is gone, all else is left.
    assert len(rest) < 20 + 0.05 * len(found)
    assert np.isin(line.points[:, 0], rest.points[:, 0]).all()


def test_half_a_circle_of_points_is_no_circle():
    found = circle_points(stop=math.pi)
    circles, rest = find_circles(found, [circular_arc(CENTER, 15 * U, 15 * V, 0.2, 1.9)], 1.0)
    assert circles == []
    assert len(rest) == len(found)
