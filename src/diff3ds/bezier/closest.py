"""The closest point of rational Bézier curves, by isolator polynomials (the exact method of the paper).

For a query q, half the derivative of |p(t) - q|² times W(t)³ is the stationary polynomial of degree 3n - 2:
(X - q W) · (X' W - X W'), with p = X / W (docs/explanation/mathematics.md, eq. 3). All its real roots in the
interval and both ends are compared; nothing is sampled and nothing is iterated from a guess.
"""

from typing import NamedTuple

import torch

from diff3ds._checks import check_finite
from diff3ds._modes import transformed
from diff3ds._shapes import Float, Tensor
from diff3ds.bezier.curves import bernstein, check_curves, homogeneous
from diff3ds.bezier.pieces import (
    TAME_RATIO,
    derivative_numerator,
    from_standard,
    inner_weight,
    power_coefficients,
    standard_form,
    tame_pieces,
)
from diff3ds.bezier.polynomial import multiply, polyval, roots_and_separators

# Rows (curve, query) solved at a time: some 2 kB of intermediate results each.
CHUNK = 32768


class ClosestPoint(NamedTuple):
    """Parameter, position and distance of the closest point, one for each query."""

    t: Tensor
    point: Tensor
    distance: Tensor


def closest_point(
    points: Float[Tensor, "*B K D"], weights: Float[Tensor, "*B K"] | None, query: Float[Tensor, "*C Q D"]
) -> ClosestPoint:
    """The point of each curve that is closest to each query, globally.

    Args:
        points: control points of curves of degree 1, 2 or 3.
        weights: positive weights (None: all one); a ratio of 1e6 between them costs no accuracy.
        query: positions; the batch axes broadcast with those of the curves.

    Returns:
        t (..., Q) in [0, 1], point (..., Q, D) and distance (..., Q), differentiable with respect to all arguments
        (t by the implicit function theorem; at an end of the curve and where t is not unique it is constant).
        The distance exceeds the true one by at most 1e-9 of the curve's size in float64. Between points equally
        far, one is chosen. float32 curves are solved in float64.

    Raises:
        TypeError, ValueError: dtypes or shapes that do not fit, weights that are not positive, values that are not
            finite.
    """
    points, weights = check_curves(points, weights)
    if not isinstance(query, Tensor) or query.ndim < 2 or query.shape[-1] != points.shape[-1]:
        got = tuple(query.shape) if isinstance(query, Tensor) else type(query).__name__
        raise ValueError(f"query must have shape (..., Q, {points.shape[-1]}), got {got}")
    if not bool((weights > 0).all()):
        raise ValueError(f"weights must be positive, got {weights.min().item()}")
    check_finite(points=points, weights=weights, query=query)
    _check_batches(points.shape[:-2], query.shape[:-2])
    control = homogeneous(points.double(), weights.double())
    t = closest_parameter(control, query.double())
    t = differentiable_parameter(control, query.double(), t)
    basis = bernstein(t, points.shape[-2] - 1) @ control
    point = basis[..., :-1] / basis[..., -1:]
    distance = torch.linalg.vector_norm(query - point, dim=-1)
    return ClosestPoint(t.to(points.dtype), point.to(points.dtype), distance.to(points.dtype))


def _check_batches(curves: torch.Size, queries: torch.Size) -> None:
    for one, other in zip(reversed(curves), reversed(queries), strict=False):
        if one != other and 1 not in (one, other):
            raise ValueError(
                f"the batch axes of query, {tuple(queries)}, must broadcast with the curves', {tuple(curves)}"
            )


@torch.no_grad()
def closest_parameter(control: Float[Tensor, "*B K E"], query: Float[Tensor, "*C Q D"]) -> Float[Tensor, "*F Q"]:
    """Parameters of the closest points of curves X(t) / W(t) given by homogeneous control points, float64.

    Only W(t) > 0 on [0, 1] is needed, inner weights may be negative. No gradients, no checks.
    """
    # Forward mode goes on inside no_grad.
    control, query = control.detach(), query.detach()
    both = torch.broadcast_tensors(control[..., :1, 0], query[..., :1, 0])  # type: ignore[no-untyped-call]
    batch = both[0].shape[:-1]
    k, e = control.shape[-2:]
    rows = control[..., None, :, :].expand(*batch, query.shape[-2], k, e).reshape(-1, k, e)
    targets = query.expand(*batch, *query.shape[-2:]).reshape(-1, e - 1)
    parts = zip(torch.split(rows, CHUNK), torch.split(targets, CHUNK), strict=True)
    solved = [_solve_rows(*part) for part in parts]
    t = torch.cat(solved) if solved else targets.new_zeros(0)
    return t.reshape(*batch, query.shape[-2])


def differentiable_parameter(
    control: Float[Tensor, "*B K E"], query: Float[Tensor, "*C Q D"], t: Float[Tensor, "*F Q"]
) -> Float[Tensor, "*F Q"]:
    """T of closest points with its derivatives, by Newton's steps on the stationary equation (docs eq. 6).

    The steps leave the value as it is. Each doubles the order up to which derivatives are exact: after two, first to
    third ones. At the ends and where the equation is singular (the centre of a circle, a cusp) no derivative exists
    and none is given.
    """
    t = t.detach()
    if not (transformed() or (torch.is_grad_enabled() and (control.requires_grad or query.requires_grad))):
        return t
    residual, slope, speed2 = _stationary(control, query, t)
    # Below 1e-6 of the squared speed the answer hangs on rounding.
    free = ((t > 0) & (t < 1) & (slope > 1e-6 * speed2)).detach()
    rest = residual.detach()
    moved = t - torch.where(free, (residual - rest) / torch.where(free, slope, 1.0), 0.0)
    residual, slope, _ = _stationary(control, query, moved)
    return moved - torch.where(free, (residual - rest) / torch.where(free, slope, 1.0), 0.0)


def _stationary(
    control: Float[Tensor, "*B K E"], query: Float[Tensor, "*C Q D"], t: Float[Tensor, "*F Q"]
) -> tuple[Float[Tensor, "*F Q"], Float[Tensor, "*F Q"], Float[Tensor, "*F Q"]]:
    """Half the derivative of |p(t) - q|², its derivative, and the squared speed."""
    n = control.shape[-2] - 1
    step = n * (control[..., 1:, :] - control[..., :-1, :])
    value, first = bernstein(t, n) @ control, bernstein(t, n - 1) @ step
    w, dw = value[..., -1:], first[..., -1:]
    p = value[..., :-1] / w
    velocity = (first[..., :-1] - p * dw) / w
    bend = torch.zeros_like(value)
    if n > 1:
        bend = bernstein(t, n - 2) @ ((n - 1) * (step[..., 1:, :] - step[..., :-1, :]))
    acceleration = (bend[..., :-1] - 2 * velocity * dw - p * bend[..., -1:]) / w
    speed2 = (velocity * velocity).sum(-1)
    away = p - query
    return (away * velocity).sum(-1), speed2 + (away * acceleration).sum(-1), speed2


def _solve_rows(control: Float[Tensor, "R K E"], query: Float[Tensor, "R D"]) -> Float[Tensor, " R"]:
    """T of the closest point, one curve and one query a row."""
    weights = control[..., -1:]
    relative = torch.cat([control[..., :-1] - query[:, None, :] * weights, weights], -1)
    relative, c = standard_form(relative)
    u = relative.new_empty(len(relative))
    wild = inner_weight(relative) > TAME_RATIO
    for rows in (~wild, wild):
        if bool(rows.any()):
            u[rows] = _solve_pieces(relative[rows])
    return from_standard(u, c)


def _solve_pieces(relative: Float[Tensor, "R K E"]) -> Float[Tensor, " R"]:
    """Parameter of the point closest to the origin of curves in standard form, the best over tame pieces."""
    best_u = relative.new_zeros(len(relative))
    best = torch.full_like(best_u, torch.inf)
    for piece, c, start, stop in tame_pieces(relative):
        u, distance2 = _solve_tame(piece)
        u = start + (stop - start) * from_standard(u, c)
        closer = distance2 < best
        best_u, best = torch.where(closer, u, best_u), torch.where(closer, distance2, best)
    return best_u


def _solve_tame(relative: Float[Tensor, "R K E"]) -> tuple[Float[Tensor, " R"], Float[Tensor, " R"]]:
    """Parameter in [0, 1] and squared distance to the origin of the closest point of tame curves."""
    coefficients = power_coefficients(relative)
    x, w = coefficients[:, :-1], coefficients[:, -1:]
    # X' W - X W' does not change when the curve is moved; near the first control point it loses no digits.
    near = x - relative[:, 0, :-1, None] * w
    stationary = multiply(x, derivative_numerator(near, w)).sum(1)
    roots, separators = roots_and_separators(stationary)
    ends = torch.tensor([-1.0, 1.0]).to(roots).expand(len(roots), 2)
    candidates = torch.cat([roots, separators, ends], -1)
    candidates = torch.where(candidates.isnan(), -1.0, candidates)
    position = polyval(coefficients, candidates[:, None].expand(-1, coefficients.shape[1], -1))
    distance2 = (position[:, :-1] / position[:, -1:]).square().sum(1)
    nearest = distance2.argmin(-1, keepdim=True)
    return (candidates.gather(-1, nearest)[:, 0] + 1) / 2, distance2.gather(-1, nearest)[:, 0]
