"""Curves and queries that are hard for closest points, by family, and the true distance by dense sampling."""

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

# Weights go from 1e-3 to 1e3: whatever happens to a cubic happens within odds t / (1 - t) of e^-15 to e^15, and at odds
# of e^-44 it is within 1e-12 of its end.
LOG_ODDS = 44.0
# None of the even ones coincides with one of the others: a bracket of no width would hide a minimum.
ODDS_SAMPLES, EVEN_SAMPLES = 441, 128
FINER_INTERVALS, FINER_SAMPLES = 16, 15
# A cubic has at most 7 stationary points, hence at most 4 nearest ones.
MINIMA = 4
GOLDEN = (math.sqrt(5) - 1) / 2
# A bracket of 0.4 shrinks to 1e-12.
GOLDEN_STEPS = 56


class Cases(NamedTuple):
    """Curves (N, K, D), weights (N, K), and one query for each (N, 1, D); float64."""

    points: Tensor
    weights: Tensor
    query: Tensor

    @property
    def size(self) -> Tensor:
        """Diagonals of the boxes around the control points."""
        return torch.linalg.vector_norm(self.points.amax(1) - self.points.amin(1), dim=-1)

    @property
    def tolerance(self) -> Tensor:
        """What a distance may exceed the true one by: 1e-9 of the size, and the rounding of the coordinates."""
        magnitude = torch.maximum(self.points.abs().amax((1, 2)), self.query.abs().amax((1, 2)))
        return 1e-9 * self.size + 8 * torch.finfo(torch.float64).eps * magnitude


def position(points: Tensor, weights: Tensor, log_odds: Tensor) -> Tensor:
    """Points (N, M, D) of curves (N, K, D) at t = sigmoid(log_odds), with 1 - t as exact as t."""
    t, s, n = log_odds.sigmoid(), (-log_odds).sigmoid(), points.shape[1] - 1
    basis = torch.stack([math.comb(n, i) * t**i * s ** (n - i) for i in range(n + 1)], -1) * weights[:, None, :]
    return (basis @ points) / basis.sum(-1, keepdim=True)


def sampled_distance(cases: Cases) -> Tensor:
    """Distance of the closest point by dense sampling and golden sections around the nearest samples; no algebra."""

    def distance(x: Tensor) -> Tensor:
        return torch.linalg.vector_norm(position(cases.points, cases.weights, x) - cases.query, dim=-1)

    x = _finer(cases, _samples().expand(len(cases.points), -1))
    d, between = _distances(cases, x)
    # By what they may come down to: along an end, where the curve stands still, rounding makes many false minima.
    promise = torch.minimum(between[:, 1:], between[:, :-1])
    inner = (d[:, 1:-1] <= d[:, :-2]) & (d[:, 1:-1] <= d[:, 2:])
    middle = 1 + torch.where(inner, promise, torch.inf).topk(MINIMA, largest=False).indices
    low, high = x.gather(1, middle - 1), x.gather(1, middle + 1)
    for _ in range(GOLDEN_STEPS):
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left = distance(a) < distance(b)
        low, high = torch.where(left, low, a), torch.where(left, b, high)
    ends = torch.linalg.vector_norm(cases.points[:, [0, -1]] - cases.query, dim=-1)
    return torch.cat([d, distance((low + high) / 2), ends], 1).amin(1)


def _samples() -> Tensor:
    """Log odds, even in themselves and in t."""
    spread = torch.linspace(-LOG_ODDS, LOG_ODDS, ODDS_SAMPLES, dtype=torch.float64)
    even = torch.linspace(0, 1, EVEN_SAMPLES, dtype=torch.float64)[1:-1].logit()
    return torch.cat([spread, even]).sort().values


def _distances(cases: Cases, x: Tensor) -> tuple[Tensor, Tensor]:
    """Distances at samples (N, M), and about how near the curve may come between them (N, M - 1)."""
    p = position(cases.points, cases.weights, x)
    d = torch.linalg.vector_norm(p - cases.query, dim=-1)
    return d, torch.minimum(d[:, 1:], d[:, :-1]) - torch.linalg.vector_norm(p[:, 1:] - p[:, :-1], dim=-1)


def _finer(cases: Cases, x: Tensor) -> Tensor:
    """Samples with more where the curve may come nearest, so that no dip is overlooked."""
    start = _distances(cases, x)[1].topk(FINER_INTERVALS, largest=False).indices
    low, high = x.gather(1, start)[..., None], x.gather(1, start + 1)[..., None]
    finer = low + (high - low) * torch.linspace(0, 1, FINER_SAMPLES + 2, dtype=torch.float64)[1:-1]
    return torch.cat([x, finer.flatten(1)], 1).sort(1).values


def _normal(generator: torch.Generator, *shape: int) -> Tensor:
    return torch.randn(*shape, generator=generator, dtype=torch.float64)


def _uniform(generator: torch.Generator, *shape: int) -> Tensor:
    return torch.rand(*shape, generator=generator, dtype=torch.float64)


def _log_uniform(generator: torch.Generator, exponent: float, *shape: int) -> Tensor:
    """From 10^-exponent to 10^exponent."""
    return 10 ** (exponent * (2 * _uniform(generator, *shape) - 1))


def _noise(generator: torch.Generator, count: int) -> Tensor:
    """Relative disturbances (count, 1, 1): a third none, the others from 1e-17 to 1e-3."""
    some = (_uniform(generator, count, 1, 1) > 1 / 3).double()
    return some * 10 ** (-17 + 14 * _uniform(generator, count, 1, 1))


def _curves(generator: torch.Generator, count: int, controls: int, dimensions: int = 3) -> tuple[Tensor, Tensor]:
    return _normal(generator, count, controls, dimensions), _log_uniform(generator, 1, count, controls)


def random_line(generator: torch.Generator, count: int) -> Cases:
    """Rational lines."""
    return Cases(*_curves(generator, count, 2), _normal(generator, count, 1, 3))


def random_quadratic(generator: torch.Generator, count: int) -> Cases:
    """Quadratics with weights from 0.1 to 10."""
    return Cases(*_curves(generator, count, 3), _normal(generator, count, 1, 3))


def random_cubic(generator: torch.Generator, count: int) -> Cases:
    """Cubics with weights from 0.1 to 10."""
    return Cases(*_curves(generator, count, 4), _normal(generator, count, 1, 3))


def plane_cubic(generator: torch.Generator, count: int) -> Cases:
    """Cubics in the plane with unit weights: the stationary polynomial has degree 5 of 7."""
    return Cases(
        _normal(generator, count, 4, 2), torch.ones(count, 4, dtype=torch.float64), _normal(generator, count, 1, 2)
    )


def wild_quadratic(generator: torch.Generator, count: int) -> Cases:
    """Quadratics with weights from 1e-3 to 1e3."""
    points, query = _normal(generator, count, 3, 3), _normal(generator, count, 1, 3)
    return Cases(points, _log_uniform(generator, 3, count, 3), query)


def wild_cubic(generator: torch.Generator, count: int) -> Cases:
    """Cubics with weights from 1e-3 to 1e3."""
    points, query = _normal(generator, count, 4, 3), _normal(generator, count, 1, 3)
    return Cases(points, _log_uniform(generator, 3, count, 4), query)


def extreme_weights(generator: torch.Generator, count: int) -> Cases:
    """Cubics whose weights are 1e-3, 1 or 1e3, queries on or near the curve."""
    exponent = torch.randint(-1, 2, (count, 4), generator=generator)
    cases = Cases(_normal(generator, count, 4, 3), 1000.0**exponent, torch.empty(0))
    return _near_curve(generator, cases)


def on_curve(generator: torch.Generator, count: int) -> Cases:
    """Queries on cubics with weights from 1e-3 to 1e3, or as near as rounding and more."""
    points = _normal(generator, count, 4, 3)
    return _near_curve(generator, Cases(points, _log_uniform(generator, 3, count, 4), torch.empty(0)))


def _near_curve(generator: torch.Generator, cases: Cases) -> Cases:
    """With queries at any parameter, the ends among them, disturbed a little or not."""
    count, _, dimensions = cases.points.shape
    log_odds = 20 * (2 * _uniform(generator, count, 1) - 1)
    log_odds[::10], log_odds[1::10] = -torch.inf, torch.inf
    shift = _noise(generator, count) * _normal(generator, count, 1, dimensions)
    return cases._replace(query=position(cases.points, cases.weights, log_odds) + shift)


def straight_even(generator: torch.Generator, count: int) -> Cases:
    """Straight, evenly spaced cubics, exactly, to rounding, or with a slight bend: the leading terms vanish."""
    start, step = _normal(generator, count, 1, 3), _normal(generator, count, 1, 3)
    points = start + step * torch.arange(4, dtype=torch.float64)[:, None]
    points = points + _noise(generator, count) * _normal(generator, count, 4, 3)
    return Cases(points, torch.ones(count, 4, dtype=torch.float64), _normal(generator, count, 1, 3) * 2)


def straight_uneven(generator: torch.Generator, count: int) -> Cases:
    """Cubics on a line that may run back and forth, queries on and off the line."""
    start, step = _normal(generator, count, 1, 3), _normal(generator, count, 1, 3)
    points = start + step * _normal(generator, count, 4, 1)
    off = _noise(generator, count) * _normal(generator, count, 1, 3)
    query = start + step * _normal(generator, count, 1, 1) + off
    return Cases(points, _log_uniform(generator, 1, count, 4), query)


def elevated_quadratic(generator: torch.Generator, count: int) -> Cases:
    """Cubics that are quadratics, to rounding, with any weights."""
    points, weights = _normal(generator, count, 3, 3), _log_uniform(generator, 2, count, 3)
    weights[: count // 2] = 1.0
    return Cases(*_elevated(points, weights), _normal(generator, count, 1, 3))


def elevated_line(generator: torch.Generator, count: int) -> Cases:
    """Cubics that are rational lines, to rounding."""
    points, weights = _normal(generator, count, 2, 3), _log_uniform(generator, 1, count, 2)
    return Cases(*_elevated(*_elevated(points, weights)), _normal(generator, count, 1, 3))


def _elevated(points: Tensor, weights: Tensor) -> tuple[Tensor, Tensor]:
    """One degree up."""
    control = torch.cat([points * weights[..., None], weights[..., None]], -1)
    m = control.shape[1]
    share = torch.arange(1, m, dtype=torch.float64)[:, None] / m
    inner = share * control[:, :-1] + (1 - share) * control[:, 1:]
    control = torch.cat([control[:, :1], inner, control[:, -1:]], 1)
    return control[..., :-1] / control[..., -1:], control[..., -1]


# Plane curves whose stationary polynomial for the origin is s^4 - c or s^7 - c, s = 2 t - 1, so that the system of its
# isolators is singular. Found by least squares; test_closest_point.py checks them. End weights are 1.
SINGULAR_QUADRATICS = (
    ([[-2.888294607541957, 1.699291827061928], [-0.5128802323500499, 4.342626526004014],
      [-1.034012943619055, 0.8271987452431829]], [1.0, 0.28829670864181134, 1.0]),
    ([[3.4084258565522187, 0.5580554836662394], [3.3761671700734897, -2.744001788836816],
      [2.012142794745147, 0.2633326384016598]], [1.0, 0.21607447608086966, 1.0]),
)  # fmt: skip
SINGULAR_CUBICS = (
    ([[3.724043509049987, -0.26402160557851884], [3.9802390276399273, 2.868652044680851],
      [-1.5413730241889676, 5.598393249024789], [4.289938672503566, 2.549374674141197]],
     [1.0, 0.37548694623454476, 0.025963355130197353, 1.0]),
    ([[-0.9689918178552325, -3.826504644470303], [-5.858313830001995, -0.5743087046408145],
      [-1.3827486042686148, -3.207200461013486], [0.833722728077991, -1.042949884173273]],
     [1.0, 0.07322419026918708, 0.40149879375259767, 1.0]),
)  # fmt: skip


def singular_quadratic(generator: torch.Generator, count: int) -> Cases:
    """Quadratics with singular isolator systems, also turned, scaled and slightly off."""
    return _singular(generator, count, SINGULAR_QUADRATICS)


def singular_cubic(generator: torch.Generator, count: int) -> Cases:
    """Cubics with singular isolator systems, also turned, scaled and slightly off."""
    return _singular(generator, count, SINGULAR_CUBICS)


def _singular(generator: torch.Generator, count: int, curves: tuple) -> Cases:
    pick = torch.randint(len(curves), (count,), generator=generator)
    points = torch.tensor([c[0] for c in curves], dtype=torch.float64)[pick]
    weights = torch.tensor([c[1] for c in curves], dtype=torch.float64)[pick]
    turn = torch.linalg.qr(_normal(generator, count, 2, 2)).Q * _log_uniform(generator, 2, count, 1, 1)
    moved = points @ turn * (1 + _noise(generator, count) * _normal(generator, count, points.shape[1], 2))
    return Cases(moved, weights, torch.zeros(count, 1, 2, dtype=torch.float64))


def cubic_power(generator: torch.Generator, count: int) -> Cases:
    """(s³, k s) around s = 0: with the query on the tangent, roots of s^5 + a s - c of any multiplicity."""
    k = _noise(generator, count)
    s = torch.tensor([[-1.0, 1.0, -1.0, 1.0], [-1.0, -1 / 3, 1 / 3, 1.0]], dtype=torch.float64).T
    points = s * torch.cat([torch.ones_like(k), k], -1)
    query = torch.cat([_normal(generator, count, 1, 1), k * _normal(generator, count, 1, 1)], -1)
    return Cases(points, torch.ones(count, 4, dtype=torch.float64), query)


def circle_center(generator: torch.Generator, count: int) -> Cases:
    """Arcs of circles and the centre, or nearly: every point is as far. Half are raised to cubics, with K = 4 all."""
    half = (0.05 + 1.4 * _uniform(generator, count)) / 2
    middle = 2 * math.pi * _uniform(generator, count)
    angles = torch.stack([middle - half, middle, middle + half], -1)
    reach = torch.stack([torch.ones_like(half), 1 / half.cos(), torch.ones_like(half)], -1)
    weights = torch.stack([torch.ones_like(half), half.cos(), torch.ones_like(half)], -1)
    points = (torch.stack([angles.cos(), angles.sin()], -1) * reach[..., None]) @ _normal(generator, count, 2, 3)
    # A third are circles, two thirds ellipses.
    plane = torch.eye(2, 3, dtype=torch.float64)
    points[::3] = (torch.stack([angles.cos(), angles.sin()], -1) * reach[..., None])[::3] @ plane
    shift = _noise(generator, count) * _normal(generator, count, 1, 3)
    shift[1::2] += torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)  # on the axis
    center = _normal(generator, count, 1, 3)
    return Cases(*_elevated(points + center, weights), center + shift)


def coincident(generator: torch.Generator, count: int) -> Cases:
    """Two, three or four control points in one place, or nearly."""
    points, weights = _curves(generator, count, 4)
    groups = ([0, 1], [1, 2], [2, 3], [0, 3], [0, 1, 2], [1, 2, 3], [0, 1, 2, 3])
    for i, group in enumerate(groups):
        points[i :: len(groups), group] = points[i :: len(groups), group[:1]]
    points = points + _noise(generator, count) * _normal(generator, count, 4, 3)
    return Cases(points, weights, _normal(generator, count, 1, 3))


def cusp(generator: torch.Generator, count: int) -> Cases:
    """Cubics that stand still inside, at or near the query: p = (t - c)² a + (t - c)³ b."""
    c = 0.1 + 0.8 * _uniform(generator, count, 1)
    a, b = _normal(generator, count, 1, 3), _normal(generator, count, 1, 3)
    t = torch.linspace(0, 1, 4, dtype=torch.float64).expand(count, 4) - c
    values = t[..., None] ** 2 * a + t[..., None] ** 3 * b
    # Control points of the cubic through its values at thirds.
    to_control = torch.tensor(
        [[6, 0, 0, 0], [-5, 18, -9, 2], [2, -9, 18, -5], [0, 0, 0, 6]], dtype=torch.float64
    ) / 6  # fmt: skip
    query = _normal(generator, count, 1, 3)
    query[::2] *= _noise(generator, count)[::2]
    return Cases(to_control @ values, torch.ones(count, 4, dtype=torch.float64), query)


def loop(generator: torch.Generator, count: int) -> Cases:
    """Cubics that cross themselves on their axis of symmetry; queries at the crossing and on the axis."""
    k, h = 2 + 3 * _uniform(generator, count), 0.2 + _uniform(generator, count)
    zero, one = torch.zeros_like(k), torch.ones_like(k)
    x, y = torch.stack([-one, k, -k, one], -1), torch.stack([zero, h, h, zero], -1)
    # x(t) = 0 at (1 - 2 t)² = (3 k - 1 - 4) ... by symmetry at t and 1 - t: 3 (k + 1) t (1 - t) = 1.
    t = (1 - (1 - 4 / (3 * (k + 1))).sqrt()) / 2
    crossing = 3 * h * t * (1 - t)
    crossing[1::2] = _normal(generator, count)[1::2]
    query = torch.stack([zero, crossing], -1)[:, None] + _noise(generator, count) * _normal(generator, count, 1, 2)
    return Cases(torch.stack([x, y], -1), torch.ones(count, 4, dtype=torch.float64), query)


def equally_far(generator: torch.Generator, count: int) -> Cases:
    """Symmetric cubics, queries on the axis: two points are equally far, to rounding."""
    right, weights = _normal(generator, count, 2, 2), _log_uniform(generator, 1, count, 2)
    left = right.flip(1) * torch.tensor([-1.0, 1.0], dtype=torch.float64)
    query = _normal(generator, count, 1, 2) * torch.tensor([0.0, 1.0], dtype=torch.float64)
    shift = _noise(generator, count) * _normal(generator, count, 1, 2)
    return Cases(torch.cat([left, right], 1), torch.cat([weights.flip(1), weights], 1), query + shift)


def evolute(generator: torch.Generator, count: int) -> Cases:
    """Queries at centres of curvature: roots of the stationary polynomial coincide."""
    points, weights = _normal(generator, count, 3, 2), torch.ones(count, 3, dtype=torch.float64)
    t = _uniform(generator, count, 1)
    # p = a t² + b t + c; the curvature is |p' x p''| / |p'|³.
    a, b = points[:, 0] - 2 * points[:, 1] + points[:, 2], 2 * (points[:, 1] - points[:, 0])
    first, second = 2 * a * t + b, 2 * a
    cross = first[:, :1] * second[:, 1:] - first[:, 1:] * second[:, :1]
    normal = torch.stack([-first[:, 1], first[:, 0]], -1)
    center = (a * t + b) * t + points[:, 0] + normal * first.square().sum(-1, keepdim=True) / cross
    # Almost straight curves have their centres of curvature beyond what float64 resolves.
    center = torch.where(center.abs() < 1e3, center, 0.0)
    return Cases(*_elevated(points, weights), center[:, None])


def scaled(generator: torch.Generator, count: int) -> Cases:
    """Curves and queries of sizes from 1e-12 to 1e12, weights times one factor from 1e-6 to 1e6."""
    factor, common = _log_uniform(generator, 12, count, 1, 1), _log_uniform(generator, 6, count, 1)
    points, weights = _curves(generator, count, 4)
    return Cases(factor * points, common * weights, factor * _normal(generator, count, 1, 3))


def far_from_origin(generator: torch.Generator, count: int) -> Cases:
    """Curves of size 1 at up to 1e6 from the origin."""
    place = _normal(generator, count, 1, 3) * _log_uniform(generator, 6, count, 1, 1)
    points, weights = _curves(generator, count, 4)
    return Cases(points + place, weights, place + _normal(generator, count, 1, 3))


def far_query(generator: torch.Generator, count: int) -> Cases:
    """Queries 10 to 1e6 sizes away."""
    away = _normal(generator, count, 1, 3) * 10 ** (1 + 5 * _uniform(generator, count, 1, 1))
    return Cases(*_curves(generator, count, 4), away)


FAMILIES: tuple[Callable[[torch.Generator, int], Cases], ...] = (
    random_line, random_quadratic, random_cubic, plane_cubic, wild_quadratic, wild_cubic, extreme_weights, on_curve,
    straight_even, straight_uneven, elevated_quadratic, elevated_line, singular_quadratic, singular_cubic, cubic_power,
    circle_center, coincident, cusp, loop, equally_far, evolute, scaled, far_from_origin, far_query,
)  # fmt: skip
