"""Rational Bézier curves: evaluation, derivatives, elevation and cuts, against closed forms and de Casteljau."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff3ds import bezier

# Some ten roundings of values of order one, over weights that differ by a factor of 100.
TOLERANCE = {torch.float32: 1e-4, torch.float64: 1e-13}

degrees = st.sampled_from([1, 2, 3])
dtypes = st.sampled_from([torch.float32, torch.float64])
batches = st.sampled_from([(), (1,), (3,), (2, 3)])
seeds = st.integers(0, 10**6)


def _curves(seed: int, degree: int, batch=(), dtype=torch.float64, dimensions=3):
    generator = torch.Generator().manual_seed(seed)
    points = torch.randn(*batch, degree + 1, dimensions, generator=generator, dtype=dtype)
    weights = 10 ** (2 * torch.rand(*batch, degree + 1, generator=generator, dtype=dtype) - 1)
    return points, weights


def _de_casteljau(points, weights, t: float):
    """The point at one parameter by repeated interpolation."""
    control = torch.cat([points * weights[..., None], weights[..., None]], -1)
    while control.shape[-2] > 1:
        control = (1 - t) * control[..., :-1, :] + t * control[..., 1:, :]
    return control[..., 0, :-1] / control[..., 0, -1:]


def _close(actual, expected, factor: float = 1.0) -> None:
    tolerance = factor * TOLERANCE[actual.dtype]
    torch.testing.assert_close(actual, expected, rtol=tolerance, atol=tolerance)


@given(seeds, degrees, batches, dtypes, st.floats(0, 1))
def test_evaluate_is_de_casteljau(seed, degree, batch, dtype, t):
    points, weights = _curves(seed, degree, batch, dtype)
    found = bezier.evaluate(points, weights, torch.tensor([t, 0.0, 1.0], dtype=dtype))
    assert found.shape == (*batch, 3, 3)
    _close(found[..., 0, :], _de_casteljau(points, weights, t))
    _close(found[..., 1:, :], points[..., [0, -1], :])


def test_evaluate_has_a_closed_form():
    """(t², 3 t² (1 - t)) and the quarter circle ((1 - t²), 2 t) / (1 + t²)."""
    t = torch.linspace(0, 1, 11, dtype=torch.float64)
    points = torch.tensor([[0.0, 0], [0, 0], [1 / 3, 1], [1, 0]], dtype=torch.float64)
    _close(bezier.evaluate(points, None, t), torch.stack([t**2, 3 * t**2 * (1 - t)], -1))
    points = torch.tensor([[1.0, 0], [1, 1], [0, 1]], dtype=torch.float64)
    weights = torch.tensor([1.0, 1, 2], dtype=torch.float64)
    expected = torch.stack([1 - t**2, 2 * t], -1) / (1 + t**2)[:, None]
    _close(bezier.evaluate(points, weights, t), expected)


@given(seeds, degrees, st.floats(1e-3, 1e3))
def test_a_common_factor_of_the_weights_changes_nothing(seed, degree, factor):
    points, weights = _curves(seed, degree)
    t = torch.linspace(0, 1, 7, dtype=torch.float64)
    _close(bezier.evaluate(points, factor * weights, t), bezier.evaluate(points, weights, t))
    _close(bezier.evaluate(points, None, t), bezier.evaluate(points, torch.full_like(weights, factor), t))


def test_parameters_broadcast_with_curves():
    points, weights = _curves(0, 3, (4, 1))
    t = torch.rand(5, 6, dtype=torch.float64)
    found = bezier.evaluate(points, weights, t)
    assert found.shape == (4, 5, 6, 3)
    _close(found[2, 3], bezier.evaluate(points[2, 0], weights[2, 0], t[3]))


@pytest.mark.slow
@given(seeds, degrees, batches)
def test_derivatives_are_those_of_autograd(seed, degree, batch):
    points, weights = _curves(seed, degree, batch)
    t = torch.linspace(0, 1, 5, dtype=torch.float64)
    velocity, acceleration = bezier.derivatives(points, weights, t)

    t.requires_grad_()
    for axis, p in enumerate(bezier.evaluate(points, weights, t).unbind(-1)):
        for curve in np.ndindex(batch):
            (first,) = torch.autograd.grad(p[curve].sum(), t, create_graph=True)
            (second,) = torch.autograd.grad(first.sum(), t, retain_graph=True)
            # Derivatives divide by weights that are smaller than others by up to 100.
            _close(velocity[(*curve, slice(None), axis)], first.detach(), 1e3)
            _close(acceleration[(*curve, slice(None), axis)], second, 1e5)


@given(seeds, degrees)
def test_derivatives_are_those_of_finite_differences(seed, degree):
    points, weights = _curves(seed, degree)
    t, step = torch.linspace(0.1, 0.9, 5, dtype=torch.float64), 1e-4
    before, here, after = (bezier.evaluate(points, weights, t + k * step) for k in (-1, 0, 1))
    velocity, acceleration = bezier.derivatives(points, weights, t)
    # Truncation is step² / 6 times the third derivative; a ratio of 100 in the weights makes it 1e4 of the first.
    scale = 1 + velocity.abs().max() + acceleration.abs().max()
    assert ((after - before) / (2 * step) - velocity).abs().max() < 1e-3 * scale
    assert ((after - 2 * here + before) / step**2 - acceleration).abs().max() < 1e-2 * scale


@given(seeds, degrees)
def test_derivatives_far_from_the_origin_keep_their_digits(seed, degree):
    points, weights = _curves(seed, degree)
    points = (points * 2**20).round() / 2**20  # moving by 1e6 then rounds nothing away
    t = torch.linspace(0, 1, 5, dtype=torch.float64)
    for near, far in zip(
        bezier.derivatives(points, weights, t), bezier.derivatives(points + 2.0**20, weights, t), strict=True
    ):
        torch.testing.assert_close(far, near, rtol=0, atol=0)


@given(seeds, degrees, degrees, batches, dtypes)
def test_elevation_keeps_curve_and_parametrisation(seed, degree, raised, batch, dtype):
    points, weights = _curves(seed, degree, batch, dtype)
    if raised < degree:
        with pytest.raises(ValueError, match=f"between the curve's degree {degree} and 3, got {raised}"):
            bezier.elevate(points, weights, raised)
        return
    p, w = bezier.elevate(points, weights, raised)
    assert p.shape == (*batch, raised + 1, 3)
    t = torch.linspace(0, 1, 9, dtype=dtype)
    _close(bezier.evaluate(p, w, t), bezier.evaluate(points, weights, t))
    assert bool((w > 0).all())


def test_elevation_has_a_closed_form():
    points = torch.tensor([[0.0, 0], [3, 3]], dtype=torch.float64)
    p, w = bezier.elevate(points, None)
    _close(p, torch.tensor([[0.0, 0], [1, 1], [2, 2], [3, 3]], dtype=torch.float64))
    assert w.tolist() == [1, 1, 1, 1]


@given(seeds, degrees, batches, dtypes, st.floats(0, 1), st.floats(0, 1))
def test_subcurve_is_part_of_the_curve(seed, degree, batch, dtype, start, stop):
    points, weights = _curves(seed, degree, batch, dtype)
    part = bezier.subcurve(points, weights, start, stop)
    u = torch.linspace(0, 1, 9, dtype=dtype)
    a, b = bernstein_weights(points, weights, start), bernstein_weights(points, weights, stop)
    # A cut is parametrised linearly in homogeneous coordinates, as the whole.
    assert a.shape == b.shape == batch
    _close(bezier.evaluate(*part, u), bezier.evaluate(points, weights, start + (stop - start) * u))
    _close(part[1][..., 0], a)
    _close(part[1][..., -1], b)


def bernstein_weights(points, weights, t: float):
    """The denominator W(t)."""
    value = weights
    while value.shape[-1] > 1:
        value = (1 - t) * value[..., :-1] + t * value[..., 1:]
    return value[..., 0]


@given(seeds, degrees, st.floats(0.01, 0.99))
def test_split_joins_again(seed, degree, t):
    points, weights = _curves(seed, degree, (2,))
    left, right = bezier.split(points, weights, t)
    _close(left[0][:, -1], right[0][:, 0])
    _close(left[0][:, 0], points[:, 0])
    _close(right[0][:, -1], points[:, -1])
    # The left half carried on to 1 / t is the whole. Extrapolation by 1 / t multiplies rounding by its cube.
    whole = bezier.subcurve(*left, 0.0, 1 / t)
    u = torch.linspace(0, 1, 9, dtype=torch.float64)
    _close(bezier.evaluate(*whole, u), bezier.evaluate(points, weights, u), 1e3 / t**degree)


def test_each_curve_has_its_own_cut():
    points, weights = _curves(0, 3, (4,))
    start, stop = torch.tensor([0.0, 0.1, 0.2, 0.9]).double(), torch.tensor([1.0, 0.3, 0.1, 0.95]).double()
    many = bezier.subcurve(points, weights, start, stop)
    for i in range(4):
        one = bezier.subcurve(points[i], weights[i], float(start[i]), float(stop[i]))
        _close(many[0][i], one[0])
        _close(many[1][i], one[1])


BAD_CURVES = [
    ([[0.0, 0.0]], None, TypeError, "points must be a floating point tensor, got list"),
    (torch.zeros(4, 3, dtype=torch.int64), None, TypeError, "points must be a floating point tensor, got torch.int64"),
    (torch.zeros(1, 3), None, ValueError, r"K = 2, 3 or 4 control points, got \(1, 3\)"),
    (torch.zeros(5, 3), None, ValueError, r"K = 2, 3 or 4 control points, got \(5, 3\)"),
    (torch.zeros(3), None, ValueError, r"got \(3,\)"),
    (torch.zeros(4, 3), torch.ones(3), ValueError, r"weights must have shape \(4,\), got \(3,\)"),
    (torch.zeros(4, 3), 1.0, TypeError, "weights must be a floating point tensor, got float"),
    (torch.zeros(4, 3), torch.ones(4, dtype=torch.int32), TypeError, "weights .* got torch.int32"),
]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(("points", "weights", "error", "message"), BAD_CURVES)
def test_errors_name_the_argument(points, weights, error, message):
    t = torch.zeros(1)
    for call in (
        lambda: bezier.evaluate(points, weights, t),
        lambda: bezier.derivatives(points, weights, t),
        lambda: bezier.elevate(points, weights),
        lambda: bezier.subcurve(points, weights, 0.0, 1.0),
        lambda: bezier.length(points, weights),
        lambda: bezier.bounding_box(points, weights),
        lambda: bezier.closest_point(points, weights, torch.zeros(1, 3)),
    ):
        with pytest.raises(error, match=message):
            call()
