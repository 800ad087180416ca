"""Lines, circles and long arcs placed where the ridges are, by least squares of their offsets."""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float
from diff3ds.edges.curves import Curves
from diff3ds.edges.holes import other_ends, seen_through
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.meeting import met
from diff3ds.edges.offsets import Shape, fitted, near_joints, residuals
from diff3ds.edges.primitives import Circle, Kind, angles_of, arc_control, fit_circle, turned
from diff3ds.edges.ridges import Array
from diff3ds.edges.support import PARTS, SAMPLES, agreement, crowded, samples

# Less of an arc does not fix its circle; a circle that moves farther, pixels, was another one. Empirical.
LEAST_SWEEP, MOST_MOVE = np.deg2rad(80.0), 1.5
# Shorter lines turn too freely, pixels. Empirical.
LEAST_LINE = 6.0
# How often it is looked again which views show an arc, as it moves.
LOOKS = 3
# What moves by less need not be looked at again, pixels.
STILL = 0.01


def placed(curves: Curves, views: EdgeViews, outward: float) -> Curves:
    """The curves with their lines, circles and long arcs where the ridges are, and their ends where those meet.

    Args:
        outward: offset of outlines that the detector has, pixels; those of the object itself are corrected already.
    """
    if not len(curves):
        return curves
    x, tangents = samples(curves)
    clear = ~crowded(views, x, tangents)
    shown = agreement(views, x, tangents) & clear
    count = PARTS * SAMPLES
    old = curves.constrained(curves.points)[0].double().numpy()
    points, sure = old.copy(), np.zeros(len(curves), bool)
    rims = other_ends(curves, x.reshape(len(curves), count, 3), views.pixel)
    for i in range(len(curves)):
        other = int(curves.other[i])
        if 0 <= other < i:
            continue
        rows = [i] if other < 0 else [i, other]
        on = np.concatenate([np.arange(r * count, (r + 1) * count) for r in rows])
        found = None
        if int(curves.kind[i]) == Kind.ARC:
            found = _placed_arc(x[on], clear[:, on], old[rows], views, outward, rims.get(i))
        elif int(curves.kind[i]) == Kind.LINE:
            found = _placed_line(x[on], shown[:, on], old[i], views)
        if found is not None:
            points[rows], sure[rows] = found, True
    return met(replace(curves, points=torch.from_numpy(points).to(curves.points.dtype)), old, sure, views.pixel)


def _placed_line(
    x: Float[Array, "S 3"], shown: Bool[NDArray[np.bool_], "V S"], old: Float[Array, "4 3"], views: EdgeViews
) -> Float[Array, "1 4 3"] | None:
    """Control points of the line; None if it is too short or would move far."""
    along = old[3] - old[0]
    length = float(np.linalg.norm(along))
    if length < LEAST_LINE * views.pixel:
        return None
    first = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    across = np.stack([first, np.cross(along, first)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    share = ((x - old[0]) @ along / length**2)[:, None]
    step = 0.5 * views.pixel * along / length

    def places(value: Float[Array, " 4"]) -> Float[Array, "3 S 3"]:
        at = x + (1 - share) * (value[:2] @ across) + share * (value[2:] @ across)
        return np.stack([at - step, at, at + step])

    # Both sides of a line are alike: which one an outline was pushed to, it does not say.
    value = fitted(places, 4, old[0], shown, views, 0.0)
    moves = np.stack([value[:2] @ across, value[2:] @ across])
    if np.linalg.norm(moves, axis=1).max() > MOST_MOVE * views.pixel:
        return None
    return (old[0] + moves[0] + np.linspace(0, 1, 4)[:, None] * (old[3] + moves[1] - old[0] - moves[0]))[None]


def _placed_arc(
    x: Float[Array, "S 3"],
    clear: Bool[NDArray[np.bool_], "V S"],
    old: Float[Array, "K 4 3"],
    views: EdgeViews,
    outward: float,
    end: Circle | None = None,
) -> Float[Array, "K 4 3"] | None:
    """Control points of the circle's one or two arcs; None where the ridges do not fix it.

    Args:
        end: the other end of the hole or shaft.
    """
    start = circle = fit_circle(x)
    if start is None or circle is None:
        return None
    ends = [angles_of(start, old[:, k]) for k in (0, 3)]
    middle = angles_of(start, old[:, 1:3].mean(1))
    sweeps = [(m + turned(a - m), m + turned(b - m)) for a, m, b in zip(ends[0], middle, ends[1], strict=True)]
    if sum(abs(b - a) for a, b in sweeps) < LEAST_SWEEP:
        return None
    angle = angles_of(start, x)
    joints = near_joints(x, points_on(start, np.array(sweeps[0])), views.pixel) if len(old) == 1 else None
    for _ in range(LOOKS):
        before = points_on(circle, angle)
        rim = None if end is None else seen_through(circle, end, angle, views)
        shown = clear & shown_of(circle, angle, views)
        circle = circle_at(circle, angle, shown, views, outward, rim, joints)
        if circle is None or apart(points_on(circle, angle), points_on(start, angle)) > MOST_MOVE * views.pixel:
            return None
        if apart(points_on(circle, angle), before) < STILL * views.pixel:
            break
    return np.stack(
        [arc_control(circle.center, circle.radius * circle.u, circle.radius * circle.v, *s) for s in sweeps]
    )


def apart(one: Float[Array, "S 3"], other: Float[Array, "S 3"]) -> float:
    """The largest distance between points and their like."""
    return float(np.linalg.norm(one - other, axis=1).max())


def shown_of(circle: Circle, angle: Float[Array, " S"], views: EdgeViews) -> Bool[NDArray[np.bool_], "V S"]:
    """Which views show which places of a circle."""
    x = points_on(circle, angle)
    return agreement(views, x, (points_on(circle, angle + np.pi / 2) - circle.center) / circle.radius)


def circle_at(
    start: Circle,
    angle: Float[Array, " S"],
    shown: Bool[NDArray[np.bool_], "V S"],
    views: EdgeViews,
    outward: float,
    rim: Bool[NDArray[np.bool_], "V S"] | None = None,
    joints: Bool[NDArray[np.bool_], " S"] | None = None,
) -> Circle | None:
    """The circle near this one that agrees best with the ridges at these angles; None if it shrinks to nothing.

    Args:
        shown: which views show which of the places.
        outward: offset of outlines, pixels.
        rim, joints: see `fitted`.
    """
    shape = _shape(start, angle, views.pixel)
    found = fitted(shape, 6, start.center, shown, views, outward, rim, joints)
    circle = _stepped(start, found, np.cross(start.u, start.v))
    return circle if circle.radius > views.pixel else None


def circle_residuals(circle: Circle, angle: Float[Array, " S"], views: EdgeViews, outward: float) -> Array:
    """How far ridges lie (V, S) from the circle at these angles; see `residuals`."""
    return residuals(_shape(circle, angle, views.pixel), 6, circle.center, views, outward)


def _shape(start: Circle, angle: Float[Array, " S"], pixel: float) -> Shape:
    turned = angle + 0.5 * pixel / start.radius * np.array([[-1.0], [0.0], [1.0]])
    rays = np.stack([np.cos(turned), np.sin(turned)], -1)
    up = np.cross(start.u, start.v)

    def places(value: Float[Array, " 6"]) -> Float[Array, "3 S 3"]:
        circle = _stepped(start, value, up)
        return np.asarray(circle.center + circle.radius * (rays @ np.stack([circle.u, circle.v])))

    return places


def _stepped(circle: Circle, step: Float[Array, " 6"], up: Float[Array, " 3"]) -> Circle:
    """The circle with another centre and radius, its points along u and v raised out of the plane."""
    u, v = circle.u + step[4] / circle.radius * up, circle.v + step[5] / circle.radius * up
    u = u / np.sqrt(u @ u)
    v = v - (v @ u) * u
    return Circle(circle.center + step[:3], u, v / np.sqrt(v @ v), circle.radius + step[3], circle.distances)


def points_on(circle: Circle, angle: Float[Array, " S"]) -> Float[Array, "S 3"]:
    """Points of a circle at angles from its vector u."""
    ray = np.cos(angle)[:, None] * circle.u + np.sin(angle)[:, None] * circle.v
    return circle.center + circle.radius * ray
