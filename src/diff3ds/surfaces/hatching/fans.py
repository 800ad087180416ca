"""A mesh as vertices with one normal each: those at creases once for each side, so that nothing goes on over them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.curves.directions import unit
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Cotangents of slivers: less would let go of neighbours, more would hold one alone. Empirical.
LEAST, MOST = 0.05, 5.0


@dataclass(frozen=True, eq=False)
class Fans:
    """The smooth pieces of a mesh.

    Attributes:
        faces: fans at the corners of each face.
        points: of each fan, world units.
        normals: unit vectors.
    """

    faces: Int[Index, "F 3"]
    points: Float[Array, "N 3"]
    normals: Float[Array, "N 3"]

    @staticmethod
    def of(mesh: TriangleMesh) -> "Fans":
        """Those of a mesh."""
        fan, count = mesh.fans
        points, normals = np.zeros((count, 3)), np.zeros((count, 3))
        points[fan] = mesh.vertices[mesh.faces.ravel()]
        normals[fan] = mesh.corner_normals.reshape(-1, 3)
        return Fans(fan.reshape(-1, 3), points, normals)

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def tangents(self) -> tuple[Float[Array, "N 3"], Float[Array, "N 3"]]:
        """Two unit vectors at right angles to each normal and each other, counter-clockwise seen from outside."""
        aside = np.eye(3)[np.abs(self.normals).argmin(1)]
        first = unit(np.cross(self.normals, aside))
        return first, np.cross(self.normals, first)

    @cached_property
    def areas(self) -> Float[Array, " N"]:
        """A third of that of the faces around each, world units squared."""
        a, b, c = self.points[self.faces].transpose(1, 0, 2)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6
        return np.asarray(np.bincount(self.faces.ravel(), np.repeat(area, 3), len(self)), np.float64)

    @cached_property
    def edges(self) -> tuple[Int[Index, "E 2"], Int[Index, "F 3"], Float[Array, " E"]]:
        """Edges, the smaller fan first, those of each face, between its corners 0 and 1, 1 and 2, 2 and 0, and weights.

        A weight is half the sum of the cotangents of the angles opposite the edge (Pinkall and Polthier 1993).
        """
        sides = np.sort(np.stack([self.faces, np.roll(self.faces, -1, 1)], 2), axis=2)
        keys, of_faces = np.unique(sides[..., 0] * len(self) + sides[..., 1], return_inverse=True)
        of_faces = of_faces.reshape(-1, 3)
        corners = self.points[self.faces]
        opposite = np.roll(corners, 1, 1)
        one, other = corners - opposite, np.roll(corners, -1, 1) - opposite
        sine = np.linalg.norm(np.cross(one, other), axis=2)
        cotangent = np.einsum("fki,fki->fk", one, other) / np.maximum(sine, 1e-300)
        weight = np.bincount(of_faces.ravel(), np.clip(cotangent, -MOST, MOST).ravel() / 2, len(keys))
        ends = np.stack([keys // len(self), keys % len(self)], 1)
        return ends, of_faces, np.clip(np.asarray(weight, np.float64), LEAST, MOST)
