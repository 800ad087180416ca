"""Lines, circles and long arcs placed where the ridges are, by least squares of their offsets."""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import PARTS, SAMPLES, crowded, inliers, samples
from diff3ds.edges.measure.holes import other_ends, seen_through
from diff3ds.edges.measure.offsets import Shape, fitted, near_joints, residuals
from diff3ds.edges.measure.planes import shared_planes
from diff3ds.edges.measure.vertices import met
from diff3ds.edges.shapes.curve_set import Curves
from diff3ds.edges.shapes.primitives import Circle, Kind, angles_of, arc_control, fit_circle, turned
from diff3ds.edges.watch import Tick, no_tick

# Less of an arc does not fix its circle; a circle that moves farther, pixels, was another one. Empirical.
LEAST_SWEEP, MOST_MOVE = np.deg2rad(80.0), 1.5
# Shorter lines turn too freely, pixels. Empirical.
LEAST_LINE = 6.0
# Lines of the usual widths pull each other's ridges by .06 to .2 pixels 3.5 pixels apart, and by .01 this far apart
# (drawn). Seen aslant, the two sides of a circle do so, always inwards: small ones came out .3 % small. Share of its
# views that a place of a circle may lose for that. Empirical.
PULLED, ENOUGH = 5.0, 0.5
# How often it is looked again which views show an arc, as it moves.
LOOKS = 3
# What moves by less need not be looked at again, pixels.
STILL = 0.01


def placed(curves: Curves, views: EdgeViews, outward: float, tick: Tick = no_tick) -> Curves:
    """The curves with their lines, circles and long arcs where the ridges are, and their ends where those meet.

    Circles that nearly lie in the plane of other curves are placed again in that plane.

    Args:
        outward: offset of outlines that the detector has, pixels; those of the object itself are corrected already.
        tick: see `watch`.
    """
    if not len(curves):
        return curves
    x, tangents = samples(curves)
    shown = inliers(views, x, tangents)
    clear = ~crowded(views, x, tangents)
    free = undisturbed(views, x, tangents, shown, clear)
    old = curves.constrained(curves.points)[0].double().numpy()
    points, sure = old.copy(), np.zeros(len(curves), bool)
    rims = other_ends(curves, x.reshape(len(curves), -1, 3), views.pixel)
    strokes = _strokes(curves)
    for done, rows in enumerate(strokes):
        tick(done, len(strokes))
        on, kind, found = _places(rows), int(curves.kind[rows[0]]), None
        if kind == Kind.ARC:
            sight = clear if len(rows) == 1 else free
            found = _placed_arc(x[on], sight[:, on], old[rows], views, outward, rims.get(rows[0]))
        elif kind == Kind.LINE:
            found = _placed_line(x[on], (shown & clear)[:, on], old[rows[0]], views)
        if found is not None:
            points[rows], sure[rows] = found, True
    moved = _with_points(curves, points)
    x = samples(moved)[0]
    for halves, plane in shared_planes(moved, sure, views.pixel).items():
        rows, on = list(halves), _places(list(halves))
        flat = plane.project(x[on]), free[:, on], plane.project(points[rows])
        found = _placed_arc(*flat, views, outward, rims.get(rows[0]), flat=True)
        points[rows] = points[rows] if found is None else found
    return met(_with_points(curves, points), old, sure, views.pixel)


def _strokes(curves: Curves) -> list[list[int]]:
    """Each curve, or the two halves of a circle."""
    other = curves.other.tolist()
    return [[i] if k < 0 else [i, k] for i, k in enumerate(other) if not 0 <= k < i]


def _places(rows: list[int]) -> NDArray[np.int64]:
    """Which of the curves' samples are of these."""
    return (np.array(rows)[:, None] * PARTS * SAMPLES + np.arange(PARTS * SAMPLES)).ravel()


def _with_points(curves: Curves, points: Float[Array, "N 4 3"]) -> Curves:
    return replace(curves, points=torch.from_numpy(points).to(curves.points.dtype))


def undisturbed(
    views: EdgeViews,
    x: Float[Array, "M 3"],
    tangents: Float[Array, "M 3"],
    shown: Bool[NDArray[np.bool_], "V M"],
    clear: Bool[NDArray[np.bool_], "V M"],
) -> Bool[NDArray[np.bool_], "V M"]:
    """Where no other line pulls the ridges even a little; at places that would lose most of their views, `clear`.

    Args:
        shown: which views show which of the places.
        clear: where no other line is so near that it pulls them much.
    """
    free = ~crowded(views, x, tangents, within=PULLED)
    enough = (shown & free).sum(0) >= ENOUGH * (shown & clear).sum(0)
    return np.asarray(np.where(enough, free, clear))


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
    flat: bool = False,
) -> Float[Array, "K 4 3"] | None:
    """Control points of the circle's one or two arcs; None where the ridges do not fix it.

    Args:
        end: the other end of the hole or shaft.
        flat: the circle stays in its plane.
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
        circle = circle_at(circle, angle, shown, views, outward, rim, joints, flat=flat)
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
    flat: bool = False,
) -> Circle | None:
    """The circle near this one that agrees best with the ridges at these angles; None if it shrinks to nothing.

    Args:
        shown: which views show which of the places.
        outward: offset of outlines, pixels.
        rim: see `fitted`.
        joints: see `fitted`.
        flat: the circle stays in its plane.
    """
    free = _in_plane(start) if flat else np.eye(6)
    shape = _shape(start, angle, views.pixel, free)
    found = fitted(shape, free.shape[1], start.center, shown, views, outward, rim, joints)
    circle = _stepped(start, free @ found, np.cross(start.u, start.v))
    return circle if circle.radius > views.pixel else None


def _in_plane(circle: Circle) -> Float[Array, "6 3"]:
    """The steps of `_stepped` that leave the circle in its plane: of the centre, and of the radius."""
    free = np.zeros((6, 3))
    free[:3, 0], free[:3, 1], free[3, 2] = circle.u, circle.v, 1.0
    return free


def circle_residuals(circle: Circle, angle: Float[Array, " S"], views: EdgeViews, outward: float) -> Array:
    """How far ridges lie (V, S) from the circle at these angles; see `residuals`."""
    return residuals(_shape(circle, angle, views.pixel, np.eye(6)), 6, circle.center, views, outward)


def _shape(start: Circle, angle: Float[Array, " S"], pixel: float, free: Float[Array, "6 K"]) -> Shape:
    """Places of the circle by the numbers that are free to change its six."""
    turned = angle + 0.5 * pixel / start.radius * np.array([[-1.0], [0.0], [1.0]])
    rays = np.stack([np.cos(turned), np.sin(turned)], -1)
    up = np.cross(start.u, start.v)

    def places(value: Float[Array, " K"]) -> Float[Array, "3 S 3"]:
        circle = _stepped(start, free @ value, up)
        return np.asarray(circle.center + circle.radius * (rays @ np.stack([circle.u, circle.v])))

    return places


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
