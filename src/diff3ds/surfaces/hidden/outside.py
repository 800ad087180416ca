"""What of a mesh can be seen from anywhere outside: not the inner sides of double walls, nor what they hold."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.directions import all_around
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Views from all around, and pixels along the longest side of what they show. Empirical.
VIEWS, PIXELS = 32, 110
# Points of a face a pixel, so that no pixel that it covers is without one; and so far behind the nearest one, in
# pixels, points are seen too.
DENSE, BEHIND = 2.0, 1.5
# Of a piece so large a share of the points is seen, or it lies inside of others: of those in generated meshes none is
# seen, and of all others more than a third. Empirical.
SEEN = 0.02


@dataclass(frozen=True, eq=False)
class Outside:
    """Points of a mesh, and whether anybody outside sees them.

    Attributes:
        points: of its faces, no farther apart than a pixel.
        face: that each of these is on.
        seen: which of them some view shows, from the outer side of their face.
    """

    points: Float[Array, "P 3"]
    face: Int[Index, " P"]
    seen: Bool[Mask, " P"]

    @cached_property
    def _tree(self) -> "cKDTree":
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    @classmethod
    def of(cls, mesh: TriangleMesh) -> "Outside":
        """The points of a mesh, as many views from all around see them."""
        pixel = mesh.size / PIXELS
        points, face = _spread(mesh, pixel)
        points_from_middle = points - mesh.bounds.mean(0)
        seen = np.zeros(len(points), bool)
        for view in all_around(VIEWS):
            right = np.array([-view[1], view[0], 0.0]) / np.hypot(*view[:2])
            x, y, near = (points_from_middle @ np.stack([right, np.cross(view, right), view], 1)).T
            side = PIXELS * 2
            cell = (
                (np.floor(x / pixel).astype(np.int64) + PIXELS) * side + np.floor(y / pixel).astype(np.int64) + PIXELS
            )
            front = np.full(side * side, -np.inf)
            np.maximum.at(front, cell, near)
            front = _closed(front.reshape(side, side)).ravel()
            towards = (mesh.face_normals @ view > 0)[face]
            seen |= towards & (near > front[cell] - BEHIND * pixel)
        return cls(points, face, seen)

    def sees(self, places: Float[Array, "Q 3"]) -> Bool[Mask, " Q"]:
        """Whether the nearest point of the mesh to each place is seen."""
        return np.asarray(self.seen[self._tree.query(places, workers=-1)[1]])


def outer_faces(mesh: TriangleMesh) -> Bool[Mask, " F"]:
    """Which faces are of pieces that one of many views from outside shows: not the inner walls of a closed shell."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(mesh.vertices)
    graph = coo_matrix((np.ones(len(mesh.edges), bool), tuple(mesh.edges.T)), shape=(count, count))
    pieces, piece = connected_components(graph, directed=False)
    piece = piece[mesh.faces[:, 0]]
    if pieces == 1:
        return np.ones(len(mesh), bool)
    outside = Outside.of(mesh)
    points = np.bincount(piece[outside.face], minlength=pieces)
    seen = np.bincount(piece[outside.face], outside.seen, pieces) > SEEN * points
    return np.asarray(seen[piece])


def _closed(front: Float[Array, "R C"]) -> Float[Array, "R C"]:
    """How near what is seen in each pixel is, no farther than in both pixels beside it: some have none by chance."""
    out = front.copy()
    out[1:-1] = np.maximum(out[1:-1], np.minimum(front[:-2], front[2:]))
    out[:, 1:-1] = np.maximum(out[:, 1:-1], np.minimum(front[:, :-2], front[:, 2:]))
    return out


def _spread(mesh: TriangleMesh, pixel: float) -> tuple[Float[Array, "P 3"], Int[Index, " P"]]:
    """Points of all faces, `DENSE` on each square of a pixel, the same places of each; and whose they are."""
    count = np.maximum(np.ceil(DENSE * mesh.face_areas / pixel**2), 1).astype(np.int64)
    face = np.repeat(np.arange(len(mesh)), count)
    number = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    # A sequence that is even however many of its places are taken (Roberts 2018), folded into a triangle.
    u, v = np.modf((number[:, None] + 0.5) * [0.7548776662466927, 0.5698402909980532])[0].T
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces[face]], 1, 0)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), face
