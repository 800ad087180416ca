"""Lines, circles and long arcs fitted to the ridges of all views, by least squares of their offsets."""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.primitives import Circle, Kind, angles_of, arc_control, fit_circle, line_control, turned
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import crowded, inliers, owners, samples
from diff3ds.edges.measure.holes import other_ends, seen_through
from diff3ds.edges.measure.offsets import STEP_ALONG, Shape, fitted, near_joints, residuals
from diff3ds.edges.measure.planes import LOOKS, shared_planes
from diff3ds.edges.measure.vertices import FARTHEST, met
from diff3ds.edges.watch import Tick, no_tick
from diff3ds.parallel.in_copies import in_copies

# [rad; empirical] Less of an arc does not fix its circle.
LEAST_SWEEP = np.deg2rad(80.0)
# [px; empirical] Shorter lines turn too freely.
LEAST_LINE = 6.0
# [px, fraction; measured] Lines of the usual widths pull each other's ridges by .06 to .2 pixels 3.5 pixels apart, and
# by .01 this far apart (drawn). Seen aslant, the two sides of a circle do so, always inwards: small ones came out .3 %
# small. Fraction of its views that a sample point of a circle keeps at least without those.
PULLED, ENOUGH = 5.0, 0.5
# [px; numerical] What moves by less need not be asked about again.
STILL = 0.01


def fit_to_ridges(curves: Curves, views: EdgeViews, outward: float, tick: Tick = no_tick) -> Curves:
    """The curves with their lines, circles and long arcs where the ridges are, and their ends where those meet.

    Circles that nearly lie in the plane of other curves are fitted again in that plane.

    Args:
        outward: offset of outlines that the detector has, pixels; those of the object itself are corrected already.
        tick: see `watch`.
    """
    if not len(curves):
        return curves
    x, tangents = samples(curves)
    shown = inliers(views, x, tangents)
    owner = owners(curves)
    # Lines are asked about where they are shown, what is round wherever it may move to.
    bent, whole = (np.isin(curves.kind.numpy(), kinds)[owner] for kinds in ((Kind.ARC, Kind.CIRCLE), (Kind.CIRCLE,)))
    clear = ~crowded(views, x, tangents, at=shown | bent)
    free = undisturbed(views, x, tangents, shown, clear, np.broadcast_to(whole, shown.shape))
    old = curves.constrained(curves.points)[0].double().numpy()
    points, sure = old.copy(), np.zeros(len(curves), bool)
    rims = other_ends(curves.circles, views.pixel)

    def fit_of(i: int) -> Float[Array, "4 3"] | None:
        kind, on = int(curves.kind[i]), owner == i
        if kind == Kind.CIRCLE:
            return _fit_arc(x[on], free[:, on], old[i], views, outward, rims.get(i), closed=True)
        if kind == Kind.ARC:
            return _fit_arc(x[on], clear[:, on], old[i], views, outward)
        return _fit_line(x[on], (shown & clear)[:, on], old[i], views) if kind == Kind.LINE else None

    fits = in_copies(fit_of, len(curves), len(curves), lambda done: tick(done, len(curves)))
    for i, found in enumerate(fits):
        if found is not None:
            points[i], sure[i] = found, True
    moved = _with_points(curves, points)
    x = samples(moved)[0]
    for i, plane in shared_planes(moved, sure, views.pixel).items():
        on = owner == i
        flat = plane.project(x[on]), free[:, on], plane.project(points[i])
        found = _fit_arc(*flat, views, outward, rims.get(i), closed=True, flat=True)
        points[i] = points[i] if found is None else found
    return met(_with_points(curves, points), old, sure, views.pixel)


def _with_points(curves: Curves, points: Float[Array, "N 4 3"]) -> Curves:
    return replace(curves, points=torch.from_numpy(points).to(curves.points.dtype))


def undisturbed(
    views: EdgeViews,
    x: Float[Array, "M 3"],
    tangents: Float[Array, "M 3"],
    shown: Bool[NDArray[np.bool_], "V M"],
    clear: Bool[NDArray[np.bool_], "V M"],
    at: Bool[NDArray[np.bool_], "V M"],
) -> Bool[NDArray[np.bool_], "V M"]:
    """Where no other line pulls the ridges even a little; `clear` where this would leave few views.

    Args:
        shown: which views show which of the sample points.
        clear: where no other line is so near that it pulls them much.
        at: which points are asked about in which views.
    """
    free = ~crowded(views, x, tangents, at=at, within=PULLED)
    keep = (shown & free).sum(0) >= ENOUGH * (shown & clear).sum(0)
    return np.asarray(np.where(keep, free, clear))


def _fit_line(
    x: Float[Array, "S 3"], shown: Bool[NDArray[np.bool_], "V S"], old: Float[Array, "4 3"], views: EdgeViews
) -> Float[Array, "4 3"] | None:
    """Control points of the line; None if it is too short or would move far."""
    along = old[3] - old[0]
    length = float(np.linalg.norm(along))
    if length < LEAST_LINE * views.pixel:
        return None
    first = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    across = np.stack([first, np.cross(along, first)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    fraction = ((x - old[0]) @ along / length**2)[:, None]
    step = STEP_ALONG * views.pixel * along / length

    def moved(value: Float[Array, " 4"]) -> Float[Array, "3 S 3"]:
        at = x + (1 - fraction) * (value[:2] @ across) + fraction * (value[2:] @ across)
        return np.stack([at - step, at, at + step])

    # Both sides of a line are alike: which one an outline was pushed to, it does not say.
    value = fitted(moved, 4, old[0], shown, views, 0.0)
    moves = np.stack([value[:2] @ across, value[2:] @ across])
    if np.linalg.norm(moves, axis=1).max() > FARTHEST * views.pixel:
        return None
    return line_control(old[0] + moves[0], old[3] + moves[1])


def _fit_arc(
    x: Float[Array, "S 3"],
    clear: Bool[NDArray[np.bool_], "V S"],
    old: Float[Array, "4 3"],
    views: EdgeViews,
    outward: float,
    end: Circle | None = None,
    *,
    closed: bool = False,
    flat: bool = False,
) -> Float[Array, "4 3"] | None:
    """Control points of the arc, or of the circle's half; None where the ridges do not fix it.

    Args:
        end: the other end of the hole or shaft.
        closed: it is a whole circle.
        flat: the circle stays in its plane.
    """
    start = circle = fit_circle(x)
    if start is None or circle is None:
        return None
    first, middle, last = angles_of(start, np.stack([old[0], old[1:3].mean(0), old[3]]))
    sweep = middle + turned(first - middle), middle + turned(last - middle)
    if not closed and abs(sweep[1] - sweep[0]) < LEAST_SWEEP:
        return None
    angle = angles_of(start, x)
    joints = None if closed else near_joints(x, points_on(start, np.array(sweep)), views.pixel)
    for _ in range(LOOKS):
        before = points_on(circle, angle)
        rim = None if end is None else seen_through(circle, end, angle, views)
        shown = clear & shown_of(circle, angle, views)
        circle = circle_at(circle, angle, shown, views, outward, rim, joints, free=in_plane(circle) if flat else None)
        if circle is None or apart(points_on(circle, angle), points_on(start, angle)) > FARTHEST * views.pixel:
            return None
        if apart(points_on(circle, angle), before) < STILL * views.pixel:
            break
    return arc_control(circle.center, circle.radius * circle.u, circle.radius * circle.v, *sweep)


def apart(one: Float[Array, "S 3"], other: Float[Array, "S 3"]) -> float:
    """The largest distance between points and their like."""
    return float(np.linalg.norm(one - other, axis=1).max())


def shown_of(circle: Circle, angle: Float[Array, " S"], views: EdgeViews) -> Bool[NDArray[np.bool_], "V S"]:
    """Which views show which sample points of a circle."""
    return inliers(views, points_on(circle, angle), tangents_on(circle, angle))


def circle_at(
    start: Circle,
    angle: Float[Array, " S"],
    shown: Bool[NDArray[np.bool_], "V S"],
    views: EdgeViews,
    outward: float,
    rim: Bool[NDArray[np.bool_], "V S"] | None = None,
    joints: Bool[NDArray[np.bool_], " S"] | None = None,
    *,
    free: Float[Array, "6 K"] | None = None,
) -> Circle | None:
    """The circle near this one that agrees best with the ridges at these angles; None if it shrinks to nothing.

    Args:
        shown: which views show which of the sample points.
        outward: offset of outlines, pixels.
        rim: see `fitted`.
        joints: see `fitted`.
        free: how it may change, see `in_plane` and `on_axis`; default in every way.
    """
    free = np.eye(6) if free is None else free
    shape = _shape(start, angle, views.pixel, free)
    found = fitted(shape, free.shape[1], start.center, shown, views, outward, rim, joints)
    circle = _stepped(start, free @ found, np.cross(start.u, start.v))
    return circle if circle.radius > views.pixel else None


def in_plane(circle: Circle) -> Float[Array, "6 3"]:
    """The steps of `_stepped` that leave the circle in its plane: of the centre, and of the radius."""
    free = np.zeros((6, 3))
    free[:3, 0], free[:3, 1], free[3, 2] = circle.u, circle.v, 1.0
    return free


def on_axis(circle: Circle) -> Float[Array, "6 2"]:
    """The steps of `_stepped` that leave the circle its axis: along it, and of the radius."""
    free = np.zeros((6, 2))
    free[:3, 0], free[3, 1] = np.cross(circle.u, circle.v), 1.0
    return free


def circle_residuals(circle: Circle, angle: Float[Array, " S"], views: EdgeViews, outward: float) -> Array:
    """How far ridges lie (V, S) from the circle at these angles; see `residuals`."""
    return residuals(_shape(circle, angle, views.pixel, np.eye(6)), 6, circle.center, views, outward)


def _shape(start: Circle, angle: Float[Array, " S"], pixel: float, free: Float[Array, "6 K"]) -> Shape:
    """Places of the circle by the numbers that are free to change its six."""
    turned = angle + STEP_ALONG * pixel / start.radius * np.array([[-1.0], [0.0], [1.0]])
    rays = np.stack([np.cos(turned), np.sin(turned)], -1)
    up = np.cross(start.u, start.v)

    def moved(value: Float[Array, " K"]) -> Float[Array, "3 S 3"]:
        circle = _stepped(start, free @ value, up)
        return np.asarray(circle.center + circle.radius * (rays @ np.stack([circle.u, circle.v])))

    return moved


def _stepped(circle: Circle, step: Float[Array, " 6"], up: Float[Array, " 3"]) -> Circle:
    """The circle with another centre and radius, its points along u and v raised out of the plane."""
    u, v = circle.u + step[4] / circle.radius * up, circle.v + step[5] / circle.radius * up
    u = u / np.sqrt(u @ u)
    v = v - (v @ u) * u
    return Circle(circle.center + step[:3], u, v / np.sqrt(v @ v), circle.radius + step[3], circle.distances)


def tangents_on(circle: Circle, angle: Float[Array, " S"]) -> Float[Array, "S 3"]:
    """Unit tangents of a circle at angles from its vector u."""
    return np.cos(angle)[:, None] * circle.v - np.sin(angle)[:, None] * circle.u


def points_on(circle: Circle, angle: Float[Array, " S"]) -> Float[Array, "S 3"]:
    """Points of a circle at angles from its vector u."""
    ray = np.cos(angle)[:, None] * circle.u + np.sin(angle)[:, None] * circle.v
    return circle.center + circle.radius * ray
