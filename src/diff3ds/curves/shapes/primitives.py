"""Lines, circular arcs and cubics fitted to points in space, as control points of cubics."""

from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import unit
from diff3ds.curves.fit_cubics import fit_points

# [px; empirical] Scatter of triangulated points about the curve that they lie on.
POINT_SCATTER = 0.45
# [rounds; numerical] Iterations of the geometric circle fit.
CIRCLE_ROUNDS = 10
# [ratio; numerical] Relative to the radius, a step that changes nothing any more: some roundings.
SETTLED = 1e-12
# [ratio, rad; empirical] Angles of points that run around in one direction spread no farther than this times the sweep,
# and so much more.
ONE_WAY, WAVERING = 1.1, 0.1
# [rad; derived] The largest sweep of an arc that one rational cubic can draw is 240 degrees (its inner weights vanish
# there).
MOST_SWEEP = np.deg2rad(200.0)
# [rad; empirical] Arcs of more than this are whole circles: a gap this short is a lack of points.
CLOSED = np.deg2rad(320.0)


class Kind(IntEnum):
    """What a curve is."""

    LINE = 0
    ARC = 1
    FREE = 2
    ELLIPTIC_ARC = 3
    CIRCLE = 4
    ELLIPSE = 5


# The closed kinds, each with that of its parts.
CLOSED_KINDS = {Kind.CIRCLE: Kind.ARC, Kind.ELLIPSE: Kind.ELLIPTIC_ARC}
# Free numbers of each kind: its price when several kinds fit. Closed curves cost what their parts do.
FREEDOM = {Kind.LINE: 6, Kind.ARC: 8, Kind.FREE: 12, Kind.ELLIPTIC_ARC: 10, Kind.CIRCLE: 8, Kind.ELLIPSE: 10}


@dataclass(frozen=True, eq=False)
class Primitive:
    """A curve fitted to points.

    Attributes:
        kind: what it is.
        control: control points of a cubic; of an arc of a circle or an ellipse, those of the rational cubic (see
            `arc_control`), and of a whole one those of one half.
        distances: of the fitted points, world units.
    """

    kind: Kind
    control: Float[Array, "4 3"]
    distances: Float[Array, " M"]


def fit_line(points: Float[Array, "M 3"]) -> Primitive:
    """The line of least squares, between the projections of the first and the last point."""
    middle = points.mean(0)
    axis = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    along = (points - middle) @ axis
    ends = middle + np.outer(along[[0, -1]], axis)
    off = points - middle - np.outer(along, axis)
    return Primitive(Kind.LINE, line_control(ends[0], ends[1]), np.linalg.norm(off, axis=1))


def line_control(start: Float[Array, " 3"], stop: Float[Array, " 3"]) -> Float[Array, "4 3"]:
    """Control points of a straight cubic with even speed."""
    return start + np.linspace(0, 1, 4)[:, None] * (stop - start)


def fit_arcs(points: Float[Array, "M 3"], least_rise: float = 0.0) -> list[Primitive]:
    """The circle of least squares, from the first to the last point: one arc, two where it is long, or all of it.

    Nothing if the points do not run around a circle in one direction, or rise over their chord by less than
    `least_rise`, world units.
    """
    return arcs_on(fit_circle(points), points, least_rise)


def arcs_on(circle: "Circle | None", points: Float[Array, "M 3"], least_rise: float = 0.0) -> list[Primitive]:
    """The arcs of `fit_arcs` on the circle that was fitted to the points; nothing of None."""
    if circle is None:
        return []
    center, u, v, radius, distances = circle
    flat = points - center
    angle = np.unwrap(np.arctan2(flat @ v, flat @ u))
    sweep = abs(angle[-1] - angle[0])
    if radius * (1 - np.cos(min(sweep, np.pi) / 2)) < max(least_rise, 1e-6):
        return []
    return arcs_along(Kind.CIRCLE, center, radius * u, radius * v, angle, distances)


def arcs_along(
    kind: Kind, center: Array, u: Array, v: Array, angle: Float[Array, " M"], distances: Float[Array, " M"]
) -> list[Primitive]:
    """Of center + u cos(angle) + v sin(angle), from the first to the last angle: one arc, two if long, or all of it.

    Nothing if the angles do not go in one direction.

    Args:
        kind: of the whole curve.
    """
    start, stop = angle[0], angle[-1]
    sweep = stop - start
    if np.ptp(angle) > ONE_WAY * abs(sweep) + WAVERING:
        return []
    if abs(sweep) > CLOSED:
        return [Primitive(kind, arc_control(center, u, v, start, start + np.copysign(np.pi, sweep)), distances)]
    cuts = np.linspace(start, stop, 2 if abs(sweep) <= MOST_SWEEP else 3)
    part = CLOSED_KINDS[kind]
    return [Primitive(part, arc_control(center, u, v, a, b), distances) for a, b in pairwise(cuts)]


class Circle(NamedTuple):
    """A circle fitted to points: centre, two orthogonal unit vectors of its plane, radius, distances of the points."""

    center: Float[Array, " 3"]
    u: Float[Array, " 3"]
    v: Float[Array, " 3"]
    radius: float
    distances: Float[Array, " M"]


def whole_circle(circle: Circle) -> Primitive:
    """The circle as a curve."""
    u, v = circle.radius * circle.u, circle.radius * circle.v
    return Primitive(Kind.CIRCLE, arc_control(circle.center, u, v, 0.0, np.pi), circle.distances)


def circle_of(control: Float[Array, "4 3"]) -> Circle:
    """The circle of which these are the control points of one half."""
    center = (control[0] + control[3]) / 2
    u, v = unit(control[0] - center), unit(control[1:3].mean(0) - center)
    return Circle(center, u, v, float(np.linalg.norm(control[0] - center)), np.zeros(0))


def angles_of(circle: Circle, x: Float[Array, "S 3"]) -> Float[Array, " S"]:
    """Angles of points around a circle, from its vector u to v."""
    return np.asarray(np.arctan2((x - circle.center) @ circle.v, (x - circle.center) @ circle.u))


def turned(angle: float) -> float:
    """The same angle between -π and π."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def fit_circle(points: Float[Array, "M 3"]) -> Circle | None:
    """The circle of least squares; None if the points lie on a line."""
    middle = points.mean(0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2]
    if len(axes) < 3:
        return None
    x, y, z = flat = axes @ (points - middle).T
    # Kåsa's algebraic fit, which along the principal axes is one quotient after the other.
    square = x**2 + y**2
    if not y @ y > 0:
        return None
    cx, cy = float(x @ square / (x @ x)) / 2, float(y @ square / (y @ y)) / 2
    bound = float(square.mean()) + cx**2 + cy**2
    if not 0 < bound < 1e12:
        return None
    radius = bound**0.5
    # Then Gauss and Newton on the distances, each row of numbers less its mean: the best radius leaves none.
    rows = np.empty((3, len(points)))
    for _ in range(CIRCLE_ROUNDS):
        away = flat[:2] - [[cx], [cy]]
        rho = rows[2] = np.hypot(*away) + 1e-12
        np.divide(away, rho, rows[:2])
        mean = rows.sum(1, keepdims=True) / len(points)
        rows -= mean
        (aa, ab, right_a), (_, bb, right_b), _ = (rows @ rows.T).tolist()
        determinant = aa * bb - ab * ab
        if not determinant > 0:
            return None
        step_x, step_y = (right_a * bb - right_b * ab) / determinant, (right_b * aa - right_a * ab) / determinant
        (a,), (b,), (off,) = mean.tolist()
        wider = off - a * step_x - b * step_y - radius
        cx, cy, radius = cx + step_x, cy + step_y, radius + wider
        if max(abs(step_x), abs(step_y), abs(wider)) < SETTLED * radius:
            break
    if not 0 < radius < np.inf:
        return None
    distances = np.hypot(np.hypot(x - cx, y - cy) - radius, z)
    return Circle(middle + cx * axes[0] + cy * axes[1], axes[0], axes[1], radius, distances)


def arc_control(center: Array, u: Array, v: Array, start: float, stop: float) -> Float[Array, "4 3"]:
    """Control points of the rational cubic for center + u cos(angle) + v sin(angle); the weights follow from them.

    With half the sweep θ and w = cos θ, the quadratic arc P0, P1, P2 with weights 1, w, 1 is the cubic with inner
    points (P0 + 2 w P1) / (1 + 2 w) and (2 w P1 + P2) / (1 + 2 w), inner weights (1 + 2 w) / 3. Since w P1 stays finite
    where the tangents are parallel, so does the cubic, up to a sweep of 240 degrees.
    """
    half, middle = (stop - start) / 2, (start + stop) / 2
    first, last = (center + u * np.cos(a) + v * np.sin(a) for a in (start, stop))
    w = np.cos(half)
    # P1 = center + radial / w: w P1 = w center + radial.
    corner = w * center + u * np.cos(middle) + v * np.sin(middle)
    inner = [(first + 2 * corner) / (1 + 2 * w), (2 * corner + last) / (1 + 2 * w)]
    return np.stack([first, inner[0], inner[1], last])


def fit_cubic(points: Float[Array, "M 3"]) -> Primitive:
    """The cubic nearest to the points, from their first region to their last."""
    return Primitive(Kind.FREE, *fit_points(points))
