"""The closest point of rational Bézier curves: global, to 1e-9 of the curve's size, on random and degenerate curves."""

import functools
import math

import numpy as np
import pytest
import torch
from curve_cases import FAMILIES, SINGULAR_CUBICS, SINGULAR_QUADRATICS, Cases, sampled_distance
from hypothesis import given
from hypothesis import strategies as st

from diff3ds import bezier
from diff3ds.bezier.polynomial import isolators, roots_and_separators

# Of each family, quick and slow.
CASES = pytest.mark.parametrize("count", [60, pytest.param(150, marks=pytest.mark.slow)])


def _seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@functools.cache
def solved(family, count):
    """So many cases of a family, and their closest points."""
    cases = family(_seeded(), count)
    return cases, bezier.closest_point(*cases)


@CASES
@pytest.mark.parametrize("family", FAMILIES, ids=lambda f: f.__name__)
def test_never_farther_than_dense_sampling(family, count):
    cases, found = solved(family, count)
    excess = found.distance[:, 0] - sampled_distance(cases)
    worst = int((excess - cases.tolerance).argmax())
    assert excess[worst] <= cases.tolerance[worst], [v[worst].tolist() for v in cases]


@CASES
@pytest.mark.parametrize("family", FAMILIES, ids=lambda f: f.__name__)
def test_distance_is_that_of_the_point_at_t(family, count):
    cases, (t, point, distance) = solved(family, count)
    assert bool(((t >= 0) & (t <= 1)).all())
    again = bezier.evaluate(cases.points, cases.weights, t)
    assert bool(((again - point).abs().amax((1, 2)) <= cases.tolerance).all())
    off = torch.linalg.vector_norm(again - cases.query, dim=-1) - distance
    assert bool((off.abs()[:, 0] <= cases.tolerance).all())


def test_line_has_a_closed_form(generator):
    start, stop, q = (torch.randn(500, 3, generator=generator, dtype=torch.float64) for _ in range(3))
    along = ((q - start) * (stop - start)).sum(-1) / (stop - start).square().sum(-1)
    t, _, distance = bezier.closest_point(torch.stack([start, stop], 1), None, q[:, None])
    expected = along.clamp(0, 1)
    torch.testing.assert_close(t[:, 0], expected, rtol=0, atol=1e-13)
    foot = start + expected[:, None] * (stop - start)
    torch.testing.assert_close(distance[:, 0], torch.linalg.vector_norm(q - foot, dim=-1), rtol=1e-14, atol=1e-14)


def test_circle_has_a_closed_form(generator):
    points, weights = bezier.circle((0.3, -0.2, 0.5), 2.0)
    q = torch.randn(400, 3, generator=generator, dtype=torch.float64) * 3
    _, _, distance = bezier.closest_point(points, weights, q)
    inside = q - torch.tensor([0.3, -0.2, 0.5], dtype=torch.float64)
    expected = torch.hypot(inside[:, :2].norm(dim=-1) - 2, inside[:, 2])
    torch.testing.assert_close(distance.amin(0), expected, rtol=1e-14, atol=1e-14)


def test_every_point_of_a_circle_is_as_far_from_its_centre():
    quadratics = bezier.circle((0.0, 0.0, 0.0), 2.0)
    for points, weights in (quadratics, bezier.elevate(*quadratics)):
        found = bezier.closest_point(points, weights, torch.zeros(1, 3, dtype=torch.float64))
        torch.testing.assert_close(found.distance, torch.full((4, 1), 2.0, dtype=torch.float64), rtol=1e-15, atol=0)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_batches_broadcast(generator, dtype):
    points = torch.randn(3, 1, 4, 2, generator=generator, dtype=dtype)
    weights = torch.rand(3, 1, 4, generator=generator, dtype=dtype) + 0.1
    query = torch.randn(5, 7, 2, generator=generator, dtype=dtype)
    found = bezier.closest_point(points, weights, query)
    assert found.t.shape == found.distance.shape == (3, 5, 7)
    assert found.point.shape == (3, 5, 7, 2)
    assert {v.dtype for v in found} == {dtype}
    one = bezier.closest_point(points[2, 0], weights[2, 0], query[4, 6:])
    torch.testing.assert_close(found.t[2, 4, 6:], one.t)


def test_no_curves_and_no_queries():
    assert bezier.closest_point(torch.zeros(0, 4, 3), None, torch.zeros(5, 3)).t.shape == (0, 5)
    assert bezier.closest_point(torch.zeros(2, 4, 3), None, torch.zeros(0, 3)).distance.shape == (2, 0)


def test_float32_is_solved_in_float64(generator):
    points, query = torch.randn(50, 4, 3, generator=generator), torch.randn(50, 1, 3, generator=generator)
    weights = torch.rand(50, 4, generator=generator) + 0.1
    single = bezier.closest_point(points, weights, query)
    double = bezier.closest_point(points.double(), weights.double(), query.double())
    torch.testing.assert_close(single.t, double.t.float(), rtol=0, atol=0)


@pytest.mark.usefixtures("unchecked")
def test_errors_name_what_does_not_fit():
    points = torch.zeros(2, 4, 3)
    with pytest.raises(ValueError, match=r"query must have shape \(..., Q, 3\), got \(5, 2\)"):
        bezier.closest_point(points, None, torch.zeros(5, 2))
    weights = torch.tensor([[1.0, 1, 1, 1], [1, -2, 1, 1]])
    with pytest.raises(ValueError, match="weights must be positive, got -2"):
        bezier.closest_point(points, weights, torch.zeros(5, 3))
    with pytest.raises(ValueError, match=r"the batch axes of query, \(3,\), must broadcast with the curves', \(2,\)"):
        bezier.closest_point(points, None, torch.zeros(3, 5, 3))
    for bad in (math.nan, math.inf):
        for k, argument in enumerate([points, torch.ones(2, 4), torch.zeros(5, 3)]):
            arguments = [points, torch.ones(2, 4), torch.zeros(5, 3)]
            arguments[k] = torch.full_like(argument, bad)
            with pytest.raises(ValueError, match=r"must be (finite, got NaN or infinity|positive, got nan)"):
                bezier.closest_point(*arguments)


def _interior(generator: torch.Generator, count: int, controls: int) -> Cases:
    """Curves and queries off them whose closest points lie inside and are well determined."""
    t = 0.2 + 0.6 * torch.rand(count, 1, generator=generator, dtype=torch.float64)
    points = torch.randn(count, controls, 3, generator=generator, dtype=torch.float64)
    weights = torch.rand(count, controls, generator=generator, dtype=torch.float64) + 0.5
    velocity, _ = bezier.derivatives(points, weights, t)
    across = torch.linalg.cross(velocity, torch.randn(count, 1, 3, generator=generator, dtype=torch.float64))
    across = across / torch.linalg.vector_norm(across, dim=-1, keepdim=True)
    query = bezier.evaluate(points, weights, t) + 0.05 * across
    found = bezier.closest_point(points, weights, query).t
    return Cases(*(v[((found - t).abs() < 1e-6)[:, 0]] for v in (points, weights, query)))


@pytest.mark.parametrize("controls", [2, 3, 4])
def test_gradients_are_those_of_finite_differences(generator, controls):
    cases = _interior(generator, 30, controls)
    assert len(cases.points) > 15
    inputs = [v.clone().requires_grad_() for v in cases]
    exact = [torch.autograd.grad(v.sum(), inputs, retain_graph=True) for v in _outputs(inputs)]
    step = 1e-6
    for k, value in enumerate(cases):
        moves = step * torch.eye(value[0].numel(), dtype=torch.float64).reshape(-1, 1, *value.shape[1:])
        fixed = [v.expand(len(moves), *v.shape) for v in cases]
        ahead, behind = (_outputs([*fixed[:k], value + sign * moves, *fixed[k + 1 :]]) for sign in (1, -1))
        for gradients, a, b in zip(exact, ahead, behind, strict=True):
            # Rounding: 1e-15 / 1e-6; truncation: 1e-12 times third derivatives of up to some 1e4.
            torch.testing.assert_close(gradients[k].flatten(1).T, (a - b) / (2 * step), rtol=1e-6, atol=1e-7)


def _outputs(inputs) -> list[torch.Tensor]:
    """t, the coordinates of the point, and the distance, one number a curve each."""
    t, point, distance = bezier.closest_point(*inputs)
    return [t[..., 0], *point[..., 0, :].unbind(-1), distance[..., 0]]


def test_t_is_constant_at_an_end():
    points = torch.tensor([[0.0, 0], [1, 0]], dtype=torch.float64, requires_grad=True)
    query = torch.tensor([[-1.0, 1.0]], dtype=torch.float64, requires_grad=True)
    t, _, distance = bezier.closest_point(points, None, query)
    (g_t,) = torch.autograd.grad(t.sum(), query, retain_graph=True)
    (g_distance,) = torch.autograd.grad(distance.sum(), query)
    assert t.item() == 0
    assert g_t.tolist() == [[0, 0]]
    torch.testing.assert_close(g_distance, torch.tensor([[-1.0, 1.0]], dtype=torch.float64) / math.sqrt(2))


@pytest.mark.parametrize("family", FAMILIES, ids=lambda f: f.__name__)
def test_gradients_of_t_and_point_are_finite(family):
    inputs = [v.clone().requires_grad_() for v in family(_seeded(2), 20)]
    t, point, _ = bezier.closest_point(*inputs)
    for gradient in torch.autograd.grad(t.sum() + point.sum(), inputs):
        assert bool(gradient.isfinite().all())


def _stationary(points, weights) -> np.ndarray:
    """Ascending coefficients in s = 2 t - 1 of X · (X' W - X W'), by numpy."""
    poly, n = np.polynomial.polynomial, len(weights) - 1
    basis = []
    for i in range(n + 1):
        terms = [[0.5, 0.5]] * i + [[0.5, -0.5]] * (n - i)
        basis.append(math.comb(n, i) * np.polynomial.Polynomial([1.0]).coef)
        for term in terms:
            basis[-1] = poly.polymul(basis[-1], term)
    w = weights @ np.array(basis)
    total = np.zeros(3 * n)
    for axis in points.T:
        x = (axis * weights) @ np.array(basis)
        numerator = poly.polysub(poly.polymul(poly.polyder(x), w), poly.polymul(x, poly.polyder(w)))
        total += np.resize(np.append(poly.polymul(x, numerator), 0.0), 3 * n)
    return total[:-1]


@pytest.mark.parametrize(("points", "weights"), SINGULAR_QUADRATICS + SINGULAR_CUBICS)
def test_singular_cases_are_singular(points, weights):
    """Their stationary polynomials are a power and a constant: the matrix of the isolators loses rank."""
    c = _stationary(np.array(points), np.array(weights))
    assert np.abs(c[1:-1]).max() < 1e-13 * np.abs(c).max()
    assert abs(c[0]) > 0.1
    assert abs(c[-1]) > 0.1


# Rounding decides whether a root at an end of the interval is inside; closest_point always looks at the ends.
roots_in_interval = st.lists(st.integers(-31, 31), max_size=7, unique=True)


def _roots(p: torch.Tensor) -> torch.Tensor:
    """The real roots of one polynomial and the points between them."""
    found = torch.cat(roots_and_separators(p), -1)
    return found[~found.isnan()]


@given(
    roots=roots_in_interval,
    degree=st.sampled_from([1, 2, 3, 4, 7]),
    pairs=st.integers(0, 3),
    scale=st.sampled_from([1e-20, 1.0, 1e20]),
)
def test_real_roots_are_all_found(roots, degree, pairs, scale):
    """A product of linear factors and of pairs of complex roots; leading coefficients that are left over vanish."""
    roots = [n / 32 for n in roots[:degree]]
    coefficients = np.polynomial.polynomial.polyfromroots(roots)
    for _ in range(min(pairs, (degree + 1 - len(coefficients)) // 2)):
        coefficients = np.polynomial.polynomial.polymul(coefficients, [1.3, 0.4, 1.0])
    p = torch.zeros(degree + 1, dtype=torch.float64)
    p[: len(coefficients)] = torch.from_numpy(np.ascontiguousarray(coefficients)) * scale
    found = _roots(p)
    for root in roots:
        # Rounding of the coefficients moves a root by eps times their sum over the slope there.
        slope = abs(np.polynomial.polynomial.polyval(root, np.polynomial.polynomial.polyder(coefficients)))
        assert (found - root).abs().min() < 1e-15 + 1e-15 * np.abs(coefficients).sum() / slope


@pytest.mark.parametrize("degree", [4, 7])
@pytest.mark.parametrize("c", [-0.5, -1e-9, 1e-9, 0.5])
def test_roots_of_a_power_and_a_constant(degree, c):
    """s^n - c: the leading minors of the isolators' system vanish."""
    p = torch.zeros(degree + 1, dtype=torch.float64)
    p[0], p[-1] = -c, 1.0
    found = _roots(p)
    real = [] if degree == 4 and c < 0 else [math.copysign(abs(c) ** (1 / degree), c)]
    real = [*real, *(-r for r in real)] if degree == 4 else real
    for root in real:
        assert (found - root).abs().min() < 1e-12


@pytest.mark.parametrize("degree", [4, 7])
def test_isolators_separate(generator, degree):
    """a = b p' + c p of the degrees of the paper, and its identity for the quartic (its printed formula corrected)."""
    p = torch.randn(degree + 1, generator=generator, dtype=torch.float64)
    a, b = isolators(p)
    assert (len(a) - 1, len(b) - 1) == {4: (2, 1), 7: (3, 3)}[degree]
    if degree == 4:
        e, d, c, b3, _ = (p / p[-1]).tolist()
        paper_a = torch.tensor([e - b3 * d / 16, 3 * d / 4 - b3 * c / 8, c / 2 - 3 * b3**2 / 16]).double()
        paper_b = torch.tensor([b3 / 16, 0.25]).double()
        torch.testing.assert_close(b / b[1] / 4, paper_b)
        torch.testing.assert_close((a / a[2]) * paper_a[2], paper_a)
