"""Arcs closed to whole circles where the views show the rest, each a part of it: a shaft hides half of its own rim."""

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float
from diff3ds.edges.curves import Curves, curves_of
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.placing import circle_at, circle_residuals, points_on
from diff3ds.edges.primitives import Circle, Kind, Primitive, arc_control, fit_circle
from diff3ds.edges.ridges import Array
from diff3ds.edges.simplify import concatenated, sampled
from diff3ds.edges.support import agreement

# Samples of a circle; the share of them that enough views have to show, and how many views those are, relative to the
# views that confirm an edge. Of 12 whole circles in parts all had .87 or more, of 25 arcs of generated objects that
# end where they should all .82 or less.
SAMPLES, COVERED, SHOWN = 60, 0.85, 0.7
# An arc of less says too little about its circle. Empirical.
LEAST_SWEEP = np.deg2rad(75.0)
# A view shows a place of a circle that its ridge passes this closely, pixels: twice the scatter.
SEEN_WITHIN = 0.4
# Rounds of placing and looking again what the views show.
ROUNDS = 4
# Curves that lie so near to a circle belong to it, pixels, if this share of them does.
NEAR, SHARE = 1.5, 0.8


def closed(curves: Curves, views: EdgeViews, enough: float, outward: float) -> Curves:
    """The curves with whole circles instead of the arcs and pieces along them.

    Args:
        enough: so many views confirm an edge.
        outward: the offset of outlines in these views, pixels.
    """
    free = np.ones(len(curves), bool)
    points = sampled(curves)
    length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(1)
    found = []
    for i in np.argsort(-length, kind="stable"):
        if not free[i] or int(curves.kind[i]) != Kind.ARC or int(curves.other[i]) >= 0:
            continue
        start = fit_circle(points[i])
        if start is None or length[i] < LEAST_SWEEP * start.radius:
            continue
        circle = _whole(start, views, enough, outward)
        if circle is not None:
            free &= ~(_on(circle, points, views.pixel) & (curves.other.numpy() < 0))
            found.append(circle)
    halves = [[_half(c, 0.0), _half(c, np.pi)] for c in found]
    return concatenated(curves[torch.from_numpy(free)], curves_of([], halves)) if found else curves


def _whole(circle: Circle, views: EdgeViews, enough: float, outward: float) -> Circle | None:
    """The circle placed by all that the views show of it; None if that is not all around."""
    angle = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    for _ in range(ROUNDS):
        moved = circle_at(circle, angle, _shown(circle, angle, views), views, outward)
        if moved is None:
            return None
        circle = moved
    counts = (_shown(circle, angle, views) & (circle_residuals(circle, angle, views, outward) < SEEN_WITHIN)).sum(0)
    return circle if (counts >= SHOWN * enough).mean() >= COVERED else None


def _shown(circle: Circle, angle: Float[Array, " S"], views: EdgeViews) -> Bool[NDArray[np.bool_], "V S"]:
    x = points_on(circle, angle)
    return agreement(views, x, (points_on(circle, angle + np.pi / 2) - circle.center) / circle.radius)


def _on(circle: Circle, points: Float[Array, "N S 3"], pixel: float) -> Bool[NDArray[np.bool_], " N"]:
    """Which curves lie along the circle."""
    offset = points - circle.center
    up = np.cross(circle.u, circle.v)
    rise = offset @ up
    flat = np.hypot(offset @ circle.u, offset @ circle.v)
    return np.asarray((np.hypot(flat - circle.radius, rise) < NEAR * pixel).mean(1) >= SHARE)


def _half(circle: Circle, start: float) -> Primitive:
    control = arc_control(circle.center, circle.radius * circle.u, circle.radius * circle.v, start, start + np.pi)
    return Primitive(Kind.ARC, control, np.zeros(0))
