"""Circles and long arcs placed where the ridges are, by least squares of their offsets."""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float
from diff3ds.edges.curves import Curves
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.offsets import Shape, fitted, residuals
from diff3ds.edges.primitives import Circle, Kind, arc_control, fit_circle
from diff3ds.edges.ridges import Array
from diff3ds.edges.support import PARTS, SAMPLES, agreement, crowded, samples

# Less of an arc does not fix its circle; a circle that moves farther, pixels, was another one. Empirical.
LEAST_SWEEP, MOST_MOVE = np.deg2rad(100.0), 1.5


def placed(curves: Curves, views: EdgeViews, outward: float) -> Curves:
    """The curves with their circles and long arcs where the ridges are.

    Args:
        outward: offset of outlines that the detector has, pixels; those of the object itself are corrected already.
    """
    if not len(curves):
        return curves
    x, tangents = samples(curves)
    shown = agreement(views, x, tangents) & ~crowded(views, x, tangents)
    count = PARTS * SAMPLES
    old = curves.constrained(curves.points)[0].double().numpy()
    points = old.copy()
    for i in range(len(curves)):
        other = int(curves.other[i])
        if int(curves.kind[i]) != Kind.ARC or 0 <= other < i:
            continue
        rows = [i] if other < 0 else [i, other]
        on = np.concatenate([np.arange(r * count, (r + 1) * count) for r in rows])
        control = _placed(x[on], shown[:, on], old[rows], views, outward)
        if control is not None:
            points[rows] = control
    return replace(curves, points=torch.from_numpy(points).to(curves.points.dtype))


def _placed(
    x: Float[Array, "S 3"],
    shown: Bool[NDArray[np.bool_], "V S"],
    old: Float[Array, "K 4 3"],
    views: EdgeViews,
    outward: float,
) -> Float[Array, "K 4 3"] | None:
    """Control points of the circle's one or two arcs; None where the ridges do not fix it."""
    start = fit_circle(x)
    if start is None:
        return None
    ends = [_angles(start, old[:, k]) for k in (0, 3)]
    middle = _angles(start, old[:, 1:3].mean(1))
    sweeps = [(m + _turned(a - m), m + _turned(b - m)) for a, m, b in zip(ends[0], middle, ends[1], strict=True)]
    if sum(abs(b - a) for a, b in sweeps) < LEAST_SWEEP:
        return None
    angle = _angles(start, x)
    circle = circle_at(start, angle, shown, views, outward)
    if circle is None:
        return None
    moved = np.linalg.norm(points_on(circle, angle) - points_on(start, angle), axis=1).max()
    if moved > MOST_MOVE * views.pixel:
        return None
    return np.stack(
        [arc_control(circle.center, circle.radius * circle.u, circle.radius * circle.v, *s) for s in sweeps]
    )


def circle_at(
    start: Circle, angle: Float[Array, " S"], shown: Bool[NDArray[np.bool_], "V S"], views: EdgeViews, outward: float
) -> Circle | None:
    """The circle near this one that agrees best with the ridges at these angles; None if it shrinks to nothing.

    Args:
        shown: which views show which of the places.
        outward: offset of outlines, pixels.
    """
    shape = _shape(start, angle, views.pixel)
    circle = _stepped(start, fitted(shape, 6, start.center, shown, views, outward))
    return circle if circle.radius > views.pixel else None


def circle_residuals(circle: Circle, angle: Float[Array, " S"], views: EdgeViews, outward: float) -> Array:
    """How far ridges lie (V, S) from the circle at these angles; see `residuals`."""
    return residuals(_shape(circle, angle, views.pixel), 6, circle.center, views, outward)


def _shape(start: Circle, angle: Float[Array, " S"], pixel: float) -> Shape:
    step = 0.5 * pixel / start.radius

    def places(value: Float[Array, " 6"]) -> Float[Array, "3 S 3"]:
        circle = _stepped(start, value)
        return np.stack([points_on(circle, angle + s) for s in (-step, 0.0, step)])

    return places


def _stepped(circle: Circle, step: Float[Array, " 6"]) -> Circle:
    """The circle with another centre and radius, its points along u and v raised out of the plane."""
    up = np.cross(circle.u, circle.v)
    u, v = circle.u + step[4] / circle.radius * up, circle.v + step[5] / circle.radius * up
    u = u / np.linalg.norm(u)
    v = v - (v @ u) * u
    return Circle(circle.center + step[:3], u, v / np.linalg.norm(v), circle.radius + step[3], circle.distances)


def _angles(circle: Circle, x: Float[Array, "S 3"]) -> Float[Array, " S"]:
    return np.arctan2((x - circle.center) @ circle.v, (x - circle.center) @ circle.u)


def _turned(angle: float) -> float:
    """The same angle between -π and π."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def points_on(circle: Circle, angle: Float[Array, " S"]) -> Float[Array, "S 3"]:
    """Points of a circle at angles from its vector u."""
    ray = np.cos(angle)[:, None] * circle.u + np.sin(angle)[:, None] * circle.v
    return circle.center + circle.radius * ray
