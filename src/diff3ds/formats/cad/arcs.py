"""Arcs of circles and ellipses along points: found by least squares, and taken if all points lie on them."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Float
from diff3ds.bezier.conics import axes_of_conic
from diff3ds.curves.directions import cross

Vector = Float[NDArray[np.float64], " 3"]

# Of the size of an arc: with a shorter chord, ends tell less of a circle than the points between them. It is that of
# 95 % of a circle.
SHORT_CHORD = 0.15
EPS = float(np.finfo(np.float64).eps)


class Arc(NamedTuple):
    """center + cos t major + sin t minor for t from start to stop, radians.

    The axes are at right angles; the first is not shorter than the second, and as long where the arc is circular. It
    begins in [0, 2 pi), circular ones at 0; a whole circle or ellipse goes from 0 to 2 pi exactly.
    """

    center: Vector
    major: Vector
    minor: Vector
    start: float
    stop: float
    circular: bool = False

    @property
    def whole(self) -> bool:
        """Whether it goes all round."""
        return self.start == 0 and self.stop == 2 * math.pi

    def at(self, t: float) -> Vector:
        """The point of a parameter."""
        return self.center + math.cos(t) * self.major + math.sin(t) * self.minor


def arc_along(
    points: Float[NDArray[np.float64], "P 3"], tolerance: float, far: float, circular: bool
) -> tuple[Arc, float] | None:
    """The arc along points in their order, with how far they lie off it at most; None if that is over the tolerance.

    It begins at the first point and ends at the last one; circles but for a small gap within the tolerance.

    Args:
        far: the largest coordinate of the points' origin: numbers that rounding makes uncertain by more than the
            tolerance, such as huge radii of what is nearly straight, give None.
        circular: whether to look for a circle, or an ellipse.
    """
    middle = points.mean(0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
    if not spread[1] > EPS * spread[0]:
        return None
    gap = float(np.linalg.norm(points[-1] - points[0]))
    found = _circle(points, axes, gap) if circular else _ellipse(points, middle, axes, gap <= tolerance)
    if found is None:
        return None
    center, major, minor = found
    size = float(np.linalg.norm(major))
    if not 4 * EPS * (far + size + float(np.linalg.norm(center))) <= tolerance < float(np.linalg.norm(minor)):
        return None
    return _checked(points, Arc(center, major, minor, 0.0, 0.0, circular), tolerance, gap)


def _checked(
    points: Float[NDArray[np.float64], "P 3"], arc: Arc, tolerance: float, gap: float
) -> tuple[Arc, float] | None:
    """The arc from the first point to the last one, if all lie on it in their order, and it is not more than whole."""
    center, major, minor = arc.center, arc.major, arc.minor
    from_center = points - center
    if cross(from_center[:-1], from_center[1:]).sum(0) @ cross(major, minor) < 0:
        minor = -minor
    angle = np.arctan2(from_center @ minor / (minor @ minor), from_center @ major / (major @ major))
    angle = np.unwrap(angle)
    turn, slack = float(angle[-1] - angle[0]), tolerance / float(np.linalg.norm(minor))
    near = np.cos(angle)[:, None] * major + np.sin(angle)[:, None] * minor
    off = float(np.linalg.norm(near - from_center, axis=1).max())
    if not (off <= tolerance and (np.diff(angle) >= -slack).all() and 0 < turn <= 2 * math.pi + slack):
        return None
    if gap <= tolerance and turn > math.pi:
        return Arc(center, major, minor, 0.0, 2 * math.pi, arc.circular), off
    start = 0.0 if arc.circular else float(angle[0]) % (2 * math.pi)
    return Arc(center, major, minor, start, start + turn, arc.circular), off


def _circle(
    points: Float[NDArray[np.float64], "P 3"], axes: Float[NDArray[np.float64], "3 3"], gap: float
) -> tuple[Vector, Vector, Vector] | None:
    """Centre and axes of the circle of least squares, of which the first points to the first point."""
    normal, middle = axes[2], (points[0] + points[-1]) / 2
    if gap > SHORT_CHORD * float(np.ptp(points, axis=0).max()):
        # It goes through both ends: only how far the centre is from the chord is not known, and found by Kåsa's fit.
        along = (points[-1] - points[0]) / gap
        across = cross(normal, along)
        across /= np.linalg.norm(across)
        normal = cross(along, across)
        rise = (points - middle) @ across
        power = ((points - points[0]) * (points - points[-1])).sum(1)
        # Of a straight line there is no circle.
        if not rise @ rise > 0:
            return None
        center = middle + (rise @ power) / (2 * rise @ rise) * across
        major = points[0] - center
        return center, major, cross(normal, major)
    x = (points - middle) @ axes[:2].T
    design = np.column_stack([2 * x, np.ones(len(x))])
    a, b, c = np.linalg.lstsq(design, (x**2).sum(1), rcond=None)[0]
    center = middle + a * axes[0] + b * axes[1]
    # Within the plane, as long as the radius.
    major = cross(cross(normal, points[0] - center), normal)
    square, far = c + a * a + b * b, float(np.linalg.norm(major))
    if not (square > 0 and far > 0):
        return None
    major *= math.sqrt(square) / far
    return center, major, cross(normal, major)


def _ellipse(
    points: Float[NDArray[np.float64], "P 3"], middle: Vector, axes: Float[NDArray[np.float64], "3 3"], closed: bool
) -> tuple[Vector, Vector, Vector] | None:
    """Centre and axes of the ellipse of least algebraic distance through both ends, the longer axis first."""
    size = float(np.ptp(points, axis=0).max())
    x, y = ((points - middle) @ axes[:2].T / size).T
    design = np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], 1)
    ends = design[:1] if closed else design[[0, -1]]
    through_ends = np.linalg.svd(ends)[2][len(ends) :].T
    conic = through_ends @ np.linalg.svd(design @ through_ends, full_matrices=False)[2][-1]
    found = axes_of_conic(*conic)
    if found is None:
        return None
    center, half, turn = found
    major, minor = size * (half * turn).T @ axes[:2]
    return middle + size * center @ axes[:2], major, minor
