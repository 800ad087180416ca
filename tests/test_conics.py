"""Circles, ellipses and parabolas as rational curves: exact to rounding."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff3ds import bezier

T = torch.linspace(0, 1, 33, dtype=torch.float64)
angles = st.floats(-720, 720)
coordinates = st.floats(-1, 1)


@given(angles, angles, st.tuples(coordinates, coordinates, coordinates), st.integers(0, 1000))
def test_circle_is_round(start, stop, center, seed):
    if start == stop:
        return
    normal = torch.randn(3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    points, weights = bezier.circle(center, 1.0, normal, start, stop)
    p = bezier.evaluate(points, weights, T) - torch.tensor(center, dtype=torch.float64)
    assert (torch.linalg.vector_norm(p, dim=-1) - 1).abs().max() < 1e-14
    assert (p @ normal).abs().max() < 1e-14 * torch.linalg.vector_norm(normal)
    assert bool((weights > 0.7).all())


@pytest.mark.parametrize(("start", "stop"), [(0.0, 360.0), (30.0, -330.0), (10.0, 20.0), (0.0, 180.0), (-100.0, 300.0)])
def test_circle_runs_from_start_to_stop(start, stop):
    points, weights = bezier.circle((0.0, 0.0, 0.0), 2.0, start=start, stop=stop)
    ends = torch.stack([points[0, 0], points[-1, -1]])
    for end, angle in zip(ends, (start, stop), strict=True):
        expected = [2 * math.cos(math.radians(angle)), 2 * math.sin(math.radians(angle)), 0.0]
        torch.testing.assert_close(end, torch.tensor(expected, dtype=torch.float64), rtol=0, atol=1e-14)
    assert torch.equal(points[1:, 0], points[:-1, -1])
    # Counter-clockwise for stop > start: angles grow along every piece and add up to the whole.
    p = bezier.evaluate(points, weights, T)[..., :2]
    turned = torch.atan2(p[:, :-1, 0] * p[:, 1:, 1] - p[:, :-1, 1] * p[:, 1:, 0], (p[:, :-1] * p[:, 1:]).sum(-1))
    assert math.isclose(math.degrees(turned.sum()), stop - start, abs_tol=1e-10)
    assert bool((turned * (stop - start) > 0).all())


def test_full_circle_closes_exactly():
    points, _ = bezier.circle((0.1, 0.2, 0.3), 0.7, (0.3, -0.5, 0.8), 17.0, 377.0)
    assert torch.equal(points[0, 0], points[-1, -1])
    assert len(points) == 4


@pytest.mark.parametrize("normal", [(1.0, 0.0, 0.0), (-1.0, 1e-9, 0.0), (1.0, 0.01, 0.0), (0.0, 1.0, 0.0)])
def test_circle_of_any_normal(normal):
    points, weights = bezier.circle((0.0, 0.0, 0.0), 1.0, normal)
    p = bezier.evaluate(points, weights, T)
    n = torch.nn.functional.normalize(torch.tensor(normal, dtype=torch.float64), dim=0)
    assert (p @ n).abs().max() < 1e-14
    turn = torch.linalg.cross(p[:, :-1], p[:, 1:]) @ n
    assert bool((turn > 0).all())


def test_angle_zero_is_the_direction_of_x():
    points, _ = bezier.circle((0.0, 0.0, 0.0), 1.0, (1.0, 0.0, 1.0))
    expected = torch.tensor([1.0, 0.0, -1.0], dtype=torch.float64) / math.sqrt(2)
    torch.testing.assert_close(points[0, 0], expected, rtol=0, atol=1e-15)
    points, _ = bezier.circle((0.0, 0.0, 0.0), 1.0, (1.0, 0.0, 0.0))
    torch.testing.assert_close(points[0, 0], torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64))


@given(angles, angles, st.floats(0.01, 10), st.floats(0.01, 10))
def test_ellipse_keeps_its_equation(start, stop, a, b):
    if start == stop:
        return
    points, weights = bezier.ellipse((0.0, 0.0), (a, 0.0), (0.0, b), start, stop)
    x, y = bezier.evaluate(points, weights, T).unbind(-1)
    assert ((x / a) ** 2 + (y / b) ** 2 - 1).abs().max() < 1e-14


def test_ellipse_of_conjugate_half_diameters():
    """An affine image of a circle, in four dimensions."""
    c, u, v = torch.randn(3, 4, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    points, weights = bezier.ellipse(c, u, v)
    along = torch.linalg.pinv(torch.stack([u, v], 1)) @ (bezier.evaluate(points, weights, T) - c).mT
    assert (along.square().sum(-2) - 1).abs().max() < 1e-13


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_parabola_keeps_its_equation(start, stop):
    if start == stop:
        return
    points, weights = bezier.parabola((1.0, 2.0), (1.0, 0.0), (0.0, 0.5), start, stop)
    s = start + (stop - start) * T
    expected = torch.stack([1 + s, 2 + 0.5 * s * s], -1)
    torch.testing.assert_close(bezier.evaluate(points, weights, T)[0], expected, rtol=0, atol=1e-14 * 25)
    assert weights.tolist() == [[1, 1, 1]]


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_dtype_is_the_one_asked_for(dtype):
    for points, weights in (
        bezier.circle((0.0, 0.0, 0.0), 1.0, dtype=dtype),
        bezier.parabola((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), 0.0, 1.0, dtype=dtype),
    ):
        assert points.dtype == weights.dtype == dtype


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bezier.circle((0.0, 0.0, 0.0), 0.0), "positive radius and a normal with a length, got 0.0"),
        (lambda: bezier.circle((0.0, 0.0, 0.0), 1.0, (0.0, 0.0, 0.0)), "a normal with a length"),
        (
            lambda: bezier.circle((0.0, 0.0, 0.0), 1.0, start=5.0, stop=5.0),
            "and differ, got start 5.0, stop 5.0",
        ),
        (lambda: bezier.circle((0.0, math.nan, 0.0), 1.0), "center must be finite, got NaN or infinity"),
        (lambda: bezier.circle((0.0, 0.0, 0.0), 1.0, stop=math.inf), "start and stop must be finite and differ"),
        (lambda: bezier.ellipse((0.0, 0.0), (1.0, 0.0), (0.0, 1.0, 0.0)), r"vectors of one length, got shapes"),
        (
            lambda: bezier.parabola((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), 1.0, 1.0),
            "start and stop must be finite and differ",
        ),
        (
            lambda: bezier.parabola((0.0,), (1.0, 0.0), (0.0, 1.0), 0.0, 1.0),
            "vertex, u, v must be vectors of one length",
        ),
        (lambda: bezier.parabola((0.0, math.nan), (1.0, 0.0), (0.0, 1.0), 0.0, 1.0), "vertex must be finite"),
        (lambda: bezier.circle((0.0, 0.0, 0.0), 1.0, (0.0, 1.0)), "a normal with a length"),
        (lambda: bezier.circle((0.0, 0.0, 0.0), math.inf), "radius must be finite"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_errors(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: bezier.ellipse("x", (1.0, 0.0), (0.0, 1.0)),
            "center must be a number, a list of numbers or a tensor, got",
        ),
        (
            lambda: bezier.ellipse((0.0, 0.0), (1.0, 0.0), None),
            "v must be a number, a list of numbers or a tensor, got",
        ),
        (lambda: bezier.circle((0.0, 0.0, 0.0), "wide"), "radius must be a number, .* got str"),
        (lambda: bezier.circle((0.0, 0.0, 0.0), 1.0, stop="end"), "stop must be a number, .* got str"),
        (
            lambda: bezier.parabola((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), None, 1.0),
            "start must be a number, .* got NoneType",
        ),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_what_is_no_number_is_named(call, message):
    with pytest.raises(TypeError, match=message):
        call()
