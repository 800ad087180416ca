"""Arcs between two lines that meet them smoothly, made exactly tangent: the rounded corners of a drawing."""

from dataclasses import dataclass, replace

import numpy as np
import torch

from diff3ds._shapes import Float
from diff3ds.edges.curves import Curves
from diff3ds.edges.primitives import Kind
from diff3ds.edges.ridges import Array

# An arc and a line that meet at less than this angle are meant to be tangent; points move by at most so many pixels
# for it. Empirical.
SMOOTH, MOST_MOVE = np.deg2rad(15.0), 1.5
# Two fillets share a line, so that each moves the other a little; it settles fast.
ROUNDS = 12


@dataclass(frozen=True)
class _Fillet:
    """An arc, and for each of its ends the line that it meets, with the end of the line (0 or 1) there."""

    arc: int
    lines: tuple[int, int]
    ends: tuple[int, int]


def with_fillets(curves: Curves, pixel: float) -> Curves:
    """Curves whose arcs between two lines meet both of them at no angle, wherever they nearly do.

    The tangents from the lines' common point to a circle are equally long; so are those of the new arc, and its ends
    lie on the lines.
    """
    start = curves.constrained(curves.points)[0].double().numpy()
    fillets = _fillets(curves, start)
    while fillets:
        points = start.copy()
        for _ in range(ROUNDS):
            for fillet in fillets:
                _make_tangent(points, fillet)
        moved = [np.abs(points[f.arc] - start[f.arc]).max() / pixel for f in fillets]
        if max(moved) <= MOST_MOVE:
            return replace(curves, points=torch.from_numpy(points).to(curves.points.dtype))
        fillets = [f for f, move in zip(fillets, moved, strict=True) if move <= MOST_MOVE]
    return curves


def _fillets(curves: Curves, points: Float[Array, "N 4 3"]) -> list[_Fillet]:
    """The arcs that nearly touch a line at both ends, where nothing else meets."""
    vertex = curves.vertex.numpy()
    found = []
    for arc in np.nonzero((curves.kind == Kind.ARC).numpy() & (curves.other < 0).numpy())[0]:
        met = []
        for end in (0, 1):
            curve, at = np.nonzero(vertex == vertex[arc, end])
            others = [(int(c), int(e)) for c, e in zip(curve, at, strict=True) if c != arc]
            if len(others) == 1 and int(curves.kind[others[0][0]]) == Kind.LINE:
                out = _heading(points[others[0][0]], others[0][1])
                into = -_heading(points[arc], end)
                if out @ into > np.cos(SMOOTH):
                    met.append(others[0])
        if len(met) == 2 and met[0][0] != met[1][0]:
            found.append(_Fillet(int(arc), (met[0][0], met[1][0]), (met[0][1], met[1][1])))
    return found


def _heading(points: Float[Array, "4 3"], end: int) -> Float[Array, " 3"]:
    """Unit tangent at an end, pointing out of the curve."""
    step = points[0] - points[1] if end == 0 else points[3] - points[2]
    return step / (np.linalg.norm(step) + 1e-12)


def _make_tangent(points: Float[Array, "N 4 3"], fillet: _Fillet) -> None:
    """Moves the ends of the arc along its lines, and bends it, in place."""
    far = [points[line][3 if end == 0 else 0] for line, end in zip(fillet.lines, fillet.ends, strict=True)]
    near = [points[fillet.arc][0], points[fillet.arc][3]]
    corner = _meeting(far, near)
    if corner is None:
        return
    length = np.mean([np.linalg.norm(corner - p) for p in near])
    ends = [corner - length * _unit(corner - f) for f in far]
    for (line, end), place, away in zip(zip(fillet.lines, fillet.ends, strict=True), ends, far, strict=True):
        stops = (place, away) if end == 0 else (away, place)
        points[line] = stops[0] + np.linspace(0, 1, 4)[:, None] * (stops[1] - stops[0])
    weight = np.linalg.norm(ends[1] - ends[0]) / (2 * length)
    inner = [(end + 2 * weight * corner) / (1 + 2 * weight) for end in ends]
    points[fillet.arc] = np.stack([ends[0], inner[0], inner[1], ends[1]])


def _meeting(far: list[Array], near: list[Array]) -> Float[Array, " 3"] | None:
    """The middle between the nearest points of two lines; None if they are parallel."""
    a, b = (_unit(n - f) for n, f in zip(near, far, strict=True))
    across = 1 - (a @ b) ** 2
    if across < 1e-3:
        return None
    gap = near[1] - near[0]
    s = (gap @ a - (gap @ b) * (a @ b)) / across
    t = ((gap @ a) * (a @ b) - gap @ b) / across
    return (near[0] + s * a + near[1] + t * b) / 2


def _unit(vector: Float[Array, " 3"]) -> Float[Array, " 3"]:
    return vector / (np.linalg.norm(vector) + 1e-12)
