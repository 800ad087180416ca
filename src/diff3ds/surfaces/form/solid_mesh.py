"""A solid as a mesh: its triangles with the normals of its faces, and the edges between these."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from diff3ds._shapes import Bool, Index, Int, Mask
from diff3ds.curves.directions import unit
from diff3ds.formats.cad.solids import SolidFile, read_solids
from diff3ds.sketch import Sketch
from diff3ds.surfaces.form.form_mesh import FormMesh
from diff3ds.surfaces.shape.nearest import closest_on_triangles
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Faces whose normals turn by more than this over an edge have a crease there, degrees: a little more than what makes
# an edge a tangent one (`formats.cad.solid_reader.TANGENT`).
SHARP = 0.7
# In deflections: what of another face is nearer to a line does not hide it, as of a shaft in its bore; how far from
# its triangles an edge may lie; and how far from edges a contour that runs along them.
TOUCHING, NEAR, BESIDE = 3.0, 4.0, 3.0


@dataclass(frozen=True, eq=False, init=False)
class SolidMesh(FormMesh):
    """The faces of solids as triangles; `form` numbers the faces.

    Attributes:
        names: of the faces.
        parts: names of the parts.
    """

    names: tuple[str, ...]
    parts: tuple[str, ...]

    @property
    def near(self) -> float:
        """What is nearer to the mesh than this lies on it, world units."""
        return self.off[1] * self.size

    @cached_property
    def is_crease(self) -> Bool[Mask, " E"]:
        """Edges between faces that do not go on in each other."""
        sides = self.edge_faces
        corner = (self.faces[sides][:, :, None] == self.edges[:, None, :, None]).argmax(3)
        normals = self.own_normals[sides[..., None], corner]
        turn = np.einsum("eki,eki->ek", normals[:, 0], normals[:, 1]).min(1)
        two = (self.edge_counts == 2) & (self.form[sides[:, 0]] != self.form[sides[:, 1]])
        return np.asarray(two & (turn < np.cos(np.deg2rad(SHARP))))

    @cached_property
    def surfaces(self) -> tuple[Int[Index, " F"], Int[Index, " F"]]:
        """The number of each face's surface, and of the smooth whole of such that go on in each other."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        one, other = self.edge_faces[(self.edge_counts == 2) & ~self.is_crease].T
        graph = coo_matrix((np.ones(len(one), bool), (one, other)), shape=(len(self), len(self)))
        return self.form, connected_components(graph, directed=False)[1].astype(np.int64)


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid, or an assembly.

    Attributes:
        mesh: what hides.
        edges: exact, float64.
        kinds: what each edge is: "crease", "border" or "tangent".
    """

    mesh: SolidMesh
    edges: Sketch
    kinds: tuple[str, ...]


def load_solid(path: Path, up: str, told: Callable[[int, int], None] = lambda done, of: None) -> Solid:
    """The bodies in a STEP, IGES or BREP file, in millimetres, z up.

    Args:
        up: the axis that points up in the file, "z" or "y".
        told: how many bodies are read, and of how many.

    Raises:
        ValueError, OSError, ImportError: as `read_solids`.
    """
    read = read_solids(path, told)
    if up == "y":
        edges = read.edges.replace(points=read.edges.points[..., [2, 0, 1]])
        read = replace(read, vertices=read.vertices[:, [2, 0, 1]], normals=read.normals[:, [2, 0, 1]], edges=edges)
    return Solid(_mesh(read), read.edges, read.kinds)


def _mesh(read: SolidFile) -> SolidMesh:
    plain = TriangleMesh(read.vertices, read.triangles, read.part)
    corners: Index = read.triangles[plain.source]
    # By place: faces of the mesh may begin at another corner, or be parts of those of the file.
    of, places = np.repeat(np.arange(len(plain)), 3), plain.vertices[plain.faces].reshape(-1, 3)
    shares = closest_on_triangles(places, read.vertices[corners[of]])[1]
    normals = unit(np.einsum("ck,cki->ci", shares, read.normals[corners[of]])).reshape(-1, 3, 3)
    sign = np.sign(np.einsum("fki,fi->f", normals, plain.face_normals))
    normals *= np.where(sign == 0, 1, sign)[:, None, None]
    step = read.deflection / plain.size
    off = (TOUCHING * step, NEAR * step, BESIDE * step)
    form = read.face[plain.source]
    return plain.changed(SolidMesh, form=form, own_normals=normals, off=off, names=read.faces, parts=read.parts)
