"""Edges as runs between corners, each with the curves that draw it; edges that go on in each other are one run."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.primitives import CLOSED_KINDS, Kind, Primitive, arc_control, line_control
from diff3ds.curves.shapes.simplest import simplest
from diff3ds.surfaces.form.edges import Edge
from diff3ds.surfaces.form.rounding import TangentLine
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import within
from diff3ds.surfaces.lines.feature_curves import few_pieces

# An arc of more than this is drawn as two: see `curves.shapes.primitives.MOST_SWEEP`.
MOST_ARC = np.deg2rad(200.0)
# How near a curve stays to the edges that it draws, in longest sides and in reaches, whichever is more. Empirical.
FIT, FIT_REACHES = 1 / 1000, 0.3
# Edges that meet at less than this, cosine, may go on in each other. Empirical.
STRAIGHT_ON = 0.9
# Points along an edge per spacing of the samples, and points at an end that is not known well.
DENSE, BLURRED = 3.0, 4


@dataclass(eq=False)
class Run:
    """A curve between two corners: its ends, strokes that draw it one after the other, the edges that it stands for."""

    vertices: list[int]
    strokes: list[Primitive]
    edges: list[int]
    line: Float[Array, "M 3"]
    closed: bool


def drawn_runs(
    samples: Samples,
    edges: list[Edge],
    points: Float[Array, "V 3"],
    vertex: Int[Index, "E 2"],
    instead: Sequence[TangentLine] = (),
) -> tuple[list[Run], Float[Array, "W 3"]]:
    """The runs, and the points that their vertices number.

    Args:
        instead: what is drawn instead of their edges.
    """
    left_out = {tangent.edge for tangent in instead}
    runs = [_run(samples, row, edge, points, vertex[row]) for row, edge in enumerate(edges) if row not in left_out]
    tolerance = 2 * max(FIT * samples.size, FIT_REACHES * within(samples))
    runs = _joined(runs, points, tolerance)
    out: list[Run] = []
    places, count = [points], len(points)
    for tangent in instead:
        first, last = count, count if tangent.closed else count + 1
        runs.append(Run([first, last], [], [tangent.edge], tangent.line, tangent.closed))
        places.append(tangent.line[[0] if tangent.closed else [0, -1]])
        count = last + 1
    lines = [run.line for run in runs if not run.strokes]
    stops = np.cumsum([0, *map(len, lines)]).tolist()
    chains = [list(range(*ends)) for ends in pairwise(stops)]
    fitted = zip(chains, few_pieces(np.concatenate([points[:0], *lines]), chains, tolerance), strict=True)
    for run in runs:
        if run.strokes:
            out.append(run)
            continue
        # Vertices of its own for the points between its ends.
        line = run.line
        numbers = [run.vertices[0], *range(count, count + len(line) - 2), run.vertices[-1]]
        places.append(line[1:-1])
        count += len(line) - 2
        chain, pieces = next(fitted)
        for piece, strokes in pieces:
            ends = [numbers[k - chain[0]] for k in (piece[0], piece[-1])]
            out.append(Run(ends, strokes, run.edges, line, run.closed))
    return out, np.concatenate(places)


def _run(samples: Samples, row: int, edge: Edge, points: Float[Array, "V 3"], ends: Index) -> Run:
    """An edge, with exact curves where its path is exact and none where a curve has to be fitted."""
    start, stop = (int(k) for k in ends)
    path = edge.path
    length = (edge.stop - edge.start) * path.speed
    line = path.at(np.linspace(edge.start, edge.stop, max(int(DENSE * length / samples.spacing), 8) + 1))
    if edge.closed and path.line is None:
        whole = arc_control(path.center, path.u, path.v, edge.start, edge.start + np.pi)
        return Run([start, stop], [Primitive(path.kind, whole, np.zeros(0))], [row], line, True)
    if edge.closed:
        line[-1] = line[0]
        return Run([start, start], [], [row], line, True)
    line[0], line[-1] = points[start], points[stop]
    strokes = []
    if path.kind == Kind.LINE:
        strokes = [Primitive(Kind.LINE, line_control(points[start], points[stop]), np.zeros(0))]
    elif path.line is None:
        cuts = np.linspace(edge.start, edge.stop, 2 if edge.stop - edge.start <= MOST_ARC else 3)
        kind = CLOSED_KINDS[path.kind]
        controls = [arc_control(path.center, path.u, path.v, a, b) for a, b in pairwise(cuts)]
        strokes = [Primitive(kind, control, np.zeros(0)) for control in controls]
    return Run([start, stop], strokes, [row], line, False)


def _joined(runs: list[Run], points: Float[Array, "V 3"], tolerance: float) -> list[Run]:
    """Runs that go on in each other where no third begins are one, if one curve draws both."""
    alive: list[Run | None] = list(runs)
    at: dict[int, list[int]] = {}
    for k, run in enumerate(runs):
        if not run.closed:
            for v in run.vertices:
                at.setdefault(v, []).append(k)
    for v in sorted(at):
        if len(at[v]) != 2 or at[v][0] == at[v][1]:
            continue
        one, other = (alive[k] for k in at[v])
        both = None if one is None or other is None else _both(one, other, v, tolerance)
        if both is None:
            continue
        kept, gone = at[v]
        alive[kept], alive[gone] = both, None
        at[v] = []
        for w in both.vertices:
            at[w] = [kept if k == gone else k for k in at[w]]
    return [run for run in alive if run is not None]


def _both(one: Run, other: Run, v: int, tolerance: float) -> Run | None:
    """Two runs that share a vertex as one, if one curve draws them."""
    first = one.line if one.vertices[-1] == v else one.line[::-1]
    second = other.line if other.vertices[0] == v else other.line[::-1]
    if unit(first[-1] - first[-2]) @ unit(second[1] - second[0]) < STRAIGHT_ON:
        return None
    start = one.vertices[0] if one.vertices[-1] == v else one.vertices[-1]
    stop = other.vertices[-1] if other.vertices[0] == v else other.vertices[0]
    # Where the two meet is not known as well as where they go.
    line = np.concatenate([first[: -min(BLURRED, len(first) // 3)], second[min(BLURRED, len(second) // 3) :]])
    strokes = simplest(line, tolerance)
    if not strokes or len(strokes) > 1 or strokes[0].kind in CLOSED_KINDS:
        return None
    return Run([start, stop], strokes, one.edges + other.edges, line, False)
