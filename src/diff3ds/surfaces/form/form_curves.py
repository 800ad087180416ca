"""From samples of a surface to the curves of its edges: forms found, labelled and cut with each other."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.edges.shapes.curve_set import Curves
from diff3ds.edges.shapes.primitives import CLOSED_KINDS, Kind, Primitive, arc_control, line_control
from diff3ds.surfaces.form.edges import Edge, corners, edges_between
from diff3ds.surfaces.form.labels import Labelled, labelled, spread
from diff3ds.surfaces.form.regular import regularised
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import found_forms, within
from diff3ds.surfaces.meshes.feature_curves import _curves, _pieces

# Samples that no form explains belong to the nearest one up to so many spacings and reaches away: what lies between
# two forms is their edge. Empirical.
BAND_SPACINGS, BAND_REACHES = 2.5, 2.0
# Points of a path per spacing where a curve has to be fitted to it.
DENSE = 4.0
# How near to its path a fitted curve stays, as a share of the longest side.
FIT = 1 / 1000
# An arc of more than this is drawn as two: see `edges.shapes.primitives.MOST_SWEEP`.
MOST_ARC = np.deg2rad(200.0)


@dataclass(frozen=True, eq=False)
class FormCurves:
    """The forms of a surface and the curves of their edges.

    Attributes:
        curves: of the edges, which share vertices at corners.
        edges: what each was made of, in their order.
        owner: of each curve the number of its edge.
        found: the forms and the labels of the samples.
    """

    curves: Curves
    edges: list[Edge]
    owner: list[int]
    found: Labelled


def form_curves(samples: Samples, seed: int = 0) -> FormCurves:
    """The edges of a surface as exact intersections of the forms that it is made of."""
    generator = np.random.default_rng(seed)
    found = labelled(samples, [one.form for one in found_forms(samples, generator)])
    found = Labelled(regularised(samples, found.label, found.forms), found.label)
    band = BAND_SPACINGS * samples.spacing + BAND_REACHES * within(samples)
    label = spread(samples, found.label, band)
    edges = edges_between(samples, found, label)
    points, vertex = corners(samples, edges, found.forms)
    pieces, owner = [], []
    places = [points]
    count = len(points)
    for row, edge in enumerate(edges):
        for run, strokes, more in _drawn(edge, vertex[row], points, count, samples):
            pieces.append((run, strokes))
            owner += [row] * len(strokes)
            if more is not None:
                places.append(more)
                count += len(more)
    return FormCurves(_curves(np.concatenate(places), pieces), edges, owner, found)


def _drawn(
    edge: Edge, ends: Array, points: Float[Array, "V 3"], count: int, samples: Samples
) -> list[tuple[list[int], list[Primitive], Float[Array, "M 3"] | None]]:
    """An edge as runs between vertices with the curves that draw them, and the vertices that they bring."""
    start, stop = (int(k) for k in ends)
    path, none = edge.path, np.zeros(0)
    if edge.closed and path.line is None:
        whole = arc_control(path.center, path.u, path.v, edge.start, edge.start + np.pi)
        return [([start, stop], [Primitive(path.kind, whole, none)], None)]
    if path.kind == Kind.LINE:
        return [([start, stop], [Primitive(Kind.LINE, line_control(points[start], points[stop]), none)], None)]
    if path.line is None:
        cuts = np.linspace(edge.start, edge.stop, 2 if edge.stop - edge.start <= MOST_ARC else 3)
        kind = CLOSED_KINDS[path.kind]
        arcs = [Primitive(kind, arc_control(path.center, path.u, path.v, a, b), none) for a, b in zip(cuts[:-1], cuts[1:], strict=True)]
        return [([start, stop], arcs, None)]
    steps = max(int(DENSE * (edge.stop - edge.start) / samples.spacing), 8)
    line = path.at(np.linspace(edge.start, edge.stop, steps + 1))
    line[0], line[-1] = points[start], points[start if edge.closed else stop]
    chain = [start, *range(count, count + steps - 1), start if edge.closed else stop]
    table = {k: i for i, k in enumerate(chain)}
    out = []
    for run, strokes in _pieces(line, list(range(len(chain))), FIT * samples.size * 2):
        out.append(([chain[k] for k in run], strokes, None))
    del table
    if out:
        out[0] = (out[0][0], out[0][1], line[1:-1])
    return out
