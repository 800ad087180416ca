"""Ellipses fitted to points of exact ones, told apart from all else, joined from pieces, and kept by their curves."""

import math
from itertools import pairwise

import numpy as np
import pytest
import torch
from edge_scenes import arc, circular_arc, lines_between, segment, turned
from hypothesis import given
from hypothesis import strategies as st

import diff3ds as ds
from diff3ds.bezier.curves import bernstein
from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of, sampled
from diff3ds.curves.shapes.ellipses import fit_ellipse, fit_elliptic_arcs
from diff3ds.curves.shapes.primitives import POINT_SCATTER, Kind, Primitive, arc_control
from diff3ds.curves.shapes.simplest import simplest
from diff3ds.curves.shapes.straight_lines import resampled
from diff3ds.edges.clean.simplify import joined
from diff3ds.edges.first.segment import segmented

CENTER, (U, V, N) = np.array([0.3, -0.2, 0.5]), turned().T
T = torch.linspace(0, 1, 41, dtype=torch.float64)


def elliptic(a, b, sweep, start=0.0, scatter=0.0, seed=0):
    """Points a pixel apart along an arc in pixels, its sweep in degrees of the eccentric angle."""
    points = resampled(arc(CENTER, a * U, b * V, start, start + math.radians(sweep), 4000), 1.0)
    return points + scatter / math.sqrt(3) * np.random.default_rng(seed).normal(size=points.shape)


def drawn(primitives):
    """Points of the rational curves, in double precision."""
    curves = curves_of(primitives)
    points = torch.tensor(np.stack([p.control for p in primitives]))
    return ds.bezier.evaluate(*curves.segments(points), T).numpy()


def implicit(points, a, b):
    """(x / a)² + (y / b)² - 1, and the distance from the plane."""
    flat = points - CENTER
    return (flat @ U / a) ** 2 + (flat @ V / b) ** 2 - 1, flat @ N


@pytest.mark.slow
@given(
    st.floats(40, 200),
    st.floats(0.3, 0.85),
    st.one_of(st.floats(190, 199), st.floats(201, 319), st.floats(321, 359)),
    st.floats(0, 6.3),
    st.booleans(),
)
def test_arcs_are_exact(a, ratio, sweep, start, turned_round):
    b = ratio * a
    angle = math.radians(-sweep if turned_round else sweep)
    points = arc(CENTER, a * U, b * V, start, start + angle, 200)
    fitted = fit_ellipse(points, 1.0)
    np.testing.assert_allclose(fitted.center, CENTER, rtol=0, atol=1e-9 * a)
    np.testing.assert_allclose([np.linalg.norm(fitted.u), np.linalg.norm(fitted.v)], [a, b], rtol=1e-9)
    assert max(abs(fitted.u @ fitted.v), abs(fitted.u @ V) * a, abs(fitted.u @ N) * a) < 1e-6 * a * a
    assert fitted.distances.max() < 1e-9 * a
    arcs = fit_elliptic_arcs(points, 1.0)
    expected = [Kind.ELLIPSE] if sweep > 320 else [Kind.ELLIPTIC_ARC] * (1 if sweep <= 200 else 2)
    assert [s.kind for s in arcs] == expected
    on = drawn(arcs)
    for value in implicit(on, a, b):
        assert np.abs(value).max() < 1e-9 * a
    # From the first point to the last, the way the points go; what is almost an ellipse becomes one.
    np.testing.assert_allclose(on[0, 0], points[0], rtol=0, atol=1e-9 * a)
    np.testing.assert_allclose(on[-1, -1], points[0 if sweep > 320 else -1], rtol=0, atol=1e-9 * a)
    if sweep < 320:
        middle = CENTER + arc(0 * CENTER, a * U, b * V, *(start + angle * np.array([0.5, 1]) / len(arcs)), 2)[0]
        np.testing.assert_allclose(on[0, 20], middle, rtol=0, atol=1e-8 * a)


@pytest.mark.parametrize("sweep", [30, 90, 180, 215])
def test_the_control_points_are_those_of_the_conic(sweep):
    """The same curve as the quadratics of `diff3ds.bezier.ellipse`, which are exact by themselves."""
    control = arc_control(CENTER, 3 * U, 2 * V, 0.4, 0.4 + math.radians(sweep))
    on = drawn([Primitive(Kind.ELLIPTIC_ARC, control, np.zeros(0))])[0]
    start = math.degrees(0.4)
    center, u, v = (torch.from_numpy(x) for x in (CENTER, 3 * U, 2 * V))
    exact = ds.bezier.evaluate(*ds.bezier.ellipse(center, u, v, start, start + sweep), T).numpy()
    np.testing.assert_allclose(on[[0, 40]], [exact[0, 0], exact[-1, -1]], rtol=0, atol=1e-12)
    for points in (on, exact):
        for value in implicit(points, 3, 2):
            assert np.abs(value).max() < 1e-12


@pytest.mark.parametrize(
    ("a", "b", "sweep"), [(30, 18, 180), (30, 18, 240), (15, 10, 240), (60, 20, 180), (150, 90, 120), (60, 20, 360)]
)
def test_scattered_points_give_the_axes_and_the_centre(a, b, sweep):
    """Of 20 arcs from anywhere on the ellipse; those that are refused are not determined to 5 %."""
    errors = []
    for seed in range(20):
        fitted = fit_ellipse(elliptic(a, b, sweep, 0.314 * seed, POINT_SCATTER, seed), 1.0)
        if fitted is not None:
            axes = np.linalg.norm(fitted.u) / a - 1, np.linalg.norm(fitted.v) / b - 1
            errors.append([*axes, *(fitted.center - CENTER) / a])
    assert len(errors) >= 15
    assert np.abs(errors).max() < 0.08
    # A fit of algebraic distances alone comes out 2 % short at half an ellipse.
    assert np.abs(np.mean(errors, axis=0)).max() < 0.015


@pytest.mark.parametrize("sweep", [60, 120, 200, 350])
@pytest.mark.parametrize("scatter", [0.0, 0.2])
def test_circles_stay_circles(sweep, scatter):
    for seed in range(5):
        points = elliptic(30, 30, sweep, seed, scatter, seed)
        assert fit_elliptic_arcs(points, 1.0) == []
        assert {s.kind for s in simplest(points, 1.0)} == {Kind.CIRCLE if sweep > 320 else Kind.ARC}
    # Nor is a circle that is measured 3 % too wide an ellipse.
    assert fit_elliptic_arcs(elliptic(30.9, 30, sweep), 1.0) == []


def test_lines_stay_lines():
    line = segment((0, 0, 0), (60, 20, 10), 64)
    for scatter in (0.0, 0.3):
        points = line + scatter / math.sqrt(3) * np.random.default_rng(0).normal(size=line.shape)
        assert fit_elliptic_arcs(points, 1.0) == []
        assert [s.kind for s in simplest(points, 1.0)] == [Kind.LINE]


T_ALL = np.linspace(-1, 1, 400)
NONE_OF_THEM = {
    "parabola": np.stack([40 * T_ALL, 40 * T_ALL**2, 0 * T_ALL], 1),
    "hyperbola": np.stack([30 * np.sinh(1.2 * T_ALL), 20 * np.cosh(1.2 * T_ALL), 0 * T_ALL], 1),
    "an S": bernstein((T_ALL + 1) / 2, 3) @ np.array([[0, 0, 0], [60, 50, 0], [20, -40, 0], [80, 10, 0.0]]),
    "a hook": bernstein((T_ALL + 1) / 2, 3) @ np.array([[0, 0, 0], [10, 90, 0], [40, 60, 0], [90, 60, 0.0]]),
    "a cubic in space": bernstein((T_ALL + 1) / 2, 3) @ np.array([[0, 0, 0], [10, 60, 0], [60, 60, 40], [70, 0, 40.0]]),
    "helix": np.stack([30 * np.cos(3 * T_ALL), 20 * np.sin(3 * T_ALL), 8 * T_ALL], 1),
    "a quarter of one": elliptic(90, 50, 90),
    "a third of a small one": elliptic(15, 8, 120, scatter=0.1),
    "two sides a pixel apart": elliptic(60, 5, 360),
    "there and back": np.concatenate([elliptic(60, 40, 250), elliptic(60, 40, 250)[::-1]]),
    "a slot": np.concatenate(
        [
            segment((-20, -12, 0), (20, -12, 0), 40),
            arc((20, 0, 0), (12, 0, 0), (0, 12, 0), -math.pi / 2, math.pi / 2, 40),
            segment((20, 12, 0), (-20, 12, 0), 40),
            arc((-20, 0, 0), (12, 0, 0), (0, 12, 0), math.pi / 2, 1.45 * math.pi, 40),
        ]
    ),
}


@pytest.mark.parametrize("name", NONE_OF_THEM)
def test_what_is_no_ellipse(name):
    found = simplest(resampled(NONE_OF_THEM[name], 1.0), 1.0)
    assert found is None or found[0].kind == Kind.FREE


def test_few_and_straight_points_are_no_ellipse():
    line = segment((0, 0, 0), (60, 20, 10), 64)
    assert fit_ellipse(line, 1.0) is None
    assert fit_ellipse(np.concatenate([line, line + np.array([0, 0, 30])]), 1.0) is None
    assert fit_ellipse(elliptic(60, 40, 360)[::60][:5], 1.0) is None


# An arc, a cubic and a ring, apart.
RING = Curves(
    torch.zeros(3, 4, 3), torch.tensor([Kind.ELLIPTIC_ARC, Kind.FREE, Kind.ELLIPSE]), torch.arange(6).reshape(3, 2)
)


def random_points(seed, scale=1.0):
    """Control points in which arcs bulge to one side."""
    generator = torch.Generator().manual_seed(seed)
    points = torch.rand(3, 4, 3, dtype=torch.float64, generator=generator) * 0.3
    points += torch.tensor([[0, 0, 0], [1, 1, 0], [2, 1, 0], [3, 0, 0]], dtype=torch.float64)
    return scale * points


@given(st.integers(0, 10_000), st.floats(0.01, 100))
def test_any_control_points_become_ellipses_and_their_results_stay(seed, scale):
    points = random_points(seed, scale)
    found, weights = RING.constrained(points)
    again, same = RING.constrained(found)
    torch.testing.assert_close(again, found, rtol=0, atol=1e-9 * scale)
    torch.testing.assert_close(same, weights, rtol=0, atol=1e-9)
    for i in (0, 2):
        w = (3 * weights[i, 1] - 1) / 2
        assert -1 < w < 1
        # Raised to a cubic: 3 w1 Q1 = w0 P0 + 2 w P1, and 3 w2 Q2 = 2 w P1 + P2.
        first, second = (3 * weights[i, k] * found[i, k] - found[i, 0 if k == 1 else 3] for k in (1, 2))
        torch.testing.assert_close(first, second, rtol=0, atol=1e-9 * scale)
    # The arc keeps its mean inner point.
    torch.testing.assert_close(found[0, 1:3].mean(0), points[0, 1:3].mean(0), rtol=0, atol=1e-12 * scale)
    # Conjugate half diameters of the ring: half the chord, and from its middle to the farthest point.
    on = ds.bezier.evaluate(*RING.segments(points), T)[2:]
    middle = (on[0, 0] + on[0, 40]) / 2
    u, v = on[0, 0] - middle, on[0, 20] - middle
    x = torch.linalg.lstsq(torch.stack([u, v], 1), (on.reshape(-1, 3) - middle).T).solution
    torch.testing.assert_close(x.square().sum(0), torch.ones(82, dtype=torch.float64), rtol=0, atol=1e-9)
    torch.testing.assert_close(x.T @ torch.stack([u, v]) + middle, on.reshape(-1, 3), rtol=0, atol=1e-9 * scale)
    torch.testing.assert_close(on[0], 2 * middle - on[1], rtol=0, atol=1e-9 * scale)


def test_gradients_are_those_of_finite_differences_and_finite():
    points = random_points(3).requires_grad_()
    assert torch.autograd.gradcheck(RING.constrained, (points,), eps=1e-6, atol=1e-5)
    collapsed = torch.zeros(3, 4, 3, requires_grad=True)
    found, weights = RING.constrained(collapsed)
    (found.square().sum() + weights.sum()).backward()
    assert all(x.isfinite().all() for x in (found, weights, collapsed.grad))


def kinds_of(curves):
    return [Kind(int(k)) for k in curves.kind]


@pytest.mark.parametrize(
    ("a", "b", "cuts"),
    [
        (60, 40, (0, 85, 170, 255, 340)),
        (30, 18, (0, 85, 170, 255, 340)),
        # Half its sides and tips, of which it takes three to say which ellipse it is; the halves meet at a tip.
        (41, 13, (0, 50, 130, 180, 230, 310, 360)),
    ],
)
def test_pieces_all_around_become_one_ellipse(a, b, cuts):
    """Exact arcs, a pixel or two apart."""
    radians = [(math.radians(s) + 1.5 / a, math.radians(t)) for s, t in pairwise(cuts)]
    pieces = [Primitive(Kind.ELLIPTIC_ARC, arc_control(CENTER, a * U, b * V, *cut), np.zeros(0)) for cut in radians]
    curves = joined(curves_of(pieces), 1.0)
    assert kinds_of(curves) == [Kind.ELLIPSE]
    on = sampled(curves, 128).reshape(-1, 3)
    flat, rise = implicit(on, a, b)
    assert np.abs(flat).max() < 0.01
    assert np.abs(rise).max() < 0.01
    angle = np.sort(np.arctan2((on - CENTER) @ V / b, (on - CENTER) @ U / a))
    assert np.diff(angle).max() < 0.1


def test_halves_meet_at_a_tip():
    """Which a narrow ellipse turns by half a right angle over the pixel and a half that is missing there."""
    a, b = 41, 13
    pieces = [
        Primitive(Kind.ELLIPTIC_ARC, arc_control(CENTER, a * U, b * V, s + 1.5 / b, s + math.pi), np.zeros(0))
        for s in (0, math.pi)
    ]
    curves = joined(curves_of(pieces), 1.0)
    assert kinds_of(curves) == [Kind.ELLIPSE]


def test_a_scattered_chain_along_an_ellipse_becomes_one():
    """Lines, arcs and cubics first, as chains are cut; then what they are together."""
    chain = segmented(elliptic(60, 45, 340, 0.5, POINT_SCATTER), 1.0)
    assert len(chain) > 2
    curves = joined(curves_of(chain), 1.0)
    assert kinds_of(curves) == [Kind.ELLIPSE]
    flat, rise = implicit(sampled(curves).reshape(-1, 3), 60, 45)
    # Half of that is the distance as a share of the half axis.
    assert np.abs(flat).max() / 2 < 0.02
    assert np.abs(rise).max() < 0.5


def test_a_slot_and_a_rounded_corner_stay_lines_and_arcs():
    right, left = ((x, s) for x, s in ((20, -math.pi / 2), (-20, math.pi / 2)))
    ends = curves_of([circular_arc((x, 0, 0), (12, 0, 0), (0, 12, 0), s, s + math.pi) for x, s in (right, left)])
    sides = lines_between(((-20, -12, 0), (20, -12, 0)), ((20, 12, 0), (-20, 12, 0)))
    slot = concatenated(ends, sides)
    assert sorted(kinds_of(joined(slot, 1.0))) == [Kind.LINE] * 2 + [Kind.ARC] * 2
    # An ellipse would fit all three parts of this corner, but its sides are straight.
    h, r, length = math.radians(65), 40.0, 14.0
    bow = circular_arc((0, 0, 0), (r, 0, 0), (0, r, 0), -h, h)
    beside = [
        (end, end + length * np.array([-math.sin(h), way * math.cos(h), 0]))
        for end, way in ((bow.control[0], -1), (bow.control[3], 1))
    ]
    corner = concatenated(lines_between(*beside), curves_of([bow]))
    assert sorted(kinds_of(joined(corner, 1.0))) == [Kind.LINE] * 2 + [Kind.ARC]
