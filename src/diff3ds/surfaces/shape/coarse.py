"""Meshes of fewer triangles for small pictures, which do not show the others: vertices of a cell of a grid made one."""

from dataclasses import dataclass

import numpy as np
import torch

from diff3ds.bezier import length
from diff3ds.chains import Chains
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Meshes of fewer triangles are drawn quickly as they are.
FEW = 200_000


# Contours of a coarse mesh that are shorter than so many cells are specks, where its vertices were put together: of
# generated meshes eight of ten are. Empirical.
SPECK = 5.0


@dataclass(frozen=True, eq=False, init=False)
class CoarseMesh(TriangleMesh):
    """A mesh of which vertices were put together.

    Attributes:
        cell: how far, world units.
    """

    cell: float

    @property
    def specks(self) -> float:
        """How long contours are at most that are no more than how vertices were put together."""
        return SPECK * self.cell


def coarse(mesh: TriangleMesh, cells: int) -> TriangleMesh:
    """A mesh of which no vertex is farther from the given one than a cell, or the given one where it has few triangles.

    Vertices of a cell lie at their mean. The two sides of a thin wall stay apart: vertices are put together only where
    their normals lie in one octant. Where the mesh has no creases, noise of the grid makes none.

    Args:
        mesh: any.
        cells: along its longest side: so fine that a cell is less than a pixel.
    """
    if len(mesh) <= FEW:
        return mesh
    cell = np.floor((mesh.vertices - mesh.bounds[0]) * (cells / mesh.size)).astype(np.int64)
    corners, weight = mesh.faces.ravel(), np.repeat(mesh.face_normals * mesh.face_areas[:, None], 3, axis=0)
    normal = np.stack([np.bincount(corners, weight[:, k], len(mesh.vertices)) for k in range(3)], 1)
    octant = (normal >= 0) @ np.array([1, 2, 4])
    key = ((cell[:, 0] * (cells + 1) + cell[:, 1]) * (cells + 1) + cell[:, 2]) * 8 + octant
    _, group, counts = np.unique(key, return_inverse=True, return_counts=True)
    middle = np.stack([np.bincount(group, mesh.vertices[:, k]) for k in range(3)], 1) / counts[:, None]
    faces = group[mesh.faces]
    kept = (faces != np.roll(faces, 1, axis=1)).all(1)
    if not kept.any():
        return mesh
    crease = mesh.crease if mesh.is_crease.any() else 180.0
    found = TriangleMesh(middle, faces[kept], mesh.part[kept], crease)
    return found.changed(CoarseMesh, cell=mesh.size / cells)


def without_specks(sketch: Sketch, least: float) -> Sketch:
    """The strokes of some length: contours of a coarse mesh have specks where its vertices were put together."""
    if not len(sketch):
        return sketch
    chains = sketch.chains or Chains.plain(len(sketch))
    lengths = length(sketch.points.detach().double(), sketch.weights.detach().double())
    whole = torch.zeros(len(sketch), dtype=torch.float64).index_add_(0, chains.stroke, lengths)
    return sketch[whole >= least]
