"""Where points lie on a mesh: the crease, border or face that each is on, within a tolerance."""

from functools import cached_property
from typing import cast

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int, Tensor
from diff3ds.page.boxes import all_of, slices
from diff3ds.render.backends import for_kernels, kernels
from diff3ds.surfaces.shape.intersections import Seams
from diff3ds.surfaces.shape.on_lines import index_of, on_segments
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Points that nothing is so near to are looked for so much farther away.
WIDER = 4.0
# Of barycentric coordinates: so near to an edge or a corner of a face, a point lies on it.
ON_EDGE = 1e-9


class Nearest:
    """Finds the places of points on a mesh.

    Creases, borders, branches and seams, where pieces go through each other, come before faces: a curve that was fitted
    to one runs on either side of it within the tolerance, and is seen where the edge or the seam is.
    """

    def __init__(self, mesh: TriangleMesh, tolerance: float, edges_first: bool = True) -> None:
        """Prepares a search.

        Args:
            mesh: where points are looked for.
            tolerance: how far from the mesh a point may be and still lie on it, world units.
            edges_first: whether creases, borders, branches and seams come before faces that are nearer.
        """
        self.mesh, self.tolerance = mesh, tolerance
        self._sharp = mesh.edges[(mesh.is_crease | (mesh.edge_counts != 2)) & edges_first]
        seam = Seams.of(mesh)
        self._seam_faces = seam.faces[: len(seam.faces) if edges_first else 0]
        self._lines = np.concatenate([mesh.vertices[self._sharp], seam.points[seam.steps[: len(self._seam_faces)]]])
        self._edges = index_of(self._lines.min(1), self._lines.max(1), tolerance)
        low, high, self._triangle = slices(mesh.vertices[mesh.faces])
        self._faces = index_of(low, high, tolerance)

    @staticmethod
    def of(mesh: TriangleMesh, tolerance: float) -> "Nearest":
        """A search of which a mesh keeps one: all views ask it."""
        kept = mesh.__dict__.get("_nearest")
        if kept is None or kept.tolerance != tolerance:
            kept = mesh.__dict__["_nearest"] = Nearest(mesh, tolerance)
        return cast(Nearest, kept)

    def places(self, points: Float[Array, "Q 3"]) -> tuple[Float[Array, "Q 3"], Int[Index, "Q 3"]]:
        """The points moved onto the mesh, and the vertices of what they lie on (see `MeshView.in_front`).

        Points that are farther away than the tolerance stay where they are, with -1.
        """
        moved, own = points.copy(), np.full((len(points), 3), -1, np.int64)
        kernel = getattr(kernels(), "boxes_nearest", None)
        if kernel:
            line, shares, _ = kernel(*self._edges.tables, *self._line_tables, self.tolerance, *for_kernels(points))
            # Of C's long long, which numpy tells from its own integers.
            line = line.view(np.int64)
            near = line >= 0
            share = shares[near, 1:].sum(1)
            start, stop = self._lines[line[near]].transpose(1, 0, 2)
            moved[near], own[near] = start + share[:, None] * (stop - start), self._of_line(line[near], share)
            rest = np.flatnonzero(~near)
            face, shares, found = kernel(*self._faces.tables, *self._tables, self.tolerance, *for_kernels(points[rest]))
            near = face >= 0
            moved[rest[near]] = found[near]
            own[rest[near]] = _of_triangle(self.mesh.faces[face[near]], shares[near])
            return moved, own
        for query, line in self._edges.batches(points):
            found, share = on_segments(points[query], self._lines[line])
            self._take(points, query, found, self._of_line(line, share), moved, own)
        rest = np.flatnonzero(own[:, 0] < 0)
        for row, box in self._faces.batches(points[rest]):
            query, face = rest[row], self._triangle[box]
            corners = self.mesh.vertices.take(self.mesh.faces.take(face, 0), 0)
            found, shares = closest_on_triangles(points.take(query, 0), corners)
            self._take(points, query, found, _of_triangle(self.mesh.faces[face], shares), moved, own)
        return moved, own

    @cached_property
    def _line_tables(self) -> tuple[Tensor, ...]:
        """As `_tables`, of lines: triangles whose last two corners are one."""
        return tuple(for_kernels(np.arange(len(self._lines)), self._lines[:, [0, 1, 1]]))

    @cached_property
    def _tables(self) -> tuple[Tensor, ...]:
        """The triangle of each box, and their corners, for the compiled kernel."""
        return tuple(for_kernels(self._triangle, self.mesh.vertices[self.mesh.faces]))

    def _of_line(self, line: Int[Index, " P"], share: Float[Array, " P"]) -> Int[Index, "P 3"]:
        """The vertices of edges, or of one of the two faces of seams: the other face is as near to the camera there."""
        is_edge = line < len(self._sharp)
        own = np.empty((len(line), 3), np.int64)
        own[is_edge] = _of_segment(self._sharp[line[is_edge]], share[is_edge])
        own[~is_edge] = self.mesh.faces[self._seam_faces[line[~is_edge] - len(self._sharp)]]
        return own

    def _take(
        self,
        points: Float[Array, "Q 3"],
        query: Int[Index, " P"],
        found: Float[Array, "P 3"],
        vertices: Int[Index, "P 3"],
        moved: Float[Array, "Q 3"],
        own: Int[Index, "Q 3"],
    ) -> None:
        """The nearest of the candidates of each point, if it is near enough."""
        distance = np.linalg.norm(points[query] - found, axis=1)
        near = np.flatnonzero(distance <= self.tolerance)
        # The nearest comes last, and stays.
        near = near[np.argsort(-distance[near], kind="stable")]
        moved[query[near]] = found[near]
        own[query[near]] = vertices[near]


def places_anywhere(mesh: TriangleMesh, points: Float[Array, "Q 3"]) -> tuple[Float[Array, "Q 3"], Int[Index, "Q 3"]]:
    """The points moved onto the mesh, however far away they are; as `Nearest.places`."""
    moved, own = Nearest.of(mesh, mesh.near).places(points)
    tolerance = mesh.near
    while len(rest := np.flatnonzero(own[:, 0] < 0)):
        tolerance *= WIDER
        moved[rest], own[rest] = Nearest(mesh, tolerance, edges_first=False).places(points[rest])
    return moved, own


def faces_at(mesh: TriangleMesh, own: Int[Index, "Q 3"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
    """Pairs of a place, by the vertices of what it lies on (see `Nearest.places`), and a face that holds it."""
    flat = mesh.faces.ravel()
    order = np.argsort(flat, kind="stable")
    start = np.searchsorted(flat[order], np.arange(len(mesh.vertices) + 1))
    counts = (start[1:] - start[:-1])[own[:, 0]]
    query = np.repeat(np.arange(len(own)), counts)
    before = np.repeat(np.cumsum(counts) - counts, counts)
    face = order[start[own[query, 0]] + np.arange(len(query)) - before] // 3
    held = (own[query][:, :, None] == mesh.faces[face][:, None]).any(2).all(1)
    return query[held], face[held]


def _of_segment(edge: Int[Index, "P 2"], share: Float[Array, " P"]) -> Int[Index, "P 3"]:
    """The edge, or its vertex."""
    first = np.where(share >= 1 - ON_EDGE, edge[:, 1], edge[:, 0])
    last = np.where(share <= ON_EDGE, edge[:, 0], edge[:, 1])
    return np.stack([first, last, last], 1)


def closest_on_triangles(
    points: Float[Array, "P 3"], corners: Float[Array, "P 3 3"]
) -> tuple[Float[Array, "P 3"], Float[Array, "P 3"]]:
    """The closest points of triangles, and their barycentric coordinates."""
    a, b, c = corners.transpose(1, 0, 2)
    u, v, w = b - a, c - a, points - a
    uu, uv, vv = (np.einsum("pi,pi->p", x, y) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("pi,pi->p", w, u), np.einsum("pi,pi->p", w, v)
    det = uu * vv - uv * uv
    safe = np.where(det > 0, det, 1.0)
    s, t = (vv * wu - uv * wv) / safe, (uu * wv - uv * wu) / safe
    shares = np.stack([1 - s - t, s, t], 1)
    outside = np.flatnonzero(~all_of(shares >= 0) | (det <= 0))
    if len(outside):
        best = np.full(len(outside), np.inf)
        around, beside = corners.take(outside, 0), points.take(outside, 0)
        for k in range(3):
            found, share = on_segments(beside, around[:, [k, (k + 1) % 3]])
            distance = np.linalg.norm(beside - found, axis=1)
            nearer = distance < best
            best[nearer] = distance[nearer]
            row = np.zeros((int(nearer.sum()), 3))
            row[:, k], row[:, (k + 1) % 3] = 1 - share[nearer], share[nearer]
            shares[outside[nearer]] = row
    return np.einsum("pk,pki->pi", shares, corners), shares


def _of_triangle(face: Int[Index, "P 3"], shares: Float[Array, "P 3"]) -> Int[Index, "P 3"]:
    """The vertices that a point of a face lies between: those without a share are replaced by that of the largest."""
    largest = np.take_along_axis(face, shares.argmax(1)[:, None], 1)
    return np.where(shares > ON_EDGE, face, largest)
