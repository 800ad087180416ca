"""Circles and long arcs placed by least squares of the ridges' offsets, with rims of holes recognised.

A detector pushes outlines out of the object (see `bias`). Where a hole shows the background, its rim is such an
outline, pushed into the hole; an edge map does not say where. So each part of a circle in each view is taken to lie
where it is, or to be pushed towards the centre by the known offset, whichever agrees better with the other views.
"""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float
from diff3ds.edges.curves import Curves
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.primitives import Circle, Kind, arc_control, fit_circle
from diff3ds.edges.ridges import Array
from diff3ds.edges.support import PARTS, SAMPLES, agreement, crowded, samples

# Rounds of reweighting; residuals in pixels that count half, in the first and the last of them. Empirical.
ROUNDS, FIRST_SCATTER, SCATTER = 12, 0.5, 0.15
# Pull of every parameter towards where it was, in units of one view's sample: decides what the views leave open.
PULL = 1.0
# Least and largest scatter of a part's ridges together, pixels. Empirical.
PART_SCATTER = (0.07, 0.3)
# A smaller offset of outlines cannot be told from the ridges' scatter, pixels.
LEAST_OUTWARD = 0.1
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
    # Few rims pushed, half of them, or most: the best of three starts.
    pushed = (0.1, 0.5, 0.9) if outward > LEAST_OUTWARD else (0.0,)
    fits = [_least_squares(start, angle, shown, views, outward, first) for first in pushed]
    circle = min(fits, key=lambda fit: fit[0])[1]
    return circle if circle.radius > views.pixel else None


def residuals(circle: Circle, angle: Float[Array, " S"], views: EdgeViews, outward: float) -> Float[Array, "V S"]:
    """How far ridges lie from the circle, or from where it is pushed to if that is nearer, at these angles, pixels."""
    offset, _, inward = _offsets(circle, angle, views)
    return np.minimum(np.abs(offset), np.abs(offset - inward * outward))


def _angles(circle: Circle, x: Float[Array, "S 3"]) -> Float[Array, " S"]:
    return np.arctan2((x - circle.center) @ circle.v, (x - circle.center) @ circle.u)


def _turned(angle: float) -> float:
    """The same angle between -π and π."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def points_on(circle: Circle, angle: Float[Array, " S"]) -> Float[Array, "S 3"]:
    """Points of a circle at angles from its vector u."""
    ray = np.cos(angle)[:, None] * circle.u + np.sin(angle)[:, None] * circle.v
    return circle.center + circle.radius * ray


def _least_squares(
    circle: Circle,
    angle: Float[Array, " S"],
    shown: Bool[NDArray[np.bool_], "V S"],
    views: EdgeViews,
    outward: float,
    pushed: float,
) -> tuple[float, Circle]:
    """The cost of the best circle, and the circle: Gauss and Newton, reweighted.

    Args:
        pushed: the probability at first that a part is pushed towards the centre.
    """
    push = np.full(shown.shape, pushed)
    moved_by = np.zeros(6)
    pull = PULL / views.pixel**2
    cost = 0.0
    for turn in range(ROUNDS):
        offset, moved, inward = _offsets(circle, angle, views)
        scatter = FIRST_SCATTER * (SCATTER / FIRST_SCATTER) ** (turn / (ROUNDS - 1))
        if outward > LEAST_OUTWARD and turn:
            push = _pushed(offset, inward * outward, shown, push)
        residual = offset - push * inward * outward
        square = (residual / scatter) ** 2
        cost = float((shown * np.log1p(square)).sum())
        weight = shown / (1 + square)
        design = _design(circle, angle, moved)
        matrix = np.einsum("vs,vsi,vsj->ij", weight, design, design) + pull * np.eye(6)
        step = np.linalg.solve(matrix, np.einsum("vs,vsi,vs->i", weight, design, residual) - pull * moved_by)
        moved_by += step
        circle = _stepped(circle, step)
    return cost, circle


def _design(circle: Circle, angle: Float[Array, " S"], moved: Float[Array, "V S 3"]) -> Float[Array, "V S 6"]:
    """What centre, radius, and a rise of the points along u and v out of the plane add to the places, pixels."""
    cos, sin = np.cos(angle), np.sin(angle)
    radial = (moved * (cos[:, None] * circle.u + sin[:, None] * circle.v)).sum(-1)
    rise = moved @ np.cross(circle.u, circle.v)
    return np.concatenate([moved, np.stack([radial, rise * cos, rise * sin], -1)], -1)


def _stepped(circle: Circle, step: Float[Array, " 6"]) -> Circle:
    """The circle with the parameters of `_design` changed."""
    up = np.cross(circle.u, circle.v)
    radius = circle.radius + step[3]
    u = circle.u + step[4] / circle.radius * up
    v = circle.v + step[5] / circle.radius * up
    u = u / np.linalg.norm(u)
    v = v - (v @ u) * u
    return Circle(circle.center + step[:3], u, v / np.linalg.norm(v), radius, circle.distances)


def _offsets(
    circle: Circle, angle: Float[Array, " S"], views: EdgeViews
) -> tuple[Float[Array, "V S"], Float[Array, "V S 3"], Float[Array, "V S"]]:
    """How far the ridges lie from the circle along their normals, pixels.

    Returns the offsets, what a displacement of each point of the circle adds to its place there (pixels by world unit),
    and the normals' component towards the centre, 1 or -1.
    """
    x = points_on(circle, angle)
    match = views.match(x)
    normal = views.normals[match.ridge]
    apart = views.points[match.ridge] - match.pixel
    # A ridge point beside the sample: its normal has turned, so that the circle seems to bend the other way.
    step = 0.5 * views.pixel / circle.radius
    ahead, back = (views.project(points_on(circle, angle + s))[0] for s in (step, -step))
    first, second = (ahead - back) / 2, ahead + back - 2 * match.pixel
    speed = (first**2).sum(-1, keepdims=True)
    along = (apart * first).sum(-1, keepdims=True) / speed
    bend = 0.5 * along**2 * second
    offset = ((apart + bend) * normal).sum(-1)
    scale = (views.focal[:, None] / np.maximum(match.depth, 1e-9))[..., None]
    planes = views.planes[match.ridge][..., :3]
    inward = np.sign(((views.project(circle.center[None])[0] - match.pixel) * normal).sum(-1))
    return offset, planes * scale, inward


def _pushed(offset: Array, push: Array, shown: Bool[NDArray[np.bool_], "V S"], before: Array) -> Array:
    """The probability that a rim is pushed, equal in each part and view: one step of expectation and maximisation.

    A part's ridges are off by their mean together, so that they say as much as one.
    """
    parts = (len(offset), -1, SAMPLES)
    count = shown.reshape(parts).sum(-1)
    mean = np.where(shown, offset * np.sign(push), 0.0).reshape(parts).sum(-1) / np.maximum(count, 1)
    seen = count > 0
    far = np.abs(push).max()
    old = before.reshape(parts).mean(-1)
    share = np.clip(old[seen].mean() if seen.any() else 0.0, 0.02, 0.98)
    residual = np.abs(mean - far * old)[seen]
    scatter = np.clip(1.48 * np.median(residual) if seen.any() else 1.0, *PART_SCATTER)
    more = (mean**2 - (mean - far) ** 2) / (2 * scatter**2) + np.log(share / (1 - share))
    return np.repeat(1 / (1 + np.exp(-np.clip(more, -50, 50))), SAMPLES, axis=1)
