"""Meshes that are bumpy, rounded or scanned, by the forms that they are made of."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Bool, Mask
from diff3ds.sketch import Sketch
from diff3ds.surfaces.form.form_curves import FormCurves, Rounded, form_curves
from diff3ds.surfaces.form.form_mesh import FormMesh, on_forms
from diff3ds.surfaces.form.samples import Samples, flat_share
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.form_lines import form_lines, told_forms

# Where so large a share of the length of edges turns by less than this, degrees, a mesh is as its maker meant it: in
# those of trimesh's models that are of CAD at least .4, in outputs of generators and scans at most .1. Empirical.
FLAT, AS_MEANT = 0.1, 0.2
# Of fewer faces people model by hand what is bent and folded all over, as a car's body; a scan has more. Empirical.
FEWEST = 3000
# A mesh whose vertices are off by less than this, in lengths of its edges, is smooth. Empirical.
SMOOTH = 0.01
# Of what has forms so large a share is flat, of an animal one part in twenty; or there is so much noise, in lengths of
# edges, which is so independent from vertex to vertex, that nothing is. Empirical.
LEAST_FLAT = 0.06
NOISY, INDEPENDENT = 0.1, 0.78
# What turns at a scale nearer to an edge of forms than this is that edge; points along these. Longest sides; empirical.
BESIDE, STEP = 0.03, 0.01


@dataclass(frozen=True, eq=False)
class FormedMesh:
    """A mesh moved onto its forms.

    Attributes:
        mesh: with the forms' normals and edges.
        features: the edges, exact intersections of the forms, or the tangent lines of rounded ones.
        kinds: what each is.
        free: faces that no edge of a form is near.
        told: what run.json says of the forms.
    """

    mesh: FormMesh
    features: Sketch
    kinds: tuple[str, ...]
    free: Bool[Mask, " F"]
    told: dict[str, object]


def formed(mesh: TriangleMesh, rounded: Rounded, say: Callable[[str], None]) -> FormedMesh | None:
    """The mesh by its forms where it is bumpy, rounded or scanned, which is said; None where it is clean, or smooth."""
    if is_as_meant(mesh):
        return None
    middle, size = mesh.bounds.mean(0), mesh.size
    unit = mesh.with_vertices((mesh.vertices - middle) / size)
    samples = Samples.of_mesh(unit)
    if samples.noise < SMOOTH * samples.spacing:
        return None
    scan = samples.independent > INDEPENDENT and samples.noise > NOISY * samples.spacing
    if not scan and flat_share(mesh) < LEAST_FLAT:
        return None
    found = form_curves(samples, rounded=rounded)
    if not len(found.curves):
        return None
    say(
        f"the mesh is bumpy, rounded or scanned: it is drawn by the {len(found.found.forms)} planes, cylinders and "
        "other forms that it is made of, its edges where these meet"
    )
    moved = on_forms(unit, samples, found)
    back = moved.with_vertices(moved.vertices * size + middle)
    free = _away(unit, found)
    return FormedMesh(back, *form_lines(found, middle, size), free, told_forms(found, middle, size))


def _away(mesh: TriangleMesh, found: FormCurves) -> Bool[Mask, " F"]:
    """Which faces are not beside an edge of forms."""
    from scipy.spatial import cKDTree

    lines = [edge.path.at(np.linspace(edge.start, edge.stop, int(edge.length / STEP) + 2)) for edge in found.edges]
    away = cKDTree(np.concatenate(lines)).query(mesh.vertices[mesh.faces].mean(1), workers=-1)[0]
    return np.asarray(away > BESIDE)


def is_as_meant(mesh: TriangleMesh) -> bool:
    """Whether a mesh has few faces, or many edges that are flat, as those that planes and cylinders are cut into."""
    if len(mesh) < FEWEST:
        return True
    turns = np.abs(mesh.turns)
    length = np.linalg.norm(mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]], axis=1)
    whole = length[~np.isnan(turns)].sum()
    return bool(length[turns < FLAT].sum() >= AS_MEANT * whole)
