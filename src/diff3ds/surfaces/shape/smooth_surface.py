"""A finer mesh of the smooth surface that a coarse one stands for, so that its outlines are round.

Outlines of a mesh go from edge to edge, and where edges are several pixels long one sees them turn. Its normals say
how the surface was meant to bend. Here edges are halved, and their middles moved to where an arc between the tangents
at both ends has its own: on spheres and circles exactly. It is done again until no middle moves by more than a
tolerance, and what is flat stays as it is.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.directions import has_corner
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Edges are halved so often at most: a middle moves by a quarter of the time before.
ROUNDS = 4
# An edge whose tangent at an end turns away by more than this stays straight: no smooth surface does. Cosine of 45
# degrees; between faces of one smooth surface there are 38 at most.
STEEP = 0.7
# So many faces at most: of a mesh that has more, edges are short in any picture. Empirical.
MOST_FACES = 200_000
# So many pixels faces may be from the arcs in pictures. Empirical: more shows, less takes more faces.
IN_PICTURES = 0.2


@dataclass(frozen=True, eq=False, init=False)
class SmoothMesh(TriangleMesh):
    """A mesh that stands for the smooth surface of a coarse one: each face of that has become a patch.

    Attributes:
        coarse: the mesh that it was made of.
        patch: the coarse face that each face is a part of.
    """

    coarse: TriangleMesh
    patch: Int[Index, " F"]

    def __init__(
        self, vertices: Float[Array, "V 3"], faces: Int[Index, "F 3"], coarse: TriangleMesh, patch: Int[Index, " F"]
    ) -> None:
        super().__init__(vertices, faces, coarse.part[patch], coarse.crease, coarse.polygon[patch])
        object.__setattr__(self, "coarse", coarse)
        object.__setattr__(self, "patch", patch[self.source])

    @cached_property
    def patch_at(self) -> Int[Index, " V"]:
        """A coarse face that each vertex is on."""
        found = np.zeros(len(self.vertices), np.int64)
        found[self.faces] = self.patch[:, None]
        return found

    @cached_property
    def finer(self) -> int:
        """How many edges a coarse one has become, in the mean."""
        return max(1, round((len(self) / len(self.coarse)) ** 0.5))


def smooth_surface(mesh: TriangleMesh, tolerance: float) -> TriangleMesh:
    """The mesh with finer faces where it is round; creases and borders stay, and become round where they are smooth.

    Vertices stay where they are. New ones lie on arcs between the tangents of each edge's ends: at right angles to the
    normals there, or along the crease or border, straight up to its corners.

    Args:
        mesh: what a smooth surface was made into; no gradients flow to its vertices from what is returned.
        tolerance: how far the faces may be from the arcs in the middle of their edges, world units. A fifth of what a
            pixel shows is enough for a picture.

    Returns:
        The finer mesh, of no more than `MOST_FACES`, or the mesh itself where nothing is round.

    Raises:
        TypeError, ValueError: no mesh, or a tolerance that is not positive.
    """
    if not isinstance(mesh, TriangleMesh):
        raise TypeError(f"mesh must be a TriangleMesh, got {type(mesh).__name__}")
    if isinstance(tolerance, bool) or not (isinstance(tolerance, int | float) and 0 < tolerance < float("inf")):
        raise ValueError(f"tolerance must be a positive length, got {tolerance!r}")
    fine, patch = mesh, np.arange(len(mesh))
    for _ in range(ROUNDS):
        moved = _sagittas(fine)
        halved = np.linalg.norm(moved, axis=1) > tolerance
        # Each halved edge of a face makes one more of it.
        if not halved.any() or len(fine) + halved[fine.face_edges].sum() > MOST_FACES:
            break
        points, faces, source = _halved(fine, moved, halved)
        fine = SmoothMesh(points, faces, mesh, patch[source])
        patch = fine.patch
    return fine


def smooth_for_pictures(mesh: TriangleMesh, size: int) -> TriangleMesh:
    """As `smooth_surface`, for pictures of so many pixels that show the whole mesh."""
    return smooth_surface(mesh, IN_PICTURES * mesh.size / size)


def finer(mesh: TriangleMesh, longest: float) -> tuple[TriangleMesh, Int[Index, " F"]]:
    """The mesh with its longer edges halved until none is longer, and the face of it that each face is a part of.

    Args:
        mesh: any; its surface stays the same.
        longest: world units.
    """
    fine, source = mesh, np.arange(len(mesh))
    while len(fine) < MOST_FACES:
        ends = fine.vertices[fine.edges]
        halved = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > longest
        if not halved.any():
            break
        points, faces, part = _halved(fine, np.zeros((len(fine.edges), 3)), halved)
        source = source[part]
        made = TriangleMesh(points, faces, mesh.part[source], mesh.crease, mesh.polygon[source])
        fine, source = made, source[made.source]
    return fine, source


def _sagittas(mesh: TriangleMesh) -> Float[Array, "E 3"]:
    """How far the middle of each edge moves."""
    ends = mesh.vertices[mesh.edges]
    way = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(way, axis=1)
    sharp = mesh.is_crease | (mesh.edge_counts != 2)
    tangents = _along_surface(mesh, way)
    tangents[sharp] = _along_lines(mesh, sharp)
    cosine = np.einsum("eki,ei->ek", tangents, way) / length[:, None]
    # An arc that leaves its chord at an angle rises by a half of the tangent of half the angle of the chord's length.
    rise = tangents * (length[:, None] / (1 + np.maximum(cosine, 0)))[..., None]
    return np.where((cosine > STEEP).all(1)[:, None], (rise[:, 0] - rise[:, 1]) / 4, 0.0)


def _along_surface(mesh: TriangleMesh, way: Float[Array, "E 3"]) -> Float[Array, "E 2 3"]:
    """Unit tangents of the surface at both ends of each edge, in its direction, as its first face has them."""
    face = mesh.edge_faces[:, 0]
    corner = (mesh.faces[face][:, None, :] == mesh.edges[:, :, None]).argmax(2)
    normal = _normals(mesh)[face[:, None], corner]
    tangent = way[:, None] - np.einsum("eki,ei->ek", normal, way)[..., None] * normal
    return tangent / np.linalg.norm(tangent, axis=2, keepdims=True).clip(1e-300)


def _normals(mesh: TriangleMesh) -> Float[Array, "F 3 3"]:
    """Unit normals at the corners of faces, weighted by their areas.

    Not by their angles, as those of contours: a large flat face beside the small ones of a round stays flat.
    """
    fan, fans = mesh.fans
    product = np.repeat(mesh.face_normals * mesh.face_areas[:, None], 3, axis=0)
    total = np.stack([np.bincount(fan, product[:, k], fans) for k in range(3)], 1)[fan]
    return (total / np.linalg.norm(total, axis=1, keepdims=True).clip(1e-300)).reshape(-1, 3, 3)


def _along_lines(mesh: TriangleMesh, sharp: Bool[Mask, " E"]) -> Float[Array, "S 2 3"]:
    """Unit tangents of creases and borders at both ends of each of their edges, in its direction.

    Where a line goes on, the tangent of the circle through a vertex and its neighbours; at corners, ends and branches
    the edge's own direction.
    """
    edges = mesh.edges[sharp]
    way = mesh.vertices[edges[:, 1]] - mesh.vertices[edges[:, 0]]
    tangents = np.repeat(way[:, None], 2, axis=1)
    # The ends of edges by their vertex: two of one vertex are neighbours if there is no third.
    vertex = edges.T.ravel()
    order = np.argsort(vertex, kind="stable")
    _, first, count = np.unique(vertex[order], return_index=True, return_counts=True)
    one, other = order[first[count == 2]], order[first[count == 2] + 1]
    edge, end = (np.stack([one, other]) % len(edges), np.stack([one, other]) // len(edges))
    # Into the vertex along the first edge, out of it along the second.
    into = way[edge[0]] * np.where(end[0] == 1, 1.0, -1.0)[:, None]
    out = way[edge[1]] * np.where(end[1] == 0, 1.0, -1.0)[:, None]
    smooth = ~has_corner(into, out)
    into, out, edge, end = into[smooth], out[smooth], edge[:, smooth], end[:, smooth]
    along = into / (into**2).sum(1)[:, None] + out / (out**2).sum(1)[:, None]
    tangents[edge[0], end[0]] = along * np.where(end[0] == 1, 1.0, -1.0)[:, None]
    tangents[edge[1], end[1]] = along * np.where(end[1] == 0, 1.0, -1.0)[:, None]
    return tangents / np.linalg.norm(tangents, axis=2, keepdims=True).clip(1e-300)


def _halved(
    mesh: TriangleMesh, moved: Float[Array, "E 3"], halved: Bool[Mask, " E"]
) -> tuple[Float[Array, "V 3"], Int[Index, "N 3"], Int[Index, " N"]]:
    """Vertices and faces of the mesh with some of its edges halved, their middles moved; the face that each is of."""
    middle = np.full(len(mesh.edges), -1)
    middle[halved] = len(mesh.vertices) + np.arange(halved.sum())
    points = np.concatenate([mesh.vertices, mesh.vertices[mesh.edges[halved]].mean(1) + moved[halved]])
    return points, *_divided(points, mesh.faces, middle[mesh.face_edges])


def _divided(
    points: Float[Array, "V 3"], faces: Int[Index, "F 3"], middle: Int[Index, "F 3"]
) -> tuple[Int[Index, "N 3"], Int[Index, " N"]]:
    """Faces divided at the middles of their edges (-1 where there is none), and the face that each is of."""
    count = (middle >= 0).sum(1)
    made, source = [faces[count == 0]], [np.flatnonzero(count == 0)]
    # Turned so that with one middle it is on the first edge, and with two there is none on the first.
    turn = np.where(count == 2, (middle < 0).argmax(1), (middle >= 0).argmax(1))
    rows = (turn[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, rows, 1).T
    ab, bc, ca = np.take_along_axis(middle, rows, 1).T
    # A quadrangle a, b, bc, ca is parted by its shorter diagonal.
    near = np.linalg.norm(points[a] - points[bc], axis=1) <= np.linalg.norm(points[b] - points[ca], axis=1)
    for chosen, triangles in (
        (count == 1, ((a, ab, c), (ab, b, c))),
        (count == 2, ((bc, c, ca), (a, b, np.where(near, bc, ca)), (ca, np.where(near, a, b), bc))),
        (count == 3, ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))),
    ):
        for triangle in triangles:
            made.append(np.stack(triangle, 1)[chosen])
            source.append(np.flatnonzero(chosen))
    return np.concatenate(made), np.concatenate(source)
