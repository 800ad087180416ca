"""Rational Bézier curves of degree 1, 2 and 3 as tensors: evaluate, differentiate, elevate, split, cut."""

import math
from itertools import pairwise
from typing import Any, overload

import numpy as np
import torch

from diff3ds._checks import kind
from diff3ds._shapes import Array, Float, Tensor

MAX_DEGREE = 3


def check_curves(points: Tensor, weights: Tensor | None) -> tuple[Tensor, Tensor]:
    """The curves with their weights (ones if None) on the same dtype and device.

    Raises:
        TypeError: points or weights are not floating point tensors.
        ValueError: not 2, 3 or 4 control points, or weights of another shape.
    """
    if not isinstance(points, Tensor) or not points.is_floating_point():
        raise TypeError(f"points must be a floating point tensor, got {kind(points)}")
    if points.ndim < 2 or not 2 <= points.shape[-2] <= MAX_DEGREE + 1:
        raise ValueError(
            f"points must have shape (..., K, D) with K = 2, 3 or 4 control points, got {tuple(points.shape)}"
        )
    if weights is None:
        return points, points.new_ones(points.shape[:-1])
    if not isinstance(weights, Tensor) or not weights.is_floating_point():
        raise TypeError(f"weights must be a floating point tensor, got {kind(weights)}")
    if weights.shape != points.shape[:-1]:
        raise ValueError(f"weights must have shape {tuple(points.shape[:-1])}, got {tuple(weights.shape)}")
    return points, weights


@overload
def bernstein(t: Tensor, degree: int) -> Tensor: ...


@overload
def bernstein(t: Array, degree: int) -> Array: ...


def bernstein(t: Tensor | Array, degree: int) -> Tensor | Array:
    """The degree + 1 Bernstein polynomials at t, of any shape, along a last axis more."""
    s = 1 - t
    parts: Any = [math.comb(degree, i) * s ** (degree - i) * t**i for i in range(degree + 1)]
    return torch.stack(parts, -1) if isinstance(t, Tensor) else np.stack(parts, -1)


def homogeneous(points: Float[Tensor, "*B K D"], weights: Float[Tensor, "*B K"]) -> Float[Tensor, "*B K E"]:
    """Homogeneous control points (w P, w), E = D + 1: a polynomial Bézier curve one dimension up."""
    return torch.cat([points * weights[..., None], weights[..., None]], -1)


def from_homogeneous(
    control: Float[Tensor, "*B K E"],
) -> tuple[Float[Tensor, "*B K D"], Float[Tensor, "*B K"]]:
    """Control points and weights of homogeneous control points whose last coordinate is positive."""
    weights = control[..., -1]
    return control[..., :-1] / weights[..., None], weights


def homogeneous_derivatives(
    control: Float[Tensor, "*B K E"], t: Float[Tensor, "*C M"]
) -> tuple[Tensor, Tensor, Tensor]:
    """Value, first and second derivative at t, (..., M, E) each, of the polynomial curve with these controls."""
    n = control.shape[-2] - 1
    value = bernstein(t, n) @ control
    step = n * (control[..., 1:, :] - control[..., :-1, :])
    first = bernstein(t, n - 1) @ step
    if n == 1:
        return value, first, torch.zeros_like(value)
    bend = (n - 1) * (step[..., 1:, :] - step[..., :-1, :])
    return value, first, bernstein(t, n - 2) @ bend


def evaluate(
    points: Float[Tensor, "*B K D"], weights: Float[Tensor, "*B K"] | None, t: Float[Tensor, "*C M"]
) -> Float[Tensor, "*E M D"]:
    """Points of the curves at parameters t.

    Args:
        points: control points, K = degree + 1 in 2, 3, 4.
        weights: positive rational weights; None for a polynomial curve.
        t: parameters, usually in [0, 1]; the batch axes broadcast with those of the curves.

    Returns:
        Positions in the unit of the control points; NaN where those are not finite: values are not looked at here,
        which would wait for a GPU.

    Raises:
        TypeError, ValueError: dtypes or shapes that do not fit.
    """
    points, weights = check_curves(points, weights)
    basis = bernstein(t, points.shape[-2] - 1) * weights[..., None, :]
    return (basis @ points) / basis.sum(-1, keepdim=True)


def derivatives(
    points: Float[Tensor, "*B K D"], weights: Float[Tensor, "*B K"] | None, t: Float[Tensor, "*C M"]
) -> tuple[Float[Tensor, "*E M D"], Float[Tensor, "*E M D"]]:
    """First and second derivative with respect to t, by the quotient rule. Arguments and errors as `evaluate`."""
    points, weights = check_curves(points, weights)
    # Relative to the first control point: far from the origin the quotient rule would cancel digits.
    origin = points[..., :1, :]
    value, first, second = homogeneous_derivatives(homogeneous(points - origin, weights), t)
    w = value[..., -1:]
    p = value[..., :-1] / w
    velocity = (first[..., :-1] - p * first[..., -1:]) / w
    acceleration = (second[..., :-1] - 2 * velocity * first[..., -1:] - p * second[..., -1:]) / w
    return velocity, acceleration


def elevate(
    points: Float[Tensor, "*B K D"], weights: Float[Tensor, "*B K"] | None, degree: int = MAX_DEGREE
) -> tuple[Float[Tensor, "*B L D"], Float[Tensor, "*B L"]]:
    """The same curves and parametrisation with degree + 1 control points.

    Raises:
        ValueError: the curve already has a higher degree (it cannot be lowered without changing it).
    """
    points, weights = check_curves(points, weights)
    n = points.shape[-2] - 1
    if not n <= degree <= MAX_DEGREE:
        raise ValueError(f"degree must lie between the curve's degree {n} and {MAX_DEGREE}, got {degree}")
    if n == degree:
        return points, weights
    return from_homogeneous(elevate_homogeneous(homogeneous(points, weights), degree))


def elevate_homogeneous(control: Float[Tensor, "*B K E"], degree: int = MAX_DEGREE) -> Float[Tensor, "*B L E"]:
    """As `elevate` for homogeneous control points; no checks."""
    for m in range(control.shape[-2], degree + 1):
        share = torch.arange(1, m, dtype=control.dtype, device=control.device)[:, None] / m
        inner = share * control[..., :-1, :] + (1 - share) * control[..., 1:, :]
        control = torch.cat([control[..., :1, :], inner, control[..., -1:, :]], -2)
    return control


def subcurve_matrix(start: Float[Tensor, "*B"], stop: Float[Tensor, "*B"], degree: int) -> Float[Tensor, "*B K K"]:
    """Matrix from the (homogeneous) control points of a curve to those of its part from start to stop.

    Row i is the blossom of the Bernstein basis at (start, ..., start, stop, ..., stop), stop taken i times.
    All entries are non-negative for parameters in [0, 1]: the cut loses no digits.
    """
    rows: list[Tensor] = []
    before, beyond = 1 - start, 1 - stop
    for i in range(degree + 1):
        row = [torch.ones_like(start)]
        for k in range(degree):
            s, t = (beyond, stop) if k < i else (before, start)
            inner = [one * t + other * s for one, other in pairwise(row)]
            row = [row[0] * s, *inner, row[-1] * t]
        rows += row
    return torch.stack(rows, -1).reshape(*start.shape, degree + 1, degree + 1)


def subcurve(
    points: Float[Tensor, "*B K D"],
    weights: Float[Tensor, "*B K"] | None,
    start: float | Float[Tensor, "*C"],
    stop: float | Float[Tensor, "*C"],
) -> tuple[Float[Tensor, "*E K D"], Float[Tensor, "*E K"]]:
    """The parts of the curves from parameter start to stop, as curves of their own; start > stop turns them round.

    Parameters are numbers or tensors that broadcast with the batch of curves. Errors as `evaluate`.
    """
    points, weights = check_curves(points, weights)
    a = torch.as_tensor(start, dtype=points.dtype, device=points.device)
    b = torch.as_tensor(stop, dtype=points.dtype, device=points.device)
    a, b = torch.broadcast_tensors(a, b)  # type: ignore[no-untyped-call]
    return from_homogeneous(subcurve_matrix(a, b, points.shape[-2] - 1) @ homogeneous(points, weights))


def split(
    points: Float[Tensor, "*B K D"], weights: Float[Tensor, "*B K"] | None, t: float | Float[Tensor, "*C"]
) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
    """The parts before and after t, each as (control points, weights). Errors as `evaluate`."""
    return subcurve(points, weights, 0.0, t), subcurve(points, weights, t, 1.0)
