"""Arc length, tessellation and bounding boxes against closed forms and dense sampling."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff3ds import bezier

TOLERANCES = [1e-2, 1e-4, 1e-6, 1e-9]
degrees = st.sampled_from([1, 2, 3])
seeds = st.integers(0, 10**6)


def _curves(seed: int, degree: int, spread: float, count: int = 4):
    generator = torch.Generator().manual_seed(seed)
    points = torch.randn(count, degree + 1, 3, generator=generator, dtype=torch.float64)
    return points, 10 ** (spread * (2 * torch.rand(count, degree + 1, generator=generator, dtype=torch.float64) - 1))


def _dense(points, weights, count: int = 4001):
    """Points even in the log odds of t and in t: nothing is overlooked for weights from 1e-3 to 1e3."""
    t = torch.cat([torch.linspace(-20, 20, count).double().sigmoid(), torch.linspace(0, 1, count).double()])
    return bezier.evaluate(points, weights, t.sort().values)


@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("angle", [1.0, 90.0, 359.0])
def test_length_of_an_arc(tolerance, angle):
    total = bezier.length(*bezier.circle((1.0, 2.0, 3.0), 5.0, (1.0, 1.0, 1.0), stop=angle), tolerance).sum()
    assert abs(total - math.radians(angle) * 5) <= tolerance * 4


@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("end", [0.1, 1.0, 30.0])
def test_length_of_a_parabola(tolerance, end):
    """Of y = s² from 0: s sqrt(1 + 4 s²) / 2 + asinh(2 s) / 4."""
    found = bezier.length(*bezier.parabola((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), 0.0, end), tolerance)
    assert abs(found - (end * math.hypot(1, 2 * end) / 2 + math.asinh(2 * end) / 4)) <= tolerance


@given(seeds, st.floats(0, 3))
def test_length_of_a_line_does_not_depend_on_its_weights(seed, spread):
    points, weights = _curves(seed, 1, spread)
    expected = torch.linalg.vector_norm(points[:, 1] - points[:, 0], dim=-1)
    torch.testing.assert_close(bezier.length(points, weights, 1e-9), expected, rtol=0, atol=1e-9)
    raised = bezier.elevate(points, weights)
    torch.testing.assert_close(bezier.length(*raised, 1e-9), expected, rtol=0, atol=1e-9)


@pytest.mark.slow
@given(seeds, degrees)
def test_length_is_that_of_fine_polylines(seed, degree):
    points, weights = _curves(seed, degree, 1)
    p = _dense(points, weights, 20001)
    polyline = torch.linalg.vector_norm(p[:, 1:] - p[:, :-1], dim=-1).sum(-1)
    # A polyline of n chords is too short by at most some 1 / n² of the length times the square of the turning.
    torch.testing.assert_close(bezier.length(points, weights, 1e-8), polyline, rtol=1e-6, atol=1e-7)


def test_length_of_curves_that_stand_still():
    points = torch.tensor([[[0.0, 0], [1, 1], [0, 1], [1, 0]], [[2, 2]] * 4], dtype=torch.float64)
    points = points.clone().requires_grad_()
    found = bezier.length(points, None, 1e-7)
    (gradient,) = torch.autograd.grad(found.sum(), points)
    assert found[1] == 0
    assert bool(gradient.isfinite().all())


def test_length_is_differentiable():
    points, weights = (v.requires_grad_() for v in _curves(0, 3, 0.5, count=2))
    assert torch.autograd.gradcheck(lambda p, w: bezier.length(p, w, 1e-10), (points, weights))


def test_length_of_a_scaled_curve_scales(generator):
    points = torch.randn(3, 4, 3, generator=generator, dtype=torch.float64)
    torch.testing.assert_close(bezier.length(1e3 * points, None, 1e-6), 1e3 * bezier.length(points, None, 1e-9))
    assert bezier.length(points.float()).dtype == torch.float32
    assert bezier.length(points.reshape(3, 1, 4, 3)).shape == (3, 1)


@given(seeds, degrees, st.sampled_from([0, 1, 3]), st.sampled_from([1e-1, 1e-2, 1e-4]))
def test_tessellation_stays_within_the_tolerance(seed, degree, spread, tolerance):
    points, weights = _curves(seed, degree, spread, count=2)
    for (t, vertices), curve in zip(
        bezier.tessellate(points, weights, tolerance), _dense(points, weights, 301), strict=True
    ):
        assert t[0] == 0
        assert t[-1] == 1
        assert bool((t[1:] > t[:-1]).all())
        start, chord = vertices[:-1], vertices[1:] - vertices[:-1]
        along = ((curve[:, None] - start) * chord).sum(-1) / chord.square().sum(-1).clamp_min(1e-300)
        foot = start + along.clamp(0, 1)[..., None] * chord
        assert torch.linalg.vector_norm(curve[:, None] - foot, dim=-1).amin(1).max() <= tolerance * (1 + 1e-9)


def test_tessellation_has_its_vertices_on_the_curve(generator):
    points, weights = _curves(3, 3, 1)
    for i, (t, vertices) in enumerate(bezier.tessellate(points, weights, 1e-3)):
        torch.testing.assert_close(vertices, bezier.evaluate(points[i], weights[i], t), rtol=0, atol=1e-14)


def test_tessellation_is_not_wasteful():
    """A chord of angle a lies 1 - cos(a / 2) inside a unit circle; halving wastes at most a factor of 2, the hull 2."""
    (t, _), *_ = bezier.tessellate(*bezier.circle((0.0, 0.0, 0.0), 1.0, stop=90.0), 1e-4)
    needed = math.radians(90) / (2 * math.acos(1 - 1e-4))
    assert needed <= len(t) - 1 <= 4 * needed


def test_lines_and_points_are_one_chord():
    lines = torch.tensor([[[0.0, 0, 0], [1, 2, 3]], [[1, 1, 1], [1, 1, 1]]], dtype=torch.float64)
    for t, _ in bezier.tessellate(lines, None, 1e-6):
        assert t.tolist() == [0, 1]
    assert bezier.tessellate(torch.zeros(0, 4, 3), None, 1e-3) == []


@given(seeds, degrees, st.sampled_from([0, 1, 3]))
def test_box_contains_the_curve_and_touches_it(seed, degree, spread):
    points, weights = _curves(seed, degree, spread)
    low, high = bezier.bounding_box(points, weights)
    p = _dense(points, weights, 2001)
    assert bool((p >= low[:, None] - 1e-13).all())
    assert bool((p <= high[:, None] + 1e-13).all())
    # 2,000 samples over 40 units of log odds come within (0.01)² of an extreme.
    torch.testing.assert_close(low, p.amin(1), rtol=0, atol=1e-4)
    torch.testing.assert_close(high, p.amax(1), rtol=0, atol=1e-4)


def test_box_of_an_arc():
    points, weights = bezier.ellipse((1.0, 2.0), (3.0, 0.0), (0.0, 0.5), 45.0, 135.0)
    low, high = bezier.bounding_box(points, weights)
    r = math.sqrt(0.5)
    torch.testing.assert_close(low, torch.tensor([[1 - 3 * r, 2 + 0.5 * r]], dtype=torch.float64))
    torch.testing.assert_close(high, torch.tensor([[1 + 3 * r, 2.5]], dtype=torch.float64))


def test_box_is_differentiable(generator):
    points, weights = (v.requires_grad_() for v in _curves(1, 3, 0.5, count=2))
    assert torch.autograd.gradcheck(lambda p, w: bezier.bounding_box(p, w), (points, weights))


@pytest.mark.parametrize("tolerance", [0.0, -1.0, math.nan])
def test_tolerances_are_positive(tolerance):
    points = torch.zeros(1, 4, 3)
    with pytest.raises(ValueError, match=f"tolerance must be positive, got {tolerance}"):
        bezier.length(points, None, tolerance)
    with pytest.raises(ValueError, match=f"tolerance must be positive, got {tolerance}"):
        bezier.tessellate(points, None, tolerance)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_values_are_finite(bad):
    points, weights = torch.zeros(1, 4, 3), torch.ones(1, 4)
    for arguments in ((points + bad, weights), (points, weights * bad)):
        for call in (
            lambda a=arguments: bezier.length(*a),
            lambda a=arguments: bezier.tessellate(*a, 0.1),
            lambda a=arguments: bezier.bounding_box(*a),
        ):
            with pytest.raises(ValueError, match=r"(points|weights) must be finite, got NaN or infinity"):
                call()


@pytest.mark.parametrize("weights", [[-1.0, -1.0, -1.0, -1.0], [1.0, 1.0, 1.0, 0.0], [-1.0, 1.0, 1.0, 1.0]])
def test_tessellation_wants_positive_ends(weights):
    with pytest.raises(ValueError, match=r"the first and last weights of curves must be positive, got (-1|0)"):
        bezier.tessellate(torch.rand(1, 4, 3), torch.tensor([weights]), 0.01)


def test_tessellation_ends_where_rounding_begins(generator):
    """A small curve far away: its points are known to 1e-10, and it is not halved for less."""
    points = 1e6 + 1e-3 * torch.randn(1, 4, 3, generator=generator, dtype=torch.float64)
    ((t, vertices),) = bezier.tessellate(points, None, 1e-13)
    assert 100 < len(t) < 10_000
    torch.testing.assert_close(vertices[[0, -1]], points[0, [0, 3]], rtol=1e-15, atol=0)


@pytest.mark.usefixtures("unchecked")
def test_tessellate_takes_a_list_of_curves():
    with pytest.raises(ValueError, match=r"points must have shape \(N, K, D\), got \(4, 3\)"):
        bezier.tessellate(torch.zeros(4, 3), None, 0.1)
