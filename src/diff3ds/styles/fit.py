"""Cubic Béziers through rows of points: few of them, within a tolerance, with the corners kept."""

import math
from collections.abc import Iterator

import numpy as np

from diff3ds._shapes import Array, Float

# Where a row of points turns by more (radians), it has a corner: smooth outlines are sampled at a third of that.
CORNER = 0.6
# px. What is nearer to the point before it says nothing about the direction.
SHORTEST = 1e-4
# Of fits with better parameters, before a row is cut in two. [empirical: a third brings nothing]
REPAIRS = 2


def fitted(points: Float[Array, "n 2"], tolerance: float, closed: bool = False) -> Float[Array, "m 4 2"]:
    """Cubics that follow on each other from the first point to the last, or round to the first again.

    A cubic with its inner control points on its chord stands for a straight line (`is_straight`).

    Args:
        tolerance: pixels, kept at the points.
    """
    apart = _lengths(points) > SHORTEST
    points = points[np.concatenate([[True], apart])]
    if closed and len(points) > 1 and np.linalg.norm(points[-1] - points[0]) <= SHORTEST:
        points = points[:-1]
    if len(points) < 2:
        return np.zeros((0, 4, 2))
    if closed:
        points = np.concatenate([points, points[:1]])
    steps = np.diff(points, axis=0)
    angle = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.abs((np.diff(angle) + math.pi) % (2 * math.pi) - math.pi)
    corners = (np.flatnonzero(turn > CORNER) + 1).tolist()
    last = len(points) - 1
    if closed:
        seam = abs((angle[0] - angle[-1] + math.pi) % (2 * math.pi) - math.pi) > CORNER
        if not seam and corners:
            # Begin at a corner: then the seam is a point like any other.
            points = np.concatenate([points[corners[0] : -1], points[: corners[0] + 1]])
            corners = [c - corners[0] for c in corners[1:]]
        elif not seam:
            tangent = _unit(points[1] - points[-2])
            return np.array(list(_smooth(points, tangent, -tangent, tolerance)))
    cubics = []
    for start, stop in zip([0, *corners], [*corners, last], strict=True):
        row = points[start : stop + 1]
        cubics += list(_smooth(row, _end_direction(row), _end_direction(row[::-1]), tolerance))
    return np.array(cubics)


def is_straight(cubic: Float[Array, "4 2"]) -> bool:
    """Whether a cubic of `fitted` stands for a straight line."""
    return bool((cubic[1] == cubic[0]).all())


def _smooth(points: Array, start: Array, stop: Array, tolerance: float) -> Iterator[Array]:
    """Cubics through a row of points without corners; `start` and `stop` point into it at its ends."""
    chord = points[-1] - points[0]
    length = math.hypot(*chord)
    if len(points) == 2 and (length == 0 or min(start @ chord, -(stop @ chord)) > 0.9999 * length):
        yield _straight(points[0], points[-1])
        return
    if length > 0:
        moved = points - points[0]
        off = np.abs(moved[:, 0] * chord[1] - moved[:, 1] * chord[0]).max() / length
        if off < tolerance / 2 and min(start @ chord, -(stop @ chord)) > 0.999 * length:
            yield _straight(points[0], points[-1])
            return
    u = np.concatenate([[0.0], _lengths(points).cumsum()])
    third, u = u[-1] / 3, u / u[-1]
    for _ in range(1 + REPAIRS):
        basis = _basis(u)
        cubic = _least_squares(points, basis, start, stop, third)
        off = basis @ cubic - points
        squared = (off * off).sum(1)
        worst = int(squared.argmax())
        if squared[worst] <= tolerance**2:
            yield cubic
            return
        if squared[worst] > (16 * tolerance) ** 2:
            break
        u = _closer(cubic, off, u)
    if len(points) == 2:
        yield cubic
        return
    cut = min(max(worst, 1), len(points) - 2)
    tangent = _unit(points[cut + 1] - points[cut - 1])
    yield from _smooth(points[: cut + 1], start, -tangent, tolerance)
    yield from _smooth(points[cut:], tangent, stop, tolerance)


def _straight(start: Array, stop: Array) -> Array:
    return np.array([start, start, stop, stop])


def _basis(u: Array) -> Array:
    """The four Bernstein polynomials at u."""
    v = 1 - u
    basis = np.empty((len(u), 4))
    basis[:, 0], basis[:, 1], basis[:, 2], basis[:, 3] = v * v * v, 3 * u * v * v, 3 * u * u * v, u * u * u
    return basis


def _least_squares(points: Array, basis: Array, start: Array, stop: Array, third: float) -> Array:
    """The cubic with these directions at its ends that is nearest to the points; `third` of their length."""
    first, last = points[0], points[-1]
    b1, b2 = basis[:, 1], basis[:, 2]
    # Bernstein polynomials add up to 1.
    near = (basis[:, 0] + b1)[:, None]
    rest = points - last - near * (first - last)
    c = float(start @ stop)
    a11, a12, a22 = float(b1 @ b1), float(b1 @ b2) * c, float(b2 @ b2)
    r1, r2 = float((b1 @ rest) @ start), float((b2 @ rest) @ stop)
    determinant = a11 * a22 - a12 * a12
    alpha = beta = third
    if abs(determinant) > 1e-12 * a11 * a22:
        alpha, beta = (r1 * a22 - r2 * a12) / determinant, (r2 * a11 - r1 * a12) / determinant
    # Handles that point backwards, or far beyond the points, make loops.
    if not (0 < alpha < 4 * third and 0 < beta < 4 * third):
        alpha = beta = third
    return np.array([first, first + alpha * start, last + beta * stop, last])


def _closer(cubic: Array, off: Array, u: Array) -> Array:
    """Parameters after one step of Newton's method towards the closest points, which are off by so much."""
    d = 3 * (cubic[1:] - cubic[:-1])
    e = 2 * (d[1:] - d[:-1])
    v = (1 - u)[:, None]
    w = u[:, None]
    first = v * v * d[0] + 2 * w * v * d[1] + w * w * d[2]
    second = v * e[0] + w * e[1]
    under = (first * first + off * second).sum(1)
    under[np.abs(under) < 1e-12] = np.inf
    moved = u - (off * first).sum(1) / under
    return np.maximum.accumulate(moved.clip(0, 1))


def _lengths(points: Array) -> Array:
    """From each point to the next."""
    steps = points[1:] - points[:-1]
    return np.sqrt((steps * steps).sum(1))


def _end_direction(points: Array) -> Array:
    """The direction in which a smooth row leaves its first point: of the parabola through the first three."""
    first = points[1] - points[0]
    if len(points) < 3:
        return _unit(first)
    a, b = math.dist(points[1], points[0]), math.dist(points[2], points[1])
    return _unit(first / a * (2 * a + b) / (a + b) - (points[2] - points[1]) / b * a / (a + b))


def _unit(vector: Array) -> Array:
    return vector / max(math.hypot(*vector), 1e-300)
