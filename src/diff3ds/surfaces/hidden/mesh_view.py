"""A triangle mesh as one camera sees it: where its triangles lie in the picture, and what lies in front of points."""

from collections.abc import Callable

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask, Tensor
from diff3ds.page.boxes import BoxIndex, all_of, largest, slices
from diff3ds.page.picture import Picture
from diff3ds.render.backends import for_kernels, kernels
from diff3ds.surfaces.shape.smooth_surface import SmoothMesh
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# So far outside of a triangle in the picture, in barycentric coordinates, a point counts as inside: no ray passes
# between two triangles that share an edge.
SEAM = 1e-10
# Pixels. Triangles farther away than this from a point cannot hold it, however slender they are. Speed only.
BESIDE = 1e-3


class MeshView:
    """A mesh in a picture: triangles in front of the near plane, indexed by where they are seen."""

    def __init__(self, mesh: TriangleMesh, picture: Picture) -> None:
        self.mesh, self.picture = mesh, picture
        self.pixels, self.depths = picture.seen(mesh.vertices)
        toward = picture.towards(mesh.vertices[mesh.faces[:, 0]])
        # How far the camera is above each face's plane: positive for faces that are seen from outside.
        self.above: Float[Array, " F"] = np.einsum("fi,fi->f", mesh.face_normals, toward)
        pixels, depths, face = _clipped(mesh, self.pixels, self.depths, picture)
        self._corners, self._depths, self._face = pixels, depths, face
        low, high, self._triangle = slices(pixels)
        middle = float(np.median(largest(high - low))) if len(low) else 1.0
        self._index = BoxIndex.of(low - BESIDE, high + BESIDE, middle)
        self._kept: dict[TriangleMesh, list[Tensor]] = {}

    def in_front(
        self, points: Float[Array, "Q 3"], own: Int[Index, "Q 3"] | None = None, rings: int = 0
    ) -> Bool[Mask, " Q"]:
        """Whether something of the mesh hides points from the camera.

        Args:
            own: the vertices of the face, edge (one twice) or vertex (thrice) that each point lies on, or -1 where it
                lies on none. Faces that have all of them do not hide the point.
            rings: 0, or 1 where faces that share a vertex with them do not hide the point either, or 2 where those that
                touch such faces do not; of a `SmoothMesh`, rings of its patches around that of the point.
        """
        seen = self.picture.seen(points)
        hidden, unsure = np.zeros(len(points), bool), np.arange(len(points))
        if kernel := getattr(kernels(), "boxes_hidden", None):
            hidden = self._hidden_by(kernel, *seen, own, rings)
            if not (rings and self.mesh.surfaces):
                return hidden
            # Faces of another surface may hide a point however near they are, for which the kernel has no eye.
            unsure = np.flatnonzero(~hidden & self._hidden_by(kernel, *seen, None, 0))
        pixels, depths = (of[unsure] for of in seen)
        for pairs in self._index.batches(pixels):
            query, _, face = self._crossed(pixels, depths, *pairs)
            if own is not None and len(query):
                query = query[~self._own(own[unsure[query]], face, rings)]
            hidden[unsure[query]] = True
        return hidden

    def hides(self, points: Float[Array, "Q 3"], face: Int[Index, " Q"]) -> Bool[Mask, " Q"]:
        """Whether something of the mesh hides points of its faces from the camera."""
        return self.in_front(points, self.mesh.faces[face])

    def _hidden_by(
        self,
        kernel: Callable[..., Bool[Mask, " Q"]],
        pixels: Float[Array, "Q 2"],
        depths: Float[Array, " Q"],
        own: Int[Index, "Q 3"] | None,
        rings: int,
    ) -> Bool[Mask, " Q"]:
        """As `in_front`, by the compiled kernel, which ends with the first triangle that hides a point."""
        mesh = self.mesh
        if rings and isinstance(mesh, SmoothMesh):
            own = None if own is None else mesh.coarse.faces[mesh.patch_at[own[:, 0]]]
            mesh = mesh.coarse
        given = for_kernels(pixels, depths, *(() if own is None else (own,)))
        how = SEAM, self.mesh.touching, self.picture.orthographic, rings
        none = () if len(given) == 3 else (None,)
        return kernel(*self._index.tables, (*self._tables(mesh), len(mesh.vertices)), *how, *given, *none)

    def _tables(self, mesh: TriangleMesh) -> list[Tensor]:
        """The triangles for the compiled kernel, with the vertices of the mesh or of the coarse one that it is for."""
        if mesh not in self._kept:
            fine = self.mesh
            face = fine.patch[self._face] if isinstance(fine, SmoothMesh) and mesh is fine.coarse else self._face
            arrays = self._triangle, self._corners, self._depths, mesh.faces[face], mesh.edge_keys
            self._kept[mesh] = for_kernels(*arrays)
        return self._kept[mesh]

    def _own(self, own: Int[Index, "P 3"], face: Int[Index, " P"], rings: int) -> Bool[Mask, " P"]:
        """Whether faces are so near to points along the surface that they do not hide them."""
        mesh = self.mesh
        if rings and mesh.surfaces:
            # Large faces reach far in few rings: only those that the surface goes on in are beside the point.
            surface, whole = mesh.surfaces
            at = _faces_of(mesh, own)
            same, smooth = ((labels[at] == labels[face][:, None]).any(1) for labels in (surface, whole))
            near = _is_near(mesh, own, mesh.faces[face], rings) & same
            return near | (smooth & _is_near(mesh, own, mesh.faces[face], 1))
        if rings == 0 or not isinstance(mesh, SmoothMesh):
            return _is_near(mesh, own, mesh.faces[face], rings)
        # What facets did to each other beside a contour, patches do, however fine their faces are.
        coarse = mesh.coarse
        return _is_near(coarse, coarse.faces[mesh.patch_at[own[:, 0]]], coarse.faces[mesh.patch[face]], rings)

    def crossed(self, points: Float[Array, "Q 3"]) -> tuple[Int[Index, " P"], Float[Array, " P"], Int[Index, " P"]]:
        """All triangles between points and the camera, some twice: numbers of the points, depths and faces there."""
        pixels, depths = self.picture.seen(points)
        return self._crossed(pixels, depths, *self._index.around(pixels))

    def _crossed(
        self, pixels: Float[Array, "Q 2"], depths: Float[Array, " Q"], query: Int[Index, " C"], box: Int[Index, " C"]
    ) -> tuple[Int[Index, " P"], Float[Array, " P"], Int[Index, " P"]]:
        """As `crossed`, of these pairs of points and boxes."""
        box = self._triangle[box]
        a, b, c = self._corners.take(box, 0).transpose(1, 0, 2)
        p = pixels[query]
        shares = np.stack([_cross(b - p, c - p), _cross(c - p, a - p), _cross(a - p, b - p)], 1)
        area = shares.sum(1)
        shares /= np.where(area == 0, np.inf, area)[:, None]
        inside = all_of(shares >= -SEAM) & (area != 0)
        query, box, shares = query[inside], box[inside], shares[inside]
        corner = self._depths[box]
        # Across a triangle depth is linear without perspective, and its inverse with it.
        at = (shares * corner).sum(1) if self.picture.orthographic else 1 / (shares / corner).sum(1)
        nearer = at < depths[query] - self.mesh.touching
        return query[nearer], at[nearer], self._face[box[nearer]]


def _cross(a: Float[Array, "N 2"], b: Float[Array, "N 2"]) -> Float[Array, " N"]:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _is_near(mesh: TriangleMesh, own: Int[Index, "P 3"], corners: Int[Index, "P 3"], rings: int) -> Bool[Mask, " P"]:
    """Whether faces have all vertices that points lie on, or some, or neighbours of some."""
    same = own[:, :, None] == corners[:, None, :]
    if rings == 0:
        return same.any(2).all(1)
    near = same.any((1, 2))
    if rings == 1:
        return near
    far = np.flatnonzero(~near & (own >= 0).all(1))
    pairs = np.sort(np.stack(np.broadcast_arrays(own[far][:, :, None], corners[far][:, None, :]), -1), -1)
    wanted = pairs[..., 0] * len(mesh.vertices) + pairs[..., 1]
    found = np.minimum(np.searchsorted(mesh.edge_keys, wanted), len(mesh.edge_keys) - 1)
    near[far] = (mesh.edge_keys[found] == wanted).any((1, 2))
    return near


def _faces_of(mesh: TriangleMesh, own: Int[Index, "P 3"]) -> Int[Index, "P 2"]:
    """The two faces at the edges that points lie on, or one at the vertices."""
    low, high = np.sort(own[:, :2], axis=1).T
    wanted = low * len(mesh.vertices) + high
    edge = np.minimum(np.searchsorted(mesh.edge_keys, wanted), len(mesh.edge_keys) - 1)
    some = np.zeros(len(mesh.vertices), np.int64)
    some[mesh.faces] = np.arange(len(mesh))[:, None]
    faces = np.where((mesh.edge_keys[edge] == wanted)[:, None], mesh.edge_faces[edge], some[low][:, None])
    return np.where(faces < 0, faces[:, :1], faces)


def _clipped(
    mesh: TriangleMesh, pixels: Float[Array, "V 2"], depths: Float[Array, " V"], picture: Picture
) -> tuple[Float[Array, "T 3 2"], Float[Array, "T 3"], Int[Index, " T"]]:
    """Corners in the picture, depths and faces of the triangles, those that cross the near plane cut there."""
    ahead = depths > picture.near
    count = sum(ahead[corner].astype(np.int64) for corner in mesh.faces.T)
    whole = np.flatnonzero(count == 3)
    corners = mesh.faces.take(whole, 0)
    parts = [(pixels.take(corners, 0), depths[corners], whole)]
    for kept in (1, 2):
        face = np.flatnonzero(count == kept)
        if not len(face):
            continue
        # The corner that is alone on its side comes first.
        alone = (ahead[mesh.faces[face]] == (kept == 1)).argmax(1)
        a, b, c = (np.take_along_axis(mesh.faces[face], ((alone + k) % 3)[:, None], 1)[:, 0] for k in range(3))
        ab, ac = (_at_near(mesh, depths, a, end, picture.near) for end in (b, c))
        points = [mesh.vertices[k] for k in (a, b, c)]
        pieces = [(points[0], ab, ac)] if kept == 1 else [(ab, points[1], points[2]), (ab, points[2], ac)]
        for piece in pieces:
            pixel, depth = picture.seen(np.stack(piece, 1))
            parts.append((pixel, np.maximum(depth, picture.near), face))
    if len(parts) == 1:
        return parts[0]
    pixel, depth, face = (np.concatenate(column) for column in zip(*parts, strict=True))
    return pixel, depth, face


def _at_near(
    mesh: TriangleMesh, depths: Float[Array, " V"], one: Int[Index, " N"], other: Int[Index, " N"], near: float
) -> Float[Array, "N 3"]:
    """Where edges cross the near plane."""
    share = (near - depths[one]) / (depths[other] - depths[one])
    return mesh.vertices[one] + share[:, None] * (mesh.vertices[other] - mesh.vertices[one])
