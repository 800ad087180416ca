"""Ends of curves that were fitted one by one brought together where the curves meet."""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves, curves_of
from diff3ds.curves.shapes.primitives import Kind, Primitive, angles_of, arc_control, fit_circle, turned
from diff3ds.curves.shapes.straight_lines import nearest_to_lines, outward_tangent

# [ratio; numerical] Pull of a vertex towards where it was, against each curve that was fitted: decides along curves
# that meet smoothly.
OWN = 1e-3
# [px; empirical] Vertices and curves move by at most so much: what moves farther was another one.
FARTHEST = 2.0


def met(curves: Curves, old: Float[Array, "N 4 3"], sure: Bool[NDArray[np.bool_], " N"], pixel: float) -> Curves:
    """The curves with shared ends where those that are sure meet; the means of ends would pull them aside.

    Args:
        old: control points in which ends were shared.
        sure: curves that were fitted.
    """
    points = curves.points.double().numpy().copy()
    vertex = curves.vertex.numpy()
    alone = ~curves.closed.numpy()
    for name in np.unique(vertex[alone]):
        here = [(int(r), int(e)) for r, e in zip(*np.nonzero((vertex == name) & alone[:, None]), strict=True)]
        before = old[here[0][0], 3 * here[0][1]]
        known = [(r, e) for r, e in here if sure[r]]
        if not known:
            continue
        through = np.stack([points[r, 3 * e] for r, e in known])
        along = np.stack([outward_tangent(points[r], e) for r, e in known])
        place = nearest_to_lines(through, along, before, OWN)
        if np.linalg.norm(place - before) > FARTHEST * pixel:
            place = before
        for r, e in here:
            _end_at(points[r], e, place, int(curves.kind[r]))
    return replace(curves, points=torch.from_numpy(points).to(curves.points.dtype))


def _end_at(points: Float[Array, "4 3"], end: int, place: Array, kind: int) -> None:
    """Moves an end, in place: lines stay straight, arcs end on their circles where they come nearest."""
    if kind == Kind.LINE:
        far = points[3 if end == 0 else 0].copy()
        points[:] = np.linspace(place, far, 4) if end == 0 else np.linspace(far, place, 4)
    elif kind == Kind.ARC:
        points[:] = _arc_to(points, end, place)
    else:
        points[[0, 1] if end == 0 else [2, 3]] += place - points[3 * end]


def _arc_to(points: Float[Array, "4 3"], end: int, place: Array) -> Float[Array, "4 3"]:
    """The arc of the same circle that ends nearest to a point."""
    through = curves_of([Primitive(Kind.ARC, points, np.zeros(0))]).at(torch.linspace(0, 1, 9))[0]
    circle = fit_circle(through.double().numpy())
    if circle is None:
        return points
    first, middle, last, target = angles_of(circle, np.stack([points[0], points[1:3].mean(0), points[3], place]))
    ends = [middle + turned((target if k == end else a) - middle) for k, a in enumerate((first, last))]
    return arc_control(circle.center, circle.radius * circle.u, circle.radius * circle.v, *ends)
