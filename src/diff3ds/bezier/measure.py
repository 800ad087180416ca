"""Measures of rational Bézier curves: arc length, tessellation, bounding box, each to a tolerance or exact."""

import numpy as np
import torch

from diff3ds._checks import check_finite
from diff3ds._shapes import Float, Int, Tensor
from diff3ds.bezier.curves import (
    check_curves,
    evaluate,
    from_homogeneous,
    homogeneous,
    homogeneous_derivatives,
    subcurve_matrix,
)
from diff3ds.bezier.pieces import derivative_numerator, power_coefficients, standard_form, tame_pieces
from diff3ds.bezier.polynomial import polyval, roots_and_separators

DEFAULT_TOLERANCE = 1e-6
# Halvings after which an interval is taken as it is: 2^-48 of a curve is below the resolution of its parameter.
MAX_HALVINGS = 48
# Of distances between float64 numbers, relative to these: some eight times half a unit in the last place.
ROUNDING = 1e-15
_NODES, _NODE_WEIGHTS = (torch.from_numpy(a) for a in np.polynomial.legendre.leggauss(8))


class _Intervals:
    """Parameter intervals of N curves that are halved where they are not yet good enough."""

    def __init__(self, count: int, device: torch.device) -> None:
        self.curve = torch.arange(count, device=device)
        self.start = torch.zeros(count, dtype=torch.float64, device=device)
        self.stop = torch.ones(count, dtype=torch.float64, device=device)

    def control(self, control: Float[Tensor, "N K E"]) -> Float[Tensor, "I K E"]:
        """Homogeneous control points of the intervals."""
        return subcurve_matrix(self.start, self.stop, control.shape[1] - 1) @ control[self.curve]

    def halves(self) -> "_Intervals":
        """Both halves of every interval."""
        both = _Intervals(0, self.curve.device)
        middle = (self.start + self.stop) / 2
        both.curve = torch.cat([self.curve, self.curve])
        both.start, both.stop = torch.cat([self.start, middle]), torch.cat([middle, self.stop])
        return both

    def where(self, rows: Tensor) -> "_Intervals":
        """The intervals of these rows."""
        some = _Intervals(0, self.curve.device)
        some.curve, some.start, some.stop = self.curve[rows], self.start[rows], self.stop[rows]
        return some

    def join(self, others: "list[_Intervals]") -> "_Intervals":
        """These and others, in the order of the curves and along them."""
        parts = [self, *others]
        curve, start, stop = (torch.cat([getattr(p, k) for p in parts]) for k in ("curve", "start", "stop"))
        order = start.argsort(stable=True)
        order = order[curve[order].argsort(stable=True)]
        joined = _Intervals(0, curve.device)
        joined.curve, joined.start, joined.stop = curve[order], start[order], stop[order]
        return joined


def length(
    points: Float[Tensor, "*B K D"],
    weights: Float[Tensor, "*B K"] | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
) -> Float[Tensor, "*B"]:
    """Arc length of the curves, differentiable.

    Gauss-Legendre quadrature with 8 nodes on intervals that are halved until halving changes the length by less
    than tolerance / 4. Not a guarantee: the error has been below the tolerance in all tests.

    Args:
        tolerance: absolute, in the unit of the control points.

    Raises:
        TypeError, ValueError: dtypes or shapes that do not fit, values that are not finite, tolerance not positive.
    """
    points, weights = check_curves(points, weights)
    check_finite(points=points, weights=weights)
    _check_tolerance(tolerance)
    batch = points.shape[:-2]
    control = homogeneous(points.double(), weights.double()).reshape(-1, points.shape[-2], points.shape[-1] + 1)
    with torch.no_grad():
        intervals = _settled_intervals(control, tolerance)
    parts = _quadrature(intervals.control(control))
    total = control.new_zeros(len(control)).index_add(0, intervals.curve, parts)
    return total.reshape(batch).to(points.dtype)


def _settled_intervals(control: Float[Tensor, "N K E"], tolerance: float) -> _Intervals:
    open_ = _Intervals(len(control), control.device)
    whole = _quadrature(open_.control(control))
    done: list[_Intervals] = []
    for _ in range(MAX_HALVINGS):
        halves = open_.halves()
        part = _quadrature(halves.control(control))
        n = len(whole)
        settled = (part[:n] + part[n:] - whole).abs() <= tolerance / 4
        both = torch.cat([settled, settled])
        done.append(halves.where(both))
        open_, whole = halves.where(~both), part[~both]
        if len(whole) == 0:
            break
    return open_.join(done)


def _quadrature(control: Float[Tensor, "I K E"]) -> Float[Tensor, " I"]:
    """Estimated length of curves given by homogeneous control points."""
    t = ((_NODES + 1) / 2).to(control)
    value, first, _ = homogeneous_derivatives(control, t)
    w = value[..., -1:]
    velocity = (first[..., :-1] - value[..., :-1] / w * first[..., -1:]) / w
    # The norm has no derivative where the curve stands still; its square root of zero would give NaN.
    squared = velocity.square().sum(-1)
    moving = squared > 0
    speed = torch.where(moving, torch.where(moving, squared, 1.0).sqrt(), 0.0)
    return speed @ (_NODE_WEIGHTS / 2).to(control)


def tessellate(
    points: Float[Tensor, "N K D"], weights: Float[Tensor, "N K"] | None, tolerance: float
) -> list[tuple[Float[Tensor, " M"], Float[Tensor, "M D"]]]:
    """Polylines that stay within a tolerance of the curves, one (parameters, vertices) for each curve.

    Guaranteed up to rounding of the coordinates in float64: an interval becomes one chord only when the control points
    of that part of the curve, and so the part itself, lie within the tolerance of the chord.

    Args:
        tolerance: distance in the unit of the control points.

    Raises:
        TypeError, ValueError: dtypes or shapes that do not fit, values that are not finite, first or last weights or a
            tolerance not positive.
    """
    points, weights = check_curves(points, weights)
    check_finite(points=points, weights=weights)
    _check_tolerance(tolerance)
    if points.ndim != 3:
        raise ValueError(f"points must have shape (N, K, D), got {tuple(points.shape)}")
    ends = weights.detach()[:, [0, -1]]
    if not bool((ends > 0).all()):
        # Such a curve runs through infinity, or is one with all signs turned; halving would never end.
        raise ValueError(f"the first and last weights of curves must be positive, got {float(ends.min()):g}")
    with torch.no_grad():
        control = homogeneous(points.double(), weights.double())
        intervals = chord_intervals(control, tolerance)
    counts: Int[Tensor, " N"] = torch.bincount(intervals.curve, minlength=len(points))
    starts = torch.split(intervals.start.to(points.dtype), counts.tolist())
    polylines = []
    for curve, start in enumerate(starts):
        t = torch.cat([start, start.new_ones(1)])
        polylines.append((t, evaluate(points[curve], weights[curve], t)))
    return polylines


def chord_intervals(control: Float[Tensor, "N K E"], tolerance: float) -> _Intervals:
    """Intervals, in order along each curve, over which the curve stays within the tolerance of its chord."""
    open_ = _Intervals(len(control), control.device)
    done: list[_Intervals] = []
    for _ in range(MAX_HALVINGS):
        points, weights = from_homogeneous(open_.control(control))
        # The hull argument needs positive weights; where the curve is finite they become so by halving.
        rounding = ROUNDING * points.abs().amax((-2, -1))
        flat = (_distance_to_chord(points) <= rounding.clamp_min(tolerance)) & (weights > 0).all(-1)
        done.append(open_.where(flat))
        open_ = open_.where(~flat).halves()
        if len(open_.curve) == 0:
            break
    return open_.join(done)


def _distance_to_chord(points: Float[Tensor, "I K D"]) -> Float[Tensor, " I"]:
    """Largest distance of the inner control points from the segment between the outer ones."""
    start, chord = points[:, :1], points[:, -1:] - points[:, :1]
    inner = points[:, 1:-1] - start
    if inner.shape[1] == 0:
        return points.new_zeros(len(points))
    along = (inner * chord).sum(-1, keepdim=True) / chord.square().sum(-1, keepdim=True).clamp_min(1e-300)
    distance: Tensor = torch.linalg.vector_norm(inner - along.clamp(0, 1) * chord, dim=-1)
    return distance.amax(-1)


def bounding_box(
    points: Float[Tensor, "*B K D"], weights: Float[Tensor, "*B K"] | None = None
) -> tuple[Float[Tensor, "*B D"], Float[Tensor, "*B D"]]:
    """Smallest and largest coordinates of the curves, exact to rounding (not those of the control points).

    The extremes are real roots of X' W - X W' (degree 2 n - 2), or the ends. Differentiable.

    Raises:
        TypeError, ValueError: dtypes or shapes that do not fit, values that are not finite.
    """
    points, weights = check_curves(points, weights)
    check_finite(points=points, weights=weights)
    low, high = homogeneous_box(homogeneous(points.double(), weights.double()))
    return low.to(points.dtype), high.to(points.dtype)


def homogeneous_box(control: Float[Tensor, "*B K E"]) -> tuple[Float[Tensor, "*B D"], Float[Tensor, "*B D"]]:
    """As `bounding_box` for homogeneous control points; inner weights may be negative where W(t) > 0 on [0, 1]."""
    control, _ = standard_form(control)
    low = torch.full_like(control[..., 0, :-1], torch.inf)
    high = -low
    for piece, *_ in tame_pieces(control):
        coefficients = power_coefficients(piece)
        x, w = coefficients[..., :-1, :], coefficients[..., -1:, :]
        with torch.no_grad():
            near = x - piece[..., 0, :-1, None] * w
            slope = derivative_numerator(near, w)
            s = torch.cat(roots_and_separators(slope), -1) if slope.shape[-1] > 1 else slope
            ends = torch.tensor([-1.0, 1.0]).to(s).expand(*s.shape[:-1], 2)
            s = torch.cat([torch.where(s.abs() <= 1, s, 1.0), ends], -1)
        value = polyval(x, s) / polyval(w.expand_as(x), s)
        low, high = torch.minimum(low, value.amin(-1)), torch.maximum(high, value.amax(-1))
    return low, high


def _check_tolerance(tolerance: float) -> None:
    if not tolerance > 0:
        raise ValueError(f"tolerance must be positive, got {tolerance}")
