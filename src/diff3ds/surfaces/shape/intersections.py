"""Where the parts of a mesh go through each other: runs of points along the seams."""

from dataclasses import dataclass
from typing import cast

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.directions import unit
from diff3ds.page.boxes import BoxIndex
from diff3ds.surfaces.lines.edge_runs import seam_runs
from diff3ds.surfaces.shape.clean import SAME
from diff3ds.surfaces.shape.on_lines import along_chords
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Parts are moved by so little against each other, as a share of the mesh's size, that no corner lies on a face.
APART = 1e-9
# Triangles that cut each other at less than some 20 degrees are of surfaces in contact, as of a shaft and its bore:
# those of solids turn by up to 17 from one to the next. Cosine.
CONTACT = 0.94
# Segments that meet reach a little farther, as a share of their length: rounding.
MET = 1e-6
# Cells of the index of seams along a step of a line that is asked about. Speed only.
MOST_CELLS = 8
# Pairs of an edge and a face that are looked at together: 100 bytes each.
AT_ONCE = 1 << 21


@dataclass(frozen=True, eq=False)
class Seams:
    """Where parts go through each other.

    Attributes:
        points: where an edge of one part goes through a face of another.
        steps: pairs of points between which two faces cut each other.
        faces: one of these.
    """

    points: Float[Array, "N 3"]
    steps: Int[Index, "S 2"]
    faces: Int[Index, " S"]

    @staticmethod
    def of(mesh: TriangleMesh) -> "Seams":
        """The seams of a mesh, which keeps them."""
        kept = mesh.__dict__.get("_seams")
        if kept is None:
            kept = mesh.__dict__["_seams"] = seams(mesh)
        return cast(Seams, kept)


def places_on_seams(
    points: Float[Array, "M 3"], found: Seams, tolerance: float
) -> tuple[Int[Index, " P"], Float[Array, " P"]]:
    """Where a line from point to point goes through seams: the point before, and the share of the way to the next."""
    start, way = points[:-1], np.diff(points, axis=0)
    ends = found.points[found.steps]
    low, high = ends.min(1) - tolerance, ends.max(1) + tolerance
    # A line's steps may be a hundred times as long as those of seams: none goes through more than a few cells.
    longest = float(np.abs(way).max(initial=0.0))
    cell = max(float(np.median((high - low).max(1))), longest / MOST_CELLS) if len(low) else 1.0
    index = BoxIndex.of(low, high, cell)
    step, row = index.meeting(np.minimum(start, points[1:]), np.maximum(start, points[1:]))
    u, v, w = way[step], ends[row, 1] - ends[row, 0], ends[row, 0] - start[step]
    # The shortest way between both is at right angles to them.
    uu, uv, vv, uw, vw = (np.einsum("pi,pi->p", *pair) for pair in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    det = uu * vv - uv * uv
    safe = np.where(det > 0, det, np.inf)
    along, across = (uw * vv - vw * uv) / safe, (uw * uv - vw * uu) / safe
    away = np.linalg.norm(along[:, None] * u - w - across[:, None] * v, axis=1)
    inside = (np.abs(along - 0.5) <= 0.5 + MET) & (np.abs(across - 0.5) <= 0.5 + MET)
    met = inside & (det > 0) & (away <= tolerance)
    return step[met], np.clip(along[met], 0, 1)


def seams(mesh: TriangleMesh) -> Seams:
    """Where the pieces of a mesh that share no edge go through each other.

    Two faces cut each other along a segment. At each end of it an edge of one goes through the other, and the next face
    at this edge goes on from there. Points are known by edge and face, so that seams hang together for any rounding.
    """
    none = Seams(np.zeros((0, 3)), np.zeros((0, 2), np.int64), np.zeros(0, np.int64))
    piece = _pieces_of(mesh)
    if not piece.any():
        return none
    one, other = _near_pairs(mesh, piece)
    if not len(one):
        return none
    # Each pair of faces: the three edges of each, and the face that they may go through.
    edges = np.concatenate([mesh.face_edges[other], mesh.face_edges[one]], 1)
    faces = np.concatenate([np.repeat(one[:, None], 3, 1), np.repeat(other[:, None], 3, 1)], 1)
    key, slot = np.unique(edges * len(mesh.faces) + faces, return_inverse=True)
    edge, face = np.divmod(key, len(mesh.faces))
    through, place = _through(mesh, piece, edge, face)
    met = through[slot.reshape(edges.shape)]
    pairs = met.sum(1) == 2
    touching = np.abs(np.einsum("pi,pi->p", mesh.face_normals[one], mesh.face_normals[other])) >= CONTACT
    if mesh.surfaces:
        pairs &= ~touching
    ends = slot.reshape(edges.shape)[pairs][met[pairs]].reshape(-1, 2)
    used, steps = np.unique(ends, return_inverse=True)
    found, rows = _without_tiny_steps(Seams(place[used], steps.reshape(-1, 2), one[pairs]), SAME * mesh.size)
    if mesh.surfaces:
        return found
    between = np.unique(np.stack([piece[one], piece[other]], 1)[pairs][rows], axis=0, return_inverse=True)[1]
    return _without_contacts(mesh, found, touching[pairs][rows], between.ravel())


def _without_contacts(mesh: TriangleMesh, found: Seams, touching: Bool[Mask, " S"], between: Int[Index, " S"]) -> Seams:
    """The seams but for runs along which surfaces are in contact: where their triangles cut each other is chance.

    Of the rim of a bore, with which a shaft in it plays hide and seek, there is the crease.

    Args:
        touching: which steps are between triangles in contact.
        between: the two pieces that each is between, as a number: where they are in contact along less than half of
            their seam, they go through each other, and only touch on the way, as two equal pipes do.
    """
    ends = found.points[found.steps]
    creases = mesh.vertices[mesh.edges[mesh.is_crease | (mesh.edge_counts != 2)]]
    touching = touching | along_chords(ends.mean(1), creases, mesh.near / 2, unit(ends[:, 1] - ends[:, 0]))
    if not touching.any():
        return found
    runs = seam_runs(found.points, found.steps)
    pairs = np.sort(np.concatenate([np.stack([run[:-1], run[1:]], 1) for run in runs]), axis=1)
    keys = found.steps[:, 0] * len(found.points) + found.steps[:, 1]
    run = np.empty(len(keys), np.int64)
    run[np.searchsorted(keys, pairs[:, 0] * len(found.points) + pairs[:, 1])] = np.repeat(
        np.arange(len(runs)), [len(run) - 1 for run in runs]
    )
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    most = [(2 * np.bincount(of, length * touching) >= np.bincount(of, length))[of] for of in (run, between)]
    kept = np.flatnonzero(~(most[0] & most[1]))
    used, steps = np.unique(found.steps[kept], return_inverse=True)
    return Seams(found.points[used], steps.reshape(-1, 2), found.faces[kept])


def _hanging_together(pairs: Int[Index, "P 2"], count: int) -> Int[Index, " N"]:
    """Which group each of so many things is in, of which these pairs are in one each."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _without_tiny_steps(found: Seams, least: float) -> tuple[Seams, Int[Index, " S"]]:
    """The seams with points made one that short steps join, where corners nearly lie on faces; which steps are left."""
    points, steps = found.points, found.steps
    tiny = np.linalg.norm(points[steps[:, 0]] - points[steps[:, 1]], axis=1) < least
    group = _hanging_together(steps[tiny], len(points))
    _, first = np.unique(group, return_index=True)
    left = np.sort(group[steps[~tiny]], axis=1)
    apart = left[:, 0] != left[:, 1]
    steps, row = np.unique(left[apart], axis=0, return_index=True)
    rows = np.flatnonzero(~tiny)[apart][row]
    return Seams(points[first], steps, found.faces[rows]), rows


def _pieces_of(mesh: TriangleMesh) -> Int[Index, " F"]:
    """The piece that each face is of: faces that share an edge are of one."""
    first = mesh.edge_faces[:, 0][mesh.face_edges]
    pairs = np.stack([np.repeat(np.arange(len(first)), 3), first.ravel()], 1)
    return _hanging_together(pairs, len(first))


def _near_pairs(mesh: TriangleMesh, piece: Int[Index, " F"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
    """Pairs of faces of different pieces whose boxes meet."""
    corners = mesh.vertices[mesh.faces]
    low, high = corners.min(1), corners.max(1)
    # Faces that are in the box of no other piece meet none.
    boxes = np.full((2, int(piece.max()) + 1, 3), np.inf)
    np.minimum.at(boxes[0], piece, low)
    np.minimum.at(boxes[1], piece, -high)
    of_pieces = BoxIndex.of(boxes[0], -boxes[1], float(np.median((-boxes[1] - boxes[0]).max(1))))
    face, number = of_pieces.meeting(low, high)
    some = np.unique(face[piece[face] != number])
    if not len(some):
        return some, some
    cell = float(np.median((high - low)[some].max(1)))
    index = BoxIndex.of(low[some], high[some], cell)
    a, b = index.meeting(low[some], high[some])
    a, b = some[a], some[b]
    apart = piece[a] < piece[b]
    pairs = np.unique(a[apart] * len(low) + b[apart])
    return np.divmod(pairs, len(low))


def _through(
    mesh: TriangleMesh, piece: Int[Index, " F"], edge: Int[Index, " P"], face: Int[Index, " P"]
) -> tuple[Bool[Mask, " P"], Float[Array, "P 3"]]:
    """Which edges go through which faces, and where."""
    through, place = np.zeros(len(edge), bool), np.zeros((len(edge), 3))
    # The same small move for all of a piece, in a direction of its own.
    shift = APART * mesh.size * np.random.default_rng(0).standard_normal((int(piece.max()) + 1, 3))
    for first in range(0, len(edge), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        ends = mesh.vertices[mesh.edges[edge[some]]]
        moved = ends + shift[piece[mesh.edge_faces[edge[some], 0]]][:, None]
        a, b, c = (mesh.vertices[mesh.faces[face[some]]] + shift[piece[face[some]]][:, None]).transpose(1, 0, 2)
        p, q = moved.transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        before, after = (np.einsum("ni,ni->n", normal, x - a) for x in (p, q))
        crosses = (before > 0) != (after > 0)
        # On the same side of the three planes through the edge and a side of the face.
        sides = [np.einsum("ni,ni->n", q - p, np.cross(u - p, v - p)) > 0 for u, v in ((a, b), (b, c), (c, a))]
        inside = (sides[0] == sides[1]) & (sides[1] == sides[2])
        through[some] = crosses & inside
        t = before / np.where(before == after, 1.0, before - after)
        place[some] = ends[:, 0] + np.clip(t, 0, 1)[:, None] * (ends[:, 1] - ends[:, 0])
    return through, place
