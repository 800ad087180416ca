"""Ellipses fitted to points in space, taken only where the points determine them."""

from typing import NamedTuple

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.bezier.conics import axes_of_conic
from diff3ds.curves.shapes.primitives import POINT_SCATTER, Circle, Kind, Primitive, arcs_along, fit_circle

# [rounds, steps; numerical] Rounds of the geometric fit; each takes two steps towards the closest points.
ROUNDS, CLOSER = 12, 2
# [px, %; empirical] A curve fits points of which so many lie so near to it.
JOINED, MOST = 0.5, 98
# A circle that as many of the points are this near to is a badly measured circle: a good one is half as far.
ROUND = 2 * JOINED
# [fraction; empirical] Standard error of the half axes, as a fraction of them, with every point off by
# `POINT_SCATTER`. Half of an ellipse of 30 by 18 pixels has that, a third of one of 150 by 90, but not half of one of
# 15 by 10.
UNSURE = 0.05
# [ratio; derived] The algebraic fit of an arc comes out small, by less than half where the points determine it.
MOST_CHANGE = 2.0


class Ellipse(NamedTuple):
    """An ellipse fitted to points, center + u cos(angle) + v sin(angle).

    Attributes:
        center: of the ellipse.
        u, v: its half axes, orthogonal.
        angle: of the point of the ellipse nearest to each point, radians.
        distances: of the points, world units.
    """

    center: Float[Array, " 3"]
    u: Float[Array, " 3"]
    v: Float[Array, " 3"]
    angle: Float[Array, " M"]
    distances: Float[Array, " M"]


def fit_elliptic_arcs(points: Float[Array, "M 3"], pixel: float) -> list[Primitive]:
    """As `elliptic_arcs` where no circle is known."""
    return elliptic_arcs(fit_circle(points), points, pixel)


def elliptic_arcs(circle: Circle | None, points: Float[Array, "M 3"], pixel: float) -> list[Primitive]:
    """The ellipse of least squares, from the first to the last point: one arc, two where it is long, or all of it.

    Nothing if a circle fits nearly as well, if the points do not determine an ellipse, or if they do not run around it
    in one direction.

    Args:
        circle: of least squares; None where there is none.
        points: in order, about a pixel apart.
        pixel: world units of a pixel.
    """
    if circle is None or np.percentile(circle.distances, MOST) < ROUND * pixel:
        return []
    fitted = fit_ellipse(points, pixel)
    if fitted is None:
        return []
    return arcs_along(Kind.ELLIPSE, fitted.center, fitted.u, fitted.v, fitted.angle, fitted.distances)


def fit_ellipse(points: Float[Array, "M 3"], pixel: float) -> Ellipse | None:
    """The ellipse of least squares in the plane of least squares; None if the points do not determine it.

    They do not if they are too few, on too little of it, or nearer to a hyperbola; nor if it turns at its tips within a
    pixel (its radius of curvature there is v² / u), where two lines side by side would look the same.
    """
    middle = points.mean(0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2]
    if len(points) < 6 or len(axes) < 3:
        return None
    x, rise = (points - middle) @ axes[:2].T, (points - middle) @ axes[2]
    start = _algebraic(x)
    if start is None:
        return None
    center, half, turn = start
    local = (x - center) @ turn
    angle = np.arctan2(local[:, 1] / half[1], local[:, 0] / half[0])
    for _ in range(ROUNDS):
        angle = _closest(local, half, angle)
        jacobian, off = _linearised(local, half, angle)
        step = np.linalg.lstsq(jacobian, off, rcond=None)[0]
        center, half = center + turn @ step[:2], half + step[2:4]
        if not ((half < MOST_CHANGE * start[1]) & (half > start[1] / MOST_CHANGE)).all():
            return None
        cos, sin = np.cos(step[4] / half.max()), np.sin(step[4] / half.max())
        turn = turn @ np.array([[cos, -sin], [sin, cos]])
        local = (x - center) @ turn
    angle = _closest(local, half, angle)
    jacobian, off = _linearised(local, half, angle)
    if (_errors(jacobian, POINT_SCATTER * pixel) > UNSURE * half).any() or half.min() ** 2 < pixel * half.max():
        return None
    u, v = (half * turn).T @ axes[:2]
    return Ellipse(middle + center @ axes[:2], u, v, np.unwrap(angle), np.hypot(off, rise))


def _algebraic(x: Float[Array, "M 2"]) -> tuple[Array, Array, Array] | None:
    """Centre, half axes and their directions (columns) of the ellipse of least algebraic distance, if there is one.

    Fitzgibbon, Pilu and Fisher, "Direct least square fitting of ellipses", PAMI 21(5), 1999, in the stable form of
    Halíř and Flusser, WSCG 1998: a conic with 4ac - b² = 1, its linear part eliminated.
    """
    middle = x.mean(0)
    size = np.linalg.norm(x - middle, axis=1).mean()
    s, t = ((x - middle) / size).T
    square, linear = np.stack([s * s, s * t, t * t], 1), np.stack([s, t, np.ones_like(s)], 1)
    if np.linalg.matrix_rank(linear) < 3:
        return None
    reduce = -np.linalg.solve(linear.T @ linear, linear.T @ square)
    scatter = square.T @ square + square.T @ linear @ reduce
    vectors = np.linalg.eig(np.stack([scatter[2] / 2, -scatter[1], scatter[0] / 2])).eigenvectors.real
    a, b, c = vectors[:, np.argmax(4 * vectors[0] * vectors[2] - vectors[1] ** 2)]
    d, e, f = reduce @ (a, b, c)
    found = axes_of_conic(a, b, c, d, e, f)
    if found is None:
        return None
    center, half, directions = found
    return middle + size * center, size * half, directions


def _closest(local: Float[Array, "M 2"], half: Float[Array, " 2"], angle: Float[Array, " M"]) -> Float[Array, " M"]:
    """Angles moved towards the closest points to points in the frame of the axes, by Gauss-Newton steps."""
    for _ in range(CLOSER):
        cos, sin = np.cos(angle), np.sin(angle)
        tangent = np.stack([-half[0] * sin, half[1] * cos], 1)
        residual = local - half * np.stack([cos, sin], 1)
        angle = angle + (residual * tangent).sum(1) / (tangent**2).sum(1)
    return angle


def _linearised(
    local: Float[Array, "M 2"], half: Float[Array, " 2"], angle: Float[Array, " M"]
) -> tuple[Float[Array, "M 5"], Float[Array, " M"]]:
    """How the ellipse moves outwards at these angles by its centre, its half axes and a turn; offsets of the points.

    The turn is in units of length along the longer axis, so that all columns are of one size.
    """
    around = np.stack([np.cos(angle), np.sin(angle)], 1)
    on = half * around
    normal = around / half
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    turned = (normal[:, 1] * on[:, 0] - normal[:, 0] * on[:, 1]) / half.max()
    return np.column_stack([normal, normal * around, turned]), ((local - on) * normal).sum(1)


def _errors(jacobian: Float[Array, "M 5"], scatter: float) -> Float[Array, " 2"]:
    """Standard errors of the half axes of the ellipse of least squares: what nothing determines has huge ones."""
    _, values, vectors = np.linalg.svd(jacobian, full_matrices=False)
    return scatter * np.linalg.norm(vectors[:, 2:4] / np.maximum(values, 1e-12)[:, None], axis=0)
