"""Splines as chains of rational Bézier curves and back: NURBS, uniform cubic B-splines, Catmull-Rom, polylines; exact.

Every function gives control points (M, K, D) of M segments that follow on each other, in the form that `Sketch` takes
with `Chains.of([M], closed)`.
"""

import torch

from diff3ds._checks import kind
from diff3ds._shapes import Float, Tensor
from diff3ds.bezier.curves import MAX_DEGREE, check_curves, from_homogeneous, homogeneous

# Control points at a joint may differ by so much of the curve's extent, which rounding leaves.
JOINT_GAP = 1e-4


def polyline(points: Float[Tensor, "P D"], closed: bool = False) -> Float[Tensor, "M 2 D"]:
    """Straight segments from each point to the next one, and with `closed` from the last to the first.

    Raises:
        TypeError, ValueError: no tensor of at least two points.
    """
    points = _checked(points, least=2)
    ends = points.roll(-1, 0)
    segments = torch.stack([points, ends], 1)
    return segments if closed else segments[:-1]


def catmull_rom(points: Float[Tensor, "P D"], closed: bool = False, *, alpha: float = 0.5) -> Float[Tensor, "M 4 D"]:
    """Cubics through all points, smooth at each (Catmull and Rom 1974; Barry and Goldman 1988).

    Args:
        alpha: the parameter between two points grows with this power of their distance: 0 is the uniform spline, 0.5
            the centripetal one, which makes no cusps and loops between neighbours (Yuksel et al. 2011), 1 the chordal.

    Raises:
        TypeError, ValueError: no tensor of at least two points (three if closed), neighbours that coincide, or alpha
            outside [0, 1].
    """
    points = _checked(points, least=3 if closed else 2)
    if not 0 <= alpha <= 1:
        raise ValueError(f"alpha must be between 0 and 1, got {alpha}")
    if closed:
        nodes = torch.cat([points[-1:], points, points[:2]])
    else:
        # The ends go on as straight as they began.
        nodes = torch.cat([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    steps = torch.linalg.vector_norm(nodes[1:] - nodes[:-1], dim=-1, keepdim=True)
    if not bool(steps.isfinite().all()):
        raise ValueError("points must be finite, got NaN or infinite values")
    if not bool((steps > 0).all()):
        place = int((steps[:, 0] <= 0).int().argmax())
        raise ValueError(f"neighbouring points must differ, points {max(place - 1, 0)} and {max(place, 1)} coincide")
    d = steps**alpha
    before, here, after = d[:-2], d[1:-1], d[2:]
    p0, p1, p2, p3 = nodes[:-3], nodes[1:-2], nodes[2:-1], nodes[3:]
    # Derivatives at p1 and p2 with respect to the parameter, times the interval between them.
    first = here * ((p1 - p0) / before - (p2 - p0) / (before + here) + (p2 - p1) / here)
    last = here * ((p2 - p1) / here - (p3 - p1) / (here + after) + (p3 - p2) / after)
    return torch.stack([p1, p1 + first / 3, p2 - last / 3, p2], 1)


def b_spline(points: Float[Tensor, "P D"], closed: bool = False) -> Float[Tensor, "M 4 D"]:
    """The uniform cubic B-spline with these control points: M = P segments if closed, else P - 3, all smooth (C2).

    Raises:
        TypeError, ValueError: no tensor of at least four points (three if closed).
    """
    points = _checked(points, least=3 if closed else 4)
    nodes = torch.cat([points[-1:], points, points[:2]]) if closed else points
    a, b, c, d = nodes[:-3], nodes[1:-2], nodes[2:-1], nodes[3:]
    return torch.stack([(a + 4 * b + c) / 6, (2 * b + c) / 3, (b + 2 * c) / 3, (b + 4 * c + d) / 6], 1)


def from_nurbs(
    points: Float[Tensor, "P D"], weights: Float[Tensor, " P"] | None, knots: Float[Tensor, " L"]
) -> tuple[Float[Tensor, "M K D"], Float[Tensor, "M K"]]:
    """The segments of a NURBS curve of degree 1, 2 or 3, as control points and weights.

    Args:
        weights: positive; None for a B-spline.
        knots: not decreasing, P + degree + 1 of them; they need not be clamped. A segment for every interval in which
            the curve is defined.

    Raises:
        TypeError, ValueError: shapes that do not fit, a degree out of range, or knots that decrease.
    """
    points = _checked(points, least=2)
    weights = points.new_ones(len(points)) if weights is None else weights
    for name, value in (("weights", weights), ("knots", knots)):
        if not isinstance(value, Tensor) or not value.is_floating_point():
            raise TypeError(f"{name} must be a floating point tensor, got {kind(value)}")
    degree = len(knots) - len(points) - 1
    if not 1 <= degree <= MAX_DEGREE:
        raise ValueError(
            f"knots must be {len(points)} + degree + 1 numbers for {len(points)} points, of degree 1 to {MAX_DEGREE}, "
            f"got {len(knots)}"
        )
    if weights.shape != points.shape[:1] or not bool((weights > 0).all()):
        raise ValueError(f"weights must be {len(points)} positive numbers, got {tuple(weights.shape)}")
    knots = knots.to(points)
    if not bool((knots[1:] >= knots[:-1]).all()):
        raise ValueError("knots must not decrease")
    control = homogeneous(points, weights)
    inner = torch.arange(degree, len(points), device=points.device)
    inner = inner[knots[inner + 1] > knots[inner]]
    if not len(inner):
        raise ValueError("the curve is defined nowhere: all its knots are the same")
    start, stop = knots[inner], knots[inner + 1]
    rows = [_blossom(control, knots, inner, degree, start, stop, i) for i in range(degree + 1)]
    return from_homogeneous(torch.stack(rows, 1))


def _blossom(
    control: Tensor, knots: Tensor, interval: Tensor, degree: int, start: Tensor, stop: Tensor, stops: int
) -> Float[Tensor, "M E"]:
    """The polar form of each interval's polynomial at start and, `stops` times, at stop: a Bézier control point."""
    places = interval[:, None] - degree + torch.arange(degree + 1, device=control.device)
    values = control[places]
    for level in range(1, degree + 1):
        t = stop if level <= stops else start
        low = knots[places[:, level:]]
        high = knots[places[:, level:] + degree + 1 - level]
        ratio = ((t[:, None] - low) / (high - low))[..., None]
        values = (1 - ratio) * values[:, :-1] + ratio * values[:, 1:]
    return values[:, 0]


def to_nurbs(
    points: Float[Tensor, "M K D"], weights: Float[Tensor, "M K"] | None = None
) -> tuple[Float[Tensor, "P D"], Float[Tensor, " P"], Float[Tensor, " L"]]:
    """One NURBS curve of segments that follow on each other: control points, weights and clamped knots 0, 1, .., M.

    Inner knots have the multiplicity of the degree. Weights of a segment are all scaled so that they go on from those
    of the one before, which changes no point.

    Raises:
        TypeError, ValueError: as `evaluate`; a segment that does not begin where the one before it ends.
    """
    points, weights = check_curves(points, weights)
    if points.ndim != 3 or not len(points):
        raise ValueError(f"points must have shape (M, K, D) with at least one segment, got {tuple(points.shape)}")
    count, degree = len(points), points.shape[1] - 1
    if not bool((weights > 0).all()):
        raise ValueError("weights must be positive")
    gap = (points[1:, 0] - points[:-1, -1]).abs().amax(-1)
    extent = (points.amax(1) - points.amin(1)).amax(-1)
    apart = gap > JOINT_GAP * torch.maximum(extent[1:], extent[:-1])
    if bool(apart.any()):
        place = int(apart.int().argmax())
        raise ValueError(
            f"segment {place + 1} must begin where segment {place} ends, they are {gap[place].item():g} apart"
        )
    scale = torch.cat([weights.new_ones(1), (weights[:-1, -1] / weights[1:, 0]).cumprod(0)])
    scaled = weights * scale[:, None]
    knots = torch.arange(count + 1, dtype=points.dtype, device=points.device).repeat_interleave(degree)
    return (
        torch.cat([points[:1, 0], points[:, 1:].flatten(0, 1)]),
        torch.cat([scaled[:1, 0], scaled[:, 1:].flatten()]),
        torch.cat([knots[:1], knots, knots[-1:]]),
    )


def _checked(points: Tensor, least: int) -> Tensor:
    if not isinstance(points, Tensor) or not points.is_floating_point():
        raise TypeError(f"points must be a floating point tensor, got {kind(points)}")
    if points.ndim != 2 or len(points) < least:
        raise ValueError(f"points must have shape (P, D) with at least {least} points, got {tuple(points.shape)}")
    return points
