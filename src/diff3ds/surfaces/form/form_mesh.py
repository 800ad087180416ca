"""A mesh moved onto the forms that it is made of, with their normals and edges, so that no outline wobbles."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.directions import unit
from diff3ds.surfaces.form.edges import SMOOTH
from diff3ds.surfaces.form.exact_meets import FREE_STEPS, STEPS, onto
from diff3ds.surfaces.form.form_curves import FormCurves
from diff3ds.surfaces.form.free import NONE, FreeForm
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import within
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# A rounded edge lies so far inside of a sharp one, and begins so far from it, in spacings of the samples. Empirical.
ROUNDED, BESIDE = 0.8, 1.5


@dataclass(frozen=True, eq=False, init=False)
class FormMesh(TriangleMesh):
    """A mesh whose faces lie on forms; its topology is that of the mesh that it was.

    Attributes:
        form: which surface each face lies on; `free.NONE` where it is on none.
        own_normals: unit normals of that at the corners of the faces, outwards.
        off: how far from their forms samples may lie, how far from sharp edges rounded ones, and how far from these the
            rounding may begin; as shares of the size.
    """

    form: Int[Index, " F"]
    own_normals: Float[Array, "F 3 3"]
    off: tuple[float, float, float]

    @property
    def near(self) -> float:
        """What is nearer to the mesh than this lies on it, world units: as a sharp edge does that it has rounded."""
        return max(super().near, self.off[1] * self.size)

    @property
    def touching(self) -> float:
        """What of the mesh is nearer to a point than this does not hide it, world units: as samples are off forms."""
        return self.off[0] * self.size

    @property
    def beside(self) -> float:
        """Contours that run along strokes are those strokes' where they are nearer than this: on rounded edges."""
        return self.off[2] * self.size

    @cached_property
    def face_normals(self) -> Float[Array, "F 3"]:
        """Unit normals of the forms: noise may turn faces over."""
        return unit(np.einsum("fki->fi", self.own_normals))

    @cached_property
    def is_crease(self) -> Bool[Mask, " E"]:
        """Edges between faces of two forms that meet there at more than forms go on in each other."""
        one, other = self.edge_faces.T
        return (self.form[one] != self.form[other]) & (np.nan_to_num(np.abs(self.turns)) > SMOOTH)

    @cached_property
    def corner_normals(self) -> Float[Array, "F 3 3"]:
        """Unit normals at the corners of each face, those of the forms, alike where these go on in each other."""
        fan, fans = self.fans
        flat = self.own_normals.reshape(-1, 3)
        total = np.stack([np.bincount(fan, flat[:, k], fans) for k in range(3)], 1)[fan]
        return unit(total.astype(np.float64)).reshape(-1, 3, 3)


def on_forms(mesh: TriangleMesh, samples: Samples, found: FormCurves) -> FormMesh:
    """The mesh moved onto its forms, where these are near.

    Vertices between faces of forms that have an edge lie on that, and between three in a corner. What is farther from
    forms than their own samples, and than rounded edges from sharp ones, stays as it is.

    Args:
        samples: of the mesh.
        found: the forms of these.
    """
    of_faces = _of_faces(mesh, samples, found.label)
    near = within(samples)
    limit = near + ROUNDED * samples.spacing
    points, on = _moved(mesh, of_faces, found, limit)
    here = (on[mesh.faces] == of_faces[:, None, None]).any(2).all(1)
    form = np.where(here, of_faces, NONE)
    by_face = samples.corners is not None
    toward = samples.normals if by_face else unit(samples.normals[mesh.faces].sum(1))
    normals = np.repeat(toward[:, None], 3, 1) if by_face else samples.normals[mesh.faces]
    for k, surface in enumerate(found.surfaces):
        rows = np.flatnonzero(form == k)
        if len(rows):
            corners, place = np.unique(mesh.faces[rows], return_inverse=True)
            own = surface.normal(points[corners])[place].reshape(-1, 3, 3)
            sign = np.sign(np.einsum("fki,fi->fk", own, toward[rows]))
            normals[rows] = own * np.where(sign == 0, 1, sign)[..., None]
    off = near / samples.size, limit / samples.size, (near + BESIDE * samples.spacing) / samples.size
    return mesh.with_vertices(points).changed(FormMesh, form=form, own_normals=normals, off=off)


def _of_faces(mesh: TriangleMesh, samples: Samples, label: Int[Index, " N"]) -> Int[Index, " F"]:
    """The surface of each face: what two of its vertices are on, or the first; of samples that are faces their own."""
    if samples.corners is not None:
        return label
    a, b, c = label[mesh.faces].T
    return np.where((b == c) | (a == NONE), b, a)


def _moved(
    mesh: TriangleMesh, form: Int[Index, " F"], found: FormCurves, limit: float
) -> tuple[Float[Array, "V 3"], Int[Index, "V 3"]]:
    """The vertices on the surfaces of their faces, and on which, as many at once as are no farther than the limit."""
    points, on = mesh.vertices.copy(), np.full((len(mesh.vertices), 3), NONE)
    meeting = {edge.forms for edge in found.edges}
    most = _most_frequent(mesh, form)
    for count in (3, 2, 1):
        wanted = np.flatnonzero((on[:, 0] == NONE) & (most[:, count - 1] != NONE))
        groups, group = np.unique(np.sort(most[wanted, :count], axis=1), axis=0, return_inverse=True)
        order = np.argsort(group.ravel(), kind="stable")
        parts = np.split(wanted[order], np.cumsum(np.bincount(group.ravel(), minlength=len(groups))))
        for chosen, rows in zip(groups, parts, strict=False):
            if not all(pair in meeting for pair in combinations(chosen.tolist(), 2)):
                continue
            some = [found.surfaces[k] for k in chosen]
            free = any(isinstance(one, FreeForm) for one in some)
            place = onto(some, mesh.vertices[rows], 1 if count == 1 else FREE_STEPS if free else STEPS)
            near = rows[np.linalg.norm(place - mesh.vertices[rows], axis=1) < limit]
            points[near] = place[np.isin(rows, near)]
            on[near, :count] = chosen
    return points, on


def _most_frequent(mesh: TriangleMesh, form: Int[Index, " F"]) -> Int[Index, "V 3"]:
    """The three surfaces that most faces around each vertex are on, NONE for those that there are not."""
    count = int(form.max(initial=0)) + 1
    corners, forms = mesh.faces.ravel(), np.repeat(form, 3)
    keys, faces = np.unique((corners * count + forms)[forms != NONE], return_counts=True)
    vertex, own = np.divmod(keys, count)
    order = np.lexsort((-faces, vertex))
    vertex, own = vertex[order], own[order]
    first = np.searchsorted(vertex, vertex)
    rank = np.arange(len(vertex)) - first
    out = np.full((len(mesh.vertices), 3), NONE)
    out[vertex[rank < 3], rank[rank < 3]] = own[rank < 3]
    return out
