"""Ends brought to the lines that they nearly meet: T, L and Y junctions."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Int
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves, sampled
from diff3ds.curves.shapes.straight_lines import polyline_length, tangents_of
from diff3ds.edges.clean.weld import place_of_vertex
from diff3ds.edges.drawn.gaps import contradicted
from diff3ds.edges.evidence.chance import Chance

# [px, fraction; empirical] An end is brought to a line so far away at most, and by so much of the length of its curve.
REACH, SHARE = 40.0, 0.5
# [px, ratio; empirical] The line lies so near to where the curve goes on, and a little farther beside it the farther
# away it is.
BESIDE, SPREADING = 3.0, 0.25
# [ratio; empirical] To go sideways is worth so much less than to go on.
SIDEWAYS = 3.0
# [px; empirical] A line that is met so near to its own end is met there.
CORNER = 7.0
# [cosine; empirical] Beside a line that runs the same way an end is no junction: 20 degrees.
ALONG = 0.94
# [points; numerical] Points along a curve where it may be met. [rounds; numerical] Ends move to lines whose ends move.
POINTS, ROUNDS = 193, 4


@dataclass(frozen=True)
class _Meeting:
    """An end (the start of curve i is end 2 i, its stop 2 i + 1) and the place on another curve where it belongs."""

    cost: float
    end: int
    curve: int
    at: int


def with_junctions(curves: Curves, chance: Chance) -> Curves:
    """The curves, whose loose ends lie on the lines that they nearly meet, unless pictures contradict that.

    Near the end of a line both get a vertex; along a line the end lies on it.
    """
    meetings = _meetings(curves, chance)
    if not meetings:
        return curves
    fine = sampled(curves, POINTS)
    vertex = curves.vertex.reshape(-1).numpy().copy()
    on_line: list[_Meeting] = []
    for meeting in meetings:
        far = np.linalg.norm(fine[meeting.curve][[0, -1]] - fine[meeting.curve, meeting.at], axis=1)
        there = 2 * meeting.curve + int(far.argmin())
        if not bool(curves.closed[meeting.curve]) and far.min() < CORNER * chance.views.pixel:
            _share(vertex, meeting.end, there)
        else:
            on_line.append(meeting)
    curves = _moved_to_vertices(curves, vertex, fine, chance.views.pixel)
    taken = {int(v) for v, count in zip(*np.unique(vertex, return_counts=True), strict=True) if count > 1}
    return _moved_to_lines(curves, [m for m in on_line if int(vertex[m.end]) not in taken])


def _meetings(curves: Curves, chance: Chance) -> list[_Meeting]:
    """For each loose end the place where it belongs, if there is one; the nearest first."""
    from scipy.spatial import cKDTree

    pixel = chance.views.pixel
    fine = sampled(curves, POINTS)
    tangents = tangents_of(fine)
    tree = cKDTree(fine.reshape(-1, 3))
    vertex = curves.vertex.reshape(-1).numpy()
    loose = np.bincount(vertex, minlength=int(vertex.max()) + 1)[vertex] == 1
    loose &= ~np.repeat(curves.closed.numpy(), 2)
    found = []
    for end in np.nonzero(loose)[0].tolist():
        own, side = divmod(end, 2)
        place = fine[own, -side]
        ahead = tangents[own, -side] * (1 if side else -1)
        reach = min(REACH * pixel, SHARE * polyline_length(fine[own]))
        near = np.asarray(tree.query_ball_point(place, reach), np.int64)
        near = near[near // POINTS != own]
        step = fine.reshape(-1, 3)[near] - place
        on = step @ ahead
        beside = np.linalg.norm(step - on[:, None] * ahead, axis=1)
        parallel = np.abs(tangents.reshape(-1, 3)[near] @ ahead) > ALONG
        at_end = np.isin(near % POINTS, (0, POINTS - 1))
        fits = (beside < BESIDE * pixel + SPREADING * np.abs(on)) & (on > -reach / 2) & (~parallel | at_end)
        cost = np.where(fits, np.abs(on) + SIDEWAYS * beside, np.inf)
        for k in np.argsort(cost, kind="stable")[:3]:
            if np.isfinite(cost[k]) and not contradicted(chance, place, place + step[k]):
                found.append(_Meeting(float(cost[k]), end, int(near[k] // POINTS), int(near[k] % POINTS)))
                break
    return sorted(found, key=lambda meeting: (meeting.cost, meeting.end))


def _share(vertex: NDArray[np.int64], one: int, other: int) -> None:
    """Gives both ends one vertex, unless a curve would get both its ends into it."""
    members = np.nonzero((vertex == vertex[one]) | (vertex == vertex[other]))[0]
    if len(np.unique(members // 2)) == len(members):
        vertex[members] = min(vertex[one], vertex[other])


def _moved_to_vertices(
    curves: Curves, vertex: Int[NDArray[np.int64], " E"], fine: Float[Array, "N P 3"], pixel: float
) -> Curves:
    """The curves with these vertices, each where the curves that share it meet."""
    before = curves.vertex.reshape(-1).numpy()
    target = fine[:, [0, -1]].reshape(-1, 3).copy()
    outward = unit(np.stack([fine[:, 0] - fine[:, 4], fine[:, -1] - fine[:, -5]], 1).reshape(-1, 3))
    for number in np.unique(vertex):
        members = np.nonzero(vertex == number)[0]
        if len(np.unique(before[members])) > 1:
            target[members] = place_of_vertex(target[members], outward[members], pixel)
    return replace(_with_ends(curves, target), vertex=torch.from_numpy(vertex.reshape(-1, 2)))


def _moved_to_lines(curves: Curves, meetings: list[_Meeting]) -> Curves:
    """The curves with ends on the lines that they meet, which move themselves."""
    for _ in range(ROUNDS):
        fine = sampled(curves, POINTS)
        target = fine[:, [0, -1]].reshape(-1, 3).copy()
        for meeting in meetings:
            target[meeting.end] = fine[meeting.curve, meeting.at]
        curves = _with_ends(curves, target)
    return curves


def _with_ends(curves: Curves, target: Float[Array, "E 3"]) -> Curves:
    """Curves of the same kinds with their ends moved, closed ones but as they are."""
    control = curves.constrained(curves.points)[0]
    shift = torch.from_numpy(target.reshape(-1, 2, 3)).to(control.dtype) - control[:, [0, 3]]
    shift = shift.masked_fill(curves.closed[:, None, None], 0.0)
    moved = torch.cat([control[:, :2] + shift[:, :1], control[:, 2:] + shift[:, 1:]], 1)
    return replace(curves, points=moved)
