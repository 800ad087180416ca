"""Triangle meshes as surfaces: which faces meet at which edges, creases and borders, normals."""

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask, Tensor
from diff3ds.page.boxes import in_order
from diff3ds.surfaces.shape.clean import welded, wound_alike

# Faces that meet at more than this make a crease: rounds of ten sides and more are smooth. Degrees.
CREASE = 38.0
# Strokes that are nearer to a mesh lie on it, as a share of its size: curves fitted to its edges keep nearer.
# Empirical.
ON_SURFACE = 1 / 256
# What is nearer to a point than this, as a share of the mesh's size, does not lie in front of it: rounding.
TOUCHING = 1e-7
# Faces of one smooth surface around a vertex turn by no more than this, and those of one plane by less than this,
# degrees; beside a face one so many times smaller says nothing of where it bends. Empirical.
STEEP, LEVEL, SMALL = 45.0, 0.1, 50.0
Mesh = TypeVar("Mesh", bound="TriangleMesh")


@dataclass(frozen=True, eq=False, init=False)
class TriangleMesh:
    """A mesh of triangles in world units: closed or open, in one piece or many, with any number of faces at an edge.

    Vertices in one place are made one (`clean.SAME`), faces that have two equal corners or were there before are
    dropped, edges are split where corners of other faces lie on them, needles without a height left out, and neighbours
    wound alike, outwards where the mesh is closed.

    Vertices may be given as a tensor that requires gradients: those of pictures and of contours flow to it, of vertices
    in one place to the first (`points`).

    Attributes:
        vertices: those that faces use.
        faces: vertices of each triangle, counter-clockwise seen from outside.
        source: which of the given faces each one is, or is a part of.
        part: which object of the file each face belongs to; 0 where there is one.
        crease: faces that meet at more than this make a crease, over which normals are not smoothed; degrees.
        polygon: which face of the file each one was cut from: faces of one polygon make no crease.

    Raises:
        TypeError, ValueError: other shapes, faces between vertices that there are not, values that are not finite, no
            face with an area.
    """

    vertices: Float[Array, "V 3"]
    faces: Int[Index, "F 3"]
    source: Int[Index, " F"]
    part: Int[Index, " F"]
    crease: float
    polygon: Int[Index, " F"]
    _given: tuple[Tensor | None, Index] = field(repr=False)
    _edges: tuple[Index, Index, Index] = field(repr=False)

    def __init__(
        self,
        vertices: ArrayLike | Tensor,
        faces: ArrayLike,
        part: ArrayLike | None = None,
        crease: float = CREASE,
        polygon: ArrayLike | None = None,
    ) -> None:
        given_points = vertices.cpu().double() if isinstance(vertices, Tensor) else None
        points, corners = _checked(vertices if given_points is None else given_points.detach().numpy(), faces)
        angle = _angle(crease)
        given = _of_faces("part", part, np.zeros(len(corners), np.int64))
        polygons = _of_faces("polygon", polygon, np.arange(len(corners)))
        rows, corners, source = welded(points, corners)
        points = points[rows]
        if not len(corners):
            raise ValueError(f"a mesh needs a face with an area: {len(given)} faces have none")
        edges, of_faces = _edges_of(corners)
        beside = _beside(of_faces, len(edges))
        two = (beside[:, 1] >= 0) & (np.bincount(of_faces.ravel(), minlength=len(edges)) == 2)
        pairs = beside[two]
        wound = wound_alike(points, corners, pairs, _run_alike(corners, edges[two], pairs))
        # Faces that are turned round have their edges in another order.
        turned = (wound != corners).any(1)
        of_faces[turned] = of_faces[turned][:, [1, 0, 2]]
        for name, value in (
            ("vertices", points),
            ("faces", wound),
            ("source", source),
            ("part", given[source]),
            ("crease", angle),
            ("polygon", polygons[source]),
            ("_given", (given_points, rows)),
            ("_edges", (edges, of_faces, beside)),
        ):
            object.__setattr__(self, name, value)
        if not (self.face_areas > 0).any():
            raise ValueError(f"a mesh needs a face with an area: {len(corners)} faces have none")

    @classmethod
    def of_triangles(cls, corners: ArrayLike, crease: float = CREASE) -> "TriangleMesh":
        """The mesh of triangles that are given by their corners, shape (F, 3, 3).

        Raises:
            TypeError, ValueError: as the constructor.
        """
        points = np.asarray(corners, np.float64)
        if points.ndim != 3 or points.shape[1:] != (3, 3):
            raise ValueError(f"corners must have shape (F, 3, 3), got {points.shape}")
        return cls(points.reshape(-1, 3), np.arange(3 * len(points)).reshape(-1, 3), crease=crease)

    def with_crease(self, crease: float) -> "TriangleMesh":
        """The same mesh with another angle that makes a crease, degrees.

        Raises:
            ValueError: not an angle.
        """
        return self.changed(TriangleMesh, crease=_angle(crease))

    def with_vertices(self: Mesh, vertices: Float[Array, "V 3"]) -> Mesh:
        """The same faces with their vertices elsewhere, of which no gradients flow to those that were given."""
        return self.changed(type(self), vertices=vertices, _given=(None, self._given[1]))

    def changed(self, kind: type[Mesh], **changed: object) -> Mesh:
        """A mesh of some kind with some other attributes, those of this one, and nothing that was made of them."""
        other = object.__new__(kind)
        for name in (f.name for f in fields(kind)):
            object.__setattr__(other, name, changed[name] if name in changed else getattr(self, name))
        return other

    def __len__(self) -> int:
        return len(self.faces)

    @property
    def points(self) -> Float[Tensor, "V 3"]:
        """The vertices as a float64 tensor on the processor, with the history that they were given with."""
        given, rows = self._given
        return torch.from_numpy(self.vertices) if given is None else given[torch.from_numpy(rows)]

    @property
    def edges(self) -> Int[Index, "E 2"]:
        """The two vertices of each edge, the smaller one first."""
        return self._edges[0]

    @cached_property
    def edge_keys(self) -> Int[Index, " E"]:
        """A number for each edge, the first of its vertices times their count plus the second; rising."""
        return self.edges[:, 0] * len(self.vertices) + self.edges[:, 1]

    @property
    def face_edges(self) -> Int[Index, "F 3"]:
        """The edges of each face: between its corners 0 and 1, 1 and 2, 2 and 0."""
        return self._edges[1]

    @property
    def edge_faces(self) -> Int[Index, "E 2"]:
        """The two faces at each edge; -1 for the second at a border, the first two where there are more."""
        return self._edges[2]

    @cached_property
    def edge_counts(self) -> Int[Index, " E"]:
        """How many faces meet at each edge: 1 at a border, 2 within the surface, more where it is not a manifold."""
        return np.bincount(self.face_edges.ravel(), minlength=len(self.edges))

    @cached_property
    def is_closed(self) -> bool:
        """Whether every edge has two faces, so that there is an inside."""
        return bool((self.edge_counts == 2).all())

    @cached_property
    def bounds(self) -> Float[Array, "2 3"]:
        """The least and the largest coordinates."""
        return np.stack([self.vertices.min(0), self.vertices.max(0)])

    @property
    def size(self) -> float:
        """The longest side of the bounding box, world units."""
        return float((self.bounds[1] - self.bounds[0]).max())

    @property
    def near(self) -> float:
        """What is nearer to the mesh than this lies on it, world units."""
        return ON_SURFACE * self.size

    @property
    def touching(self) -> float:
        """What of the mesh is nearer to a point than this does not hide it, world units."""
        return TOUCHING * self.size

    @property
    def beside(self) -> float:
        """Contours that run along strokes are those strokes' where they are nearer than this, world units."""
        return 0.0

    @property
    def specks(self) -> float:
        """Contours that are shorter than this are no more than what the triangles happen to be, world units."""
        return 0.0

    @property
    def surfaces(self) -> tuple[Int[Index, " F"], Int[Index, " F"]] | None:
        """Of solids the surface that each face is on, and the smooth whole of such that go on in each other."""
        return None

    @cached_property
    def _products(self) -> Float[Array, "F 3"]:
        """Normals twice as long as the faces are large."""
        a, b, c = self.vertices[self.faces].transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    @cached_property
    def face_areas(self) -> Float[Array, " F"]:
        """Areas, world units squared."""
        return np.linalg.norm(self._products, axis=1) / 2

    @cached_property
    def face_normals(self) -> Float[Array, "F 3"]:
        """Unit normals, outwards; zero for faces without an area."""
        length = 2 * self.face_areas
        return np.where(length[:, None] > 0, self._products / np.where(length > 0, length, 1.0)[:, None], 0.0)

    @cached_property
    def turns(self) -> Float[Array, " E"]:
        """By how much the surface turns at each edge, degrees: positive where it is convex, negative where concave.

        NaN where there are not two faces, or one has no area.
        """
        one, other = self.edge_faces.T
        a, b = self.face_normals[one], self.face_normals[other]
        cosine = np.einsum("ei,ei->e", a, b)
        sine = np.linalg.norm(np.cross(a, b), axis=1)
        turn = np.degrees(np.arctan2(sine, cosine))
        # Convex: the other face lies below the plane of the first.
        below = np.einsum("ei,ei->e", a, self.vertices[self.faces[other]].mean(1) - self.vertices[self.edges[:, 0]]) < 0
        known = (self.edge_counts == 2) & (self.face_areas[one] > 0) & (self.face_areas[other] > 0)
        return np.where(known, np.where(below, turn, -turn), np.nan)

    @cached_property
    def is_border(self) -> Bool[Mask, " E"]:
        """Edges of one face."""
        return self.edge_counts == 1

    @cached_property
    def is_branch(self) -> Bool[Mask, " E"]:
        """Edges at which three and more faces meet."""
        return self.edge_counts > 2

    @cached_property
    def is_crease(self) -> Bool[Mask, " E"]:
        """Edges of two faces, of two polygons, that meet at more than `crease`."""
        one, other = self.polygon[self.edge_faces].T
        return (np.nan_to_num(np.abs(self.turns)) > self.crease) & (one != other)

    @cached_property
    def corner_normals(self) -> Float[Array, "F 3 3"]:
        """Unit normals at the corners of each face, smooth over all edges but creases and borders.

        The mean normal of the faces around a vertex, weighted by their angles there (Thürmer and Wüthrich 1998), for
        each fan of them between two creases.
        """
        fan, fans = self.fans
        weighted = self.corner_angles[..., None] * self.face_normals[:, None]
        flat = weighted.reshape(-1, 3)
        total = np.stack([np.bincount(fan, flat[:, k], fans) for k in range(3)], 1)[fan]
        length = np.linalg.norm(total, axis=1, keepdims=True)
        own = np.repeat(self.face_normals, 3, axis=0)
        return np.where(length > 1e-12, total / np.maximum(length, 1e-300), own).reshape(-1, 3, 3)

    @cached_property
    def corner_angles(self) -> Float[Array, "F 3"]:
        """Angles of the faces at their corners, radians."""
        points = self.vertices[self.faces]
        onwards, back = np.roll(points, -1, 1) - points, np.roll(points, 1, 1) - points
        sine = np.linalg.norm(np.cross(onwards, back), axis=2)
        return np.arctan2(sine, np.einsum("fki,fki->fk", onwards, back))

    @property
    def fans(self) -> tuple[Int[Index, " C"], int]:
        """Which corners of faces, 3 a face, share a normal: those around a vertex that no crease or border parts.

        Large faces that turn away from each other by more than a smooth surface does share none, though small ones
        lead from one to the other, as that of a bevelled corner does: there only what is flat is together.
        """
        smooth = (self.edge_counts == 2) & ~self.is_crease
        one, other = self._corners_at(smooth)
        fan = self._together(one, other)
        area, normal = np.repeat(self.face_areas, 3), np.repeat(self.face_normals, 3, axis=0)
        order = np.lexsort((area, fan))
        largest = order[np.append(np.flatnonzero(np.diff(fan[order])), len(fan) - 1)][fan]
        large = area * SMALL > area[largest]
        both = large[one] & large[other]
        among = self._together(one[both], other[both])
        steep = np.einsum("ci,ci->c", normal, normal[largest]) < np.cos(np.radians(STEEP))
        led_round = np.unique(fan[large & steep & (among != among[largest])])
        if len(led_round):
            kept = ~np.isin(fan[one], led_round) | (np.repeat(np.abs(self.turns[smooth]), 2) < LEVEL)
            fan = self._together(one[kept], other[kept])
        return fan, int(fan.max(initial=-1)) + 1

    def _corners_at(self, edges: Bool[Mask, " E"]) -> tuple[Int[Index, " N"], Int[Index, " N"]]:
        """The corners, 3 a face, of both faces at the ends of some edges, each next to that of the other."""
        one, other = (
            3 * face[:, None] + (self.faces[face][:, None, :] == self.edges[edges][:, :, None]).argmax(2)
            for face in self.edge_faces[edges].T
        )
        return one.ravel(), other.ravel()

    def _together(self, one: Int[Index, " N"], other: Int[Index, " N"]) -> Int[Index, " C"]:
        """Numbers of the corners, the same of those that pairs of them lead from one to the other."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        count = 3 * len(self.faces)
        graph = coo_matrix((np.ones(len(one), bool), (one, other)), shape=(count, count))
        return connected_components(graph, directed=False)[1].astype(np.int64)


def _angle(crease: float) -> float:
    if not (isinstance(crease, int | float) and 0 <= crease <= 180):
        raise ValueError(f"crease must be an angle from 0 to 180 degrees, got {crease!r}")
    return float(crease)


def _checked(vertices: ArrayLike, faces: ArrayLike) -> tuple[Float[Array, "V 3"], Int[Index, "F 3"]]:
    points = np.array(vertices, np.float64)
    corners = np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"vertices must have shape (V, 3), got {points.shape}")
    if not np.issubdtype(corners.dtype, np.integer):
        raise TypeError(f"faces must be whole numbers, got {corners.dtype}")
    if corners.ndim != 2 or corners.shape[1] != 3 or not len(corners):
        raise ValueError(f"faces must have shape (F, 3), of at least one face, got {corners.shape}")
    if corners.min() < 0 or corners.max() >= len(points):
        raise ValueError(f"faces must be of vertices 0 to {len(points) - 1}, got {corners.min()} to {corners.max()}")
    corners = corners.astype(np.int64)
    broken = np.flatnonzero(~np.isfinite(points[corners]).all((1, 2)))
    if len(broken):
        raise ValueError(f"vertices must be finite: those of face {broken[0]} are not")
    return points, corners


def _of_faces(name: str, given: ArrayLike | None, default: Int[Index, " F"]) -> Int[Index, " F"]:
    """Numbers of faces, or the default."""
    found = default if given is None else np.asarray(given, np.int64)
    if found.shape != default.shape:
        raise ValueError(f"{name} must be one number a face, {len(default)}, got shape {found.shape}")
    return found


def _edges_of(faces: Int[Index, "F 3"]) -> tuple[Int[Index, "E 2"], Int[Index, "F 3"]]:
    """All edges, and those of each face."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, 1)], 2), axis=2)
    base = int(faces.max()) + 1
    keys, edge = np.unique(sides[..., 0] * base + sides[..., 1], return_inverse=True)
    return np.stack([keys // base, keys % base], 1), edge.reshape(-1, 3)


def _beside(face_edges: Int[Index, "F 3"], count: int) -> Int[Index, "E 2"]:
    """The first two faces at each edge, -1 where there is no second."""
    flat = face_edges.ravel()
    order = in_order(flat)
    start = np.searchsorted(flat[order], np.arange(count + 1))
    beside = np.full((count, 2), -1, np.int64)
    beside[:, 0] = order[start[:-1]] // 3
    more = start[1:] - start[:-1] > 1
    beside[more, 1] = order[start[:-1][more] + 1] // 3
    return beside


def _run_alike(faces: Int[Index, "F 3"], edges: Int[Index, "P 2"], pairs: Int[Index, "P 2"]) -> Bool[Mask, " P"]:
    """Whether both faces at an edge go along it in the same direction."""
    rising = [
        np.take_along_axis(corners, (place + 1) % 3, 1)[:, 0] == edges[:, 1]
        for corners in (faces[pairs[:, 0]], faces[pairs[:, 1]])
        for place in ((corners == edges[:, :1]).argmax(1)[:, None],)
    ]
    return rising[0] == rising[1]
