"""Straight edges between vertices that are there, where the views show one and no curve explains it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Int
from diff3ds.camera import Cameras
from diff3ds.curves.directions import dot, unit
from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Kind, Primitive, line_control
from diff3ds.curves.shapes.smooth_joints import smooth_joints
from diff3ds.curves.shapes.straight_lines import off_segment
from diff3ds.edges.clean.weld import WITHIN
from diff3ds.edges.complete.hypothesis import COVERED, SAMPLES, SEEN, SHOWN, Hypothesis, fraction_shown
from diff3ds.edges.evidence.edge_views import EdgeViews, edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.unexplained import unexplained
from diff3ds.edges.measure.fit_ridges import LEAST_LINE
from diff3ds.edges.watch import Capped, Tick, no_tick, not_said
from diff3ds.parallel.in_copies import in_copies

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# A sample point farther from all curves than ends that meet is open. An open part is no shorter than a line that is
# measured, pixels.
OPEN, SHORTEST = WITHIN, LEAST_LINE
# [points; speed] Samples looked at first, to pass over most pairs quickly.
GLANCE = 4
# [pairs; speed] Of so many pairs of vertices, the shortest, each is looked at: all those of 630 vertices, while CAD
# models have some dozens to hundreds. Between those of thousands a long line is more likely chance.
MOST_PAIRS = 200_000
# [pairs; speed] So many are worth a copy of the process.
A_COPY = 100


@dataclass(frozen=True, eq=False)
class _Drawing:
    """Curves, and what all pairs of vertices are looked up in.

    Attributes:
        names, places, degree: numbers of the vertices (increasing), where they are, how many curves end there.
        lines, ends: which of the curves are lines, and their ends.
        tree: of points along all curves.
        smooth: the vertices where two curves meet smoothly: outlines of a rounded edge start there, no edge.
    """

    curves: Curves
    names: Int[NDArray[np.int64], " N"]
    places: Float[Array, "N 3"]
    degree: Int[NDArray[np.int64], " N"]
    lines: Int[NDArray[np.int64], " L"]
    ends: Float[Array, "L 2 3"]
    tree: "cKDTree"
    smooth: frozenset[int]


@dataclass(frozen=True)
class _Bridge:
    """A line between two vertices, and the pieces of it that were found already."""

    vertices: tuple[int, int]
    pieces: tuple[int, ...]
    views: float


def bridged(
    curves: Curves,
    cameras: Cameras,
    views: EdgeViews,
    ridges: Sequence[Ridges],
    min_views: float,
    tick: Tick = no_tick,
    capped: Capped = not_said,
) -> Curves:
    """The curves with a line wherever the views show one between two vertices; a line with a gap becomes whole.

    Args:
        ridges: of the views.
        min_views: so many views confirm an edge.
        tick: told how far it is; see `watch`.
        capped: told of what there was too much; see `watch`.
    """
    if not len(curves):
        return curves
    likely = _likely(curves, views, SHOWN * min_views, capped)
    rest = edge_views(cameras, unexplained(views, ridges, curves)) if likely else views
    found: dict[tuple[int, int], _Bridge | None] = {}
    again = likely
    while True:
        drawing = _drawing(curves)
        found |= zip(again, _bridges(drawing, again, views, rest, SHOWN * min_views, tick), strict=True)
        # The bridge that joins most pieces, of these the one that most views show.
        bridges = [bridge for pair in likely if (bridge := found[pair]) is not None]
        best = max(bridges, key=lambda bridge: (len(bridge.pieces), bridge.views), default=None)
        if best is None:
            return curves
        curves, place = _with(curves, best)
        known = set(_vertices(curves)[0].tolist())
        likely = [pair for pair in likely if known.issuperset(pair)]
        again = [likely[i] for i in _touching(drawing, likely, best, views.pixel)]
        found = {pair: _renumbered(found[pair], place) for pair in likely}


def _likely(curves: Curves, views: EdgeViews, min_views: float, capped: Capped) -> list[tuple[int, int]]:
    """Pairs of vertices with ridges in enough views nearly all the way between them."""
    names, places, _ = _vertices(curves)
    pairs = np.stack(np.triu_indices(len(names), 1), 1)
    length = np.linalg.norm(places[pairs[:, 1]] - places[pairs[:, 0]], axis=1)
    pairs, length = pairs[length > SHORTEST * views.pixel], length[length > SHORTEST * views.pixel]
    if len(pairs) > MOST_PAIRS:
        capped("pairs of vertices", MOST_PAIRS, len(pairs))
        pairs = pairs[np.sort(np.argsort(length, kind="stable")[:MOST_PAIRS])]
    # At a few points all must be shown, then at all of them as many as of a line.
    for count, most in ((GLANCE, 0.0), (SAMPLES, (1 - COVERED) * SAMPLES)):
        missed = np.zeros(len(pairs), np.int64)
        for fraction in (np.arange(count) + 0.5) / count:
            missed += _views_there(places[pairs], fraction, views) < min_views
            pairs, missed = pairs[missed <= most], missed[missed <= most]
    return [(int(names[a]), int(names[b])) for a, b in pairs]


def _views_there(ends: Float[Array, "P 2 3"], fraction: float, views: EdgeViews) -> Int[NDArray[np.int64], " P"]:
    """How many views show lines between pairs of ends at this fraction of the way."""
    return np.asarray(_between(ends, np.array([fraction])).shown(views, SEEN).sum(0)[:, 0])


def _drawing(curves: Curves) -> _Drawing:
    from scipy.spatial import cKDTree

    lines = np.nonzero((curves.kind == Kind.LINE).numpy())[0]
    ends = curves.points.double().numpy()[lines][:, [0, 3]]
    tree = cKDTree(sampled(curves, 4 * SAMPLES).reshape(-1, 3))
    smooth = frozenset(curves.vertex.numpy().reshape(-1)[smooth_joints(curves)[:, 0]].tolist())
    return _Drawing(curves, *_vertices(curves), lines, ends, tree, smooth)


def _touching(
    drawing: _Drawing, pairs: list[tuple[int, int]], bridge: _Bridge, pixel: float
) -> Int[NDArray[np.int64], " K"]:
    """Between which pairs a line passes a bridge so close that one of them says something of the other."""
    start, stop = drawing.places[np.searchsorted(drawing.names, bridge.vertices)]
    ends = drawing.places[np.searchsorted(drawing.names, np.array(pairs, np.int64).reshape(-1, 2))]
    way = ends[:, 1:] - ends[:, :1]
    x = ends[:, :1] + np.linspace(0, 1, 2 * SAMPLES)[:, None] * way
    spacing = np.sqrt(dot(way, way)) / SAMPLES
    return np.nonzero((off_segment(x, start, stop) < (OPEN + SEEN) * pixel + spacing).any(1))[0]


def _renumbered(bridge: _Bridge | None, place: NDArray[np.int64]) -> _Bridge | None:
    """The bridge with the numbers that its pieces have now."""
    return None if bridge is None else replace(bridge, pieces=tuple(int(place[i]) for i in bridge.pieces))


def _vertices(curves: Curves) -> tuple[NDArray[np.int64], Float[Array, "N 3"], NDArray[np.int64]]:
    """Numbers of all vertices, where they are, and how many curves end there; closed curves have none."""
    single = ~curves.closed.numpy()
    points = curves.constrained(curves.points)[0].double().numpy()[single][:, [0, 3]].reshape(-1, 3)
    names, first, degree = np.unique(curves.vertex.numpy()[single].reshape(-1), return_index=True, return_counts=True)
    return names, points[first], degree


def _between(ends: Float[Array, "P 2 3"], fraction: Float[Array, " S"]) -> Hypothesis:
    """Lines between pairs of vertices, sampled at these fractions of the way."""
    way = ends[:, 1:] - ends[:, :1]
    return Hypothesis(ends[:, :1] + fraction[:, None] * way, np.repeat(unit(way), len(fraction), axis=1))


def _bridges(
    drawing: _Drawing,
    pairs: list[tuple[int, int]],
    views: EdgeViews,
    rest: EdgeViews,
    min_views: float,
    tick: Tick,
) -> list[_Bridge | None]:
    """What `_bridge` gives for each pair."""
    # Of few pairs a copy would take longer than it saves.
    copies = len(pairs) // A_COPY
    return in_copies(
        lambda k: _bridge(drawing, pairs[k], views, rest, min_views),
        len(pairs),
        max(1, copies),
        lambda done: tick(done, len(pairs)),
    )


def _bridge(
    drawing: _Drawing, vertices: tuple[int, int], views: EdgeViews, rest: EdgeViews, min_views: float
) -> _Bridge | None:
    """The bridge between a pair of vertices, if the views show it wherever it is open."""
    curves, names, places = drawing.curves, drawing.names, drawing.places
    pair = np.searchsorted(names, vertices)
    pixel = views.pixel
    start, stop = places[pair]
    # Lines that lie along it.
    along = _beside(drawing.ends.reshape(-1, 3), start, stop, pixel).reshape(-1, 2).all(1)
    pieces = tuple(drawing.lines[along].tolist())
    # It may pass the loose ends of its own pieces, no other vertex.
    loose = np.zeros(len(names), bool)
    loose[np.searchsorted(names, curves.vertex.numpy()[list(pieces)])] = True
    passed = _beside(places, start, stop, pixel) & ~(loose & (drawing.degree == 1))
    passed[pair] = False
    if passed.any():
        return None
    # A line with a gap: its own ridges run on.
    whole = len(pieces) > 1
    if not whole and not drawing.smooth.isdisjoint(vertices):
        return None
    line = _between(np.stack([start, stop])[None], (np.arange(SAMPLES) + 0.5) / SAMPLES)
    open_ = drawing.tree.query(line.x[0])[0] > OPEN * pixel
    if open_.sum() * np.linalg.norm(stop - start) / SAMPLES < (0 if whole else SHORTEST) * pixel:
        return None
    shown = line.shown(views if whole else rest, SEEN)[:, 0]
    shown = shown if whole else shown[:, open_]
    if fraction_shown(shown, min_views) < COVERED:
        return None
    return _Bridge(vertices, pieces, float(shown.sum(0).mean()))


def _beside(
    x: Float[Array, "M 3"], start: Float[Array, " 3"], stop: Float[Array, " 3"], pixel: float
) -> Bool[NDArray[np.bool_], " M"]:
    """Which points lie on the segment, but for a pixel or so."""
    return np.asarray(off_segment(x, start, stop) < SEEN * pixel)


def _with(curves: Curves, bridge: _Bridge) -> tuple[Curves, NDArray[np.int64]]:
    """The curves with the bridge instead of its pieces, and the new numbers of the old curves."""
    names, places, _ = _vertices(curves)
    ends = [places[names == name][0] for name in bridge.vertices]
    line = curves_of([Primitive(Kind.LINE, line_control(*ends), np.zeros(0))])
    keep = torch.ones(len(curves), dtype=torch.bool)
    keep[list(bridge.pieces)] = False
    joined = concatenated(curves[keep], line)
    vertex = joined.vertex.clone()
    vertex[-1] = torch.tensor(bridge.vertices)
    return replace(joined, vertex=vertex), (keep.cumsum(0) - 1).numpy()
