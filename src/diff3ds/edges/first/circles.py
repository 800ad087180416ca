"""Whole circles among edge points: grown from arcs, for chains break up where a circle turns fast."""

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import curves_of
from diff3ds.curves.shapes.primitives import Circle, Kind, Primitive, fit_circle, whole_circle
from diff3ds.edges.first.triangulate import EdgePoints

# [px, cosine; empirical] Points so near to a circle, running along it, belong to it.
NEAR, ALONG = 1.2, 0.85
# [rounds; empirical] Rounds of growing a circle.
ROUNDS = 6
# [px, sectors, fraction; empirical] Smallest radius, sectors of a circle, and the fraction of them that have to hold
# points.
LEAST_RADIUS, SECTORS, COVERED = 3.0, 24, 0.75


def find_circles(found: EdgePoints, arcs: list[Primitive], pixel: float) -> tuple[list[Primitive], EdgePoints]:
    """Circles, and the points that belong to none.

    Args:
        arcs: to grow circles from; other primitives are passed over.
    """
    free = np.ones(len(found), bool)
    circles = []
    starts = [fit_circle(_on(arc)) for arc in arcs if arc.kind in (Kind.ARC, Kind.CIRCLE)]
    for start in sorted((s for s in starts if s is not None), key=lambda s: -s.radius):
        grown = _grown(found, free, start, pixel)
        if grown is None:
            continue
        circle, members = grown
        circles.append(whole_circle(circle))
        free &= ~members
    return circles, found[free]


def _on(arc: Primitive) -> Float[Array, "S 3"]:
    """Points on a rational arc."""
    return curves_of([arc]).at(torch.linspace(0, 1, 9))[0].double().numpy()


def _grown(
    found: EdgePoints,
    free: Bool[NDArray[np.bool_], " M"],
    circle: Circle,
    pixel: float,
) -> tuple[Circle, Bool[NDArray[np.bool_], " M"]] | None:
    """The circle of least squares through the points around it, and these; None if they do not go all around."""
    for _ in range(ROUNDS):
        members = free & _members(found, circle, pixel)
        if members.sum() < SECTORS * COVERED / 2:
            return None
        fitted = fit_circle(found.points[members])
        if fitted is None or fitted.radius < LEAST_RADIUS * pixel:
            return None
        circle = fitted
    members = free & _members(found, circle, pixel)
    center, u, v, radius, _ = circle
    flat = found.points[members] - center
    angle = np.arctan2(flat @ v, flat @ u)
    sectors = min(SECTORS, int(2 * np.pi * radius / (2 * pixel)))
    covered = len(np.unique(np.floor((angle + np.pi) / (2 * np.pi) * sectors * (1 - 1e-9)))) / sectors
    return (circle, members) if covered >= COVERED else None


def _members(found: EdgePoints, circle: Circle, pixel: float) -> Bool[NDArray[np.bool_], " M"]:
    center, u, v, radius, _ = circle
    members = np.abs((found.points - center) @ np.cross(u, v)) < NEAR * pixel
    # Most points lie far from its plane.
    flat = found.points[members] - center
    x, y, z = flat @ u, flat @ v, flat @ np.cross(u, v)
    rho = np.hypot(x, y) + 1e-12
    tangent = (-y / rho)[:, None] * u + (x / rho)[:, None] * v
    along = np.abs((found.directions[members] * tangent).sum(1))
    members[members] = (np.hypot(rho - radius, z) < NEAR * pixel) & (along > ALONG)
    return members
