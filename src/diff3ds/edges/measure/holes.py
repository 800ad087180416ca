"""Holes through an object: which circles are the two ends of one, and where the background shows through it."""

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.primitives import Circle
from diff3ds.edges.evidence.edge_views import EdgeViews

# [fraction, cosine, px; empirical] The two ends of a hole: radii to this fraction, axes to this angle, centres so far
# beside the axis.
ALIKE, PARALLEL, BESIDE = 0.03, np.cos(np.deg2rad(4.0)), 2.0
# [px; empirical] Less deep holes and pockets cannot be told from rims that are seen badly.
SHALLOWEST = 5.0
# [px; empirical] What lies beside an edge in the picture is looked at so far from it.
INSIDE = 2.0


def other_ends(circles: dict[int, Circle], pixel: float) -> dict[int, Circle]:
    """For each whole circle the nearest other one of its radius on its axis, if there is one."""
    found = {}
    for i, one in circles.items():
        ends = [other for k, other in circles.items() if k != i and _ends(one, other, pixel)]
        if ends:
            found[i] = min(ends, key=lambda other: float(np.linalg.norm(other.center - one.center)))
    return found


def _ends(one: Circle, other: Circle, pixel: float) -> bool:
    """Whether two circles may be the ends of one cylinder."""
    axis = np.cross(one.u, one.v)
    step = other.center - one.center
    beside = float(np.linalg.norm(step - (step @ axis) * axis))
    alike = abs(one.radius - other.radius) < ALIKE * one.radius
    return bool(alike and abs(axis @ np.cross(other.u, other.v)) > PARALLEL and beside < BESIDE * pixel)


def seen_through(
    circle: Circle, end: Circle, angle: Float[Array, " S"], views: EdgeViews
) -> Bool[NDArray[np.bool_], "V S"]:
    """Where each view sees the background on the inner side of the circle, if it is an end of a hole through.

    Looking into the hole, it does where the line of sight beside the rim leaves by the other end; looking at the
    circle through the hole, everywhere.
    """
    out = circle.center - end.center
    out = out / np.linalg.norm(out)
    ray = np.cos(angle)[:, None] * circle.u + np.sin(angle)[:, None] * circle.v
    beside = circle.center + max(circle.radius - INSIDE * views.pixel, 0.0) * ray
    eye = views.centers[:, None]
    sight = beside - eye
    along = ((end.center - eye) @ out) / np.where(np.abs(sight @ out) < 1e-12, 1e-12, sight @ out)
    leaves = np.linalg.norm(eye + along[..., None] * sight - end.center, axis=-1) < end.radius
    front = (eye - circle.center) @ out > 0
    return np.asarray(~front | (leaves & (along > 1)))
