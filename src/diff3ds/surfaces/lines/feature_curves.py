"""Feature curves of a triangle mesh: creases, borders and seams as lines, arcs of circles and ellipses, fair cubics."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import torch

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import all_around
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.primitives import CLOSED_KINDS, Kind, Primitive
from diff3ds.curves.shapes.simplest import simplest
from diff3ds.parallel.in_copies import in_copies
from diff3ds.surfaces.lines.edge_runs import Run, edge_runs, seam_runs
from diff3ds.surfaces.shape.intersections import Seams
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Curves keep within half of this, as a share of the mesh's longest side.
PIXEL = 1 / 256
# From so many places a mesh's outlines are looked at.
DIRECTIONS = 32
# Three points are always on a circle, four on a cubic, and five of a plane on a conic.
LEAST_ARC, LEAST_CUBIC, LEAST_ELLIPSE = 4, 5, 6
# To fit so many chains takes longer than to make a copy of the process. Empirical; speed only.
WORTH_COPY = 16


Feature = Literal["crease", "border", "intersection"]


@dataclass(frozen=True, eq=False)
class FeatureCurves:
    """Curves of a mesh that do not depend on the view.

    Attributes:
        curves: in the mesh's frame; they share vertices where edges of the mesh meet.
        kinds: of each: "crease", "border" (of one face, or of more than two), or "intersection", where two pieces of
            the mesh go through each other.
        runs: runs of edges between places where they branch, end or turn sharply.
        loose: how many of these have an end where no other begins: few of a machine part's do, most of an animal's.
    """

    curves: Curves
    kinds: tuple[Feature, ...]
    runs: int
    loose: int

    def __len__(self) -> int:
        return len(self.curves)


def feature_curves(mesh: TriangleMesh, most: int | None = None) -> FeatureCurves:
    """The creases, borders and seams of a mesh; round shapes without an edge have none: outlines depend on the view.

    Args:
        mesh: faces that meet at more than its `crease` make a crease.
        most: more runs of edges are an error, before anything is fitted.

    Raises:
        ValueError: there are more than `most`.
    """
    seam = Seams.of(mesh)
    chains = _runs(mesh)
    cuts = seam_runs(seam.points, seam.steps)
    if most is not None and len(chains) + len(cuts) > most:
        borders = sum(border for _, border in chains)
        raise ValueError(_too_many({"creases": len(chains) - borders, "borders": borders, "seams": len(cuts)}, most))
    pixel = PIXEL * mesh.size
    places = np.concatenate([mesh.vertices, seam.points])
    named: list[tuple[list[int], Feature]] = [(chain, "border" if border else "crease") for chain, border in chains]
    named += [([len(mesh.vertices) + i for i in cut], "intersection") for cut in cuts]
    fitted = few_pieces(places, [chain for chain, _ in named], pixel)
    found = [(piece, kind) for (_, kind), pieces in zip(named, fitted, strict=True) for piece in pieces]
    curves = curves_of(places, [piece for piece, _ in found])
    kinds = tuple(kind for (_, strokes), kind in found for _ in strokes)
    return FeatureCurves(curves, kinds, len(chains), _loose(mesh, chains))


def _too_many(count: dict[str, int], most: int) -> str:
    """What a mesh of too many lines has, and what to do about the kind that most of them are."""
    kind = max(count, key=count.__getitem__)
    advice = {
        "creases": "as a scan's noise makes: smooth or simplify it, or take a larger angle for creases",
        "borders": "of holes, or of faces that share no corners: merge its vertices, close its holes, or simplify it",
        "seams": "where its pieces go through each other: unite these, or leave some out",
    }
    return f"the mesh has {sum(count.values())} feature lines, more than {most}: {count[kind]} {kind}, {advice[kind]}"


def loose_share(mesh: TriangleMesh) -> float:
    """Which share of the runs of creases and borders has an end where no other begins, in [0, 1]; nothing is fitted."""
    runs = _runs(mesh)
    return _loose(mesh, runs) / len(runs) if runs else 0.0


def crease_length(mesh: TriangleMesh) -> float:
    """How long the run is on which a point of the creases lies in the mean, world units; 0 where there are none."""
    creases = [mesh.vertices[chain] for chain, border in _runs(mesh) if not border]
    lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for points in creases]
    return float(np.average(lengths, weights=lengths)) if lengths else 0.0


def outline_share(mesh: TriangleMesh) -> float:
    """Which share of the outlines the feature curves draw, in [0, 1]: of a box all, of a sphere nothing.

    By length in pictures from `DIRECTIONS` far places all around, hidden parts included.
    """
    one, other = mesh.edge_faces.T
    single = mesh.edge_counts != 2
    sharp = mesh.is_crease | single
    drawn, whole = 0.0, 0.0
    for view in all_around(DIRECTIONS):
        facing = mesh.face_normals @ view
        # Edges without a second face are outlines from everywhere.
        outline = single | ~(facing[one] * facing[other] > 0)
        ends = mesh.vertices[mesh.edges[outline]]
        length = np.linalg.norm(np.cross(ends[:, 1] - ends[:, 0], view), axis=1)
        drawn, whole = drawn + length[sharp[outline]].sum(), whole + length.sum()
    return float(drawn / whole) if whole else 1.0


def _runs(mesh: TriangleMesh) -> list[Run]:
    """The creases and borders, from where they branch, end or turn sharply."""
    sharp = mesh.is_crease | (mesh.edge_counts != 2)
    return list(edge_runs(mesh.vertices, mesh.edges[sharp], (mesh.edge_counts != 2)[sharp]))


def _loose(mesh: TriangleMesh, runs: list[Run]) -> int:
    """How many runs have an end where no other begins."""
    ends = np.array([(chain[0], chain[-1]) for chain, _ in runs], np.int64).reshape(-1, 2)
    count = np.bincount(ends.ravel(), minlength=len(mesh.vertices))
    return int((count[ends] == 1).any(1).sum())


# A run of vertices and the strokes that draw it.
Piece = tuple[list[int], list[Primitive]]


def few_pieces(vertices: Float[Array, "V 3"], chains: Sequence[list[int]], pixel: float) -> list[list[Piece]]:
    """Each chain in as few curves as can be from its start: each goes as far as it fits."""
    copies = max(1, len(chains) // WORTH_COPY)
    return in_copies(lambda row: list(_few_pieces(vertices, chains[row], pixel)), len(chains), copies)


def _few_pieces(vertices: Float[Array, "V 3"], chain: list[int], pixel: float) -> Iterator[Piece]:
    while len(chain) > 1:
        count, strokes = _longest(vertices[chain], pixel)
        yield chain[:count], strokes
        chain = chain[count - 1 :]


def _longest(points: Float[Array, "M 3"], pixel: float) -> tuple[int, list[Primitive]]:
    """How many of the points, from the first on, one curve fits: twice as many while it does, then between."""

    def fit(count: int) -> list[Primitive] | None:
        return _fit(points[:count], pixel)

    # A part of an ellipse may say too little about it.
    if found := fit(len(points)):
        return len(points), found
    few = min(len(points), LEAST_CUBIC)
    good, found = next((count, found) for count in range(few, 1, -1) if (found := fit(count)))
    if good < few:
        return good, found
    bad = min(2 * good, len(points))
    while more := fit(bad):
        good, found, bad = bad, more, min(2 * bad, len(points))
    while bad - good > 1:
        middle = (good + bad) // 2
        if more := fit(middle):
            good, found = middle, more
        else:
            bad = middle
    return good, found


def _fit(points: Float[Array, "M 3"], pixel: float) -> list[Primitive] | None:
    """The simplest curve through the points, if there is one and they leave it no choice."""
    found = simplest(points, pixel)
    least = {Kind.LINE: 2, Kind.ARC: LEAST_ARC, Kind.FREE: LEAST_CUBIC, Kind.ELLIPTIC_ARC: LEAST_ELLIPSE}
    if not found or len(points) < least[CLOSED_KINDS.get(found[0].kind, found[0].kind)]:
        return None
    return found


def curves_of(vertices: Float[Array, "V 3"], pieces: list[Piece]) -> Curves:
    """All curves; those that are not closed meet in the vertices of the mesh."""
    if not pieces:
        none = torch.zeros(0, 2, dtype=torch.int64)
        return Curves(torch.zeros(0, 4, 3, dtype=torch.float64), none[:, 0], none)
    control: list[Array] = []
    kinds, ends = [], []
    fresh = len(vertices)
    for run, strokes in pieces:
        points = [stroke.control.copy() for stroke in strokes]
        if strokes[0].kind in CLOSED_KINDS:
            stops = [fresh, fresh + 1]
        else:
            stops = [run[0], *range(fresh, fresh + len(strokes) - 1), run[-1]]
            points[0][0], points[-1][-1] = vertices[run[0]], vertices[run[-1]]
        fresh += len(strokes) + 1
        control += points
        kinds += [int(stroke.kind) for stroke in strokes]
        ends += [*pairwise(stops)]
    _, vertex = np.unique(np.array(ends), return_inverse=True)
    return Curves(torch.from_numpy(np.stack(control)), torch.tensor(kinds), torch.from_numpy(vertex.reshape(-1, 2)))
