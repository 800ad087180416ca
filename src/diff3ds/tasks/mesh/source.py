"""What `diff3ds mesh` draws: a mesh as it is or by the forms that it is made of, or solids by their own edges."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from diff3ds.formats.cad.solids import SOLIDS
from diff3ds.surfaces.form.solid_mesh import load_solid
from diff3ds.surfaces.hidden.outside import outer_faces
from diff3ds.surfaces.lines.feature_curves import crease_length, loose_share, outline_share
from diff3ds.surfaces.shape.colors import SurfaceColors
from diff3ds.surfaces.shape.load_surface import load_colored_surface, load_surface
from diff3ds.surfaces.shape.triangle_mesh import CREASE as CREASE_ANGLE
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.form_lines import with_tangents
from diff3ds.tasks.mesh.formed import formed, is_as_meant
from diff3ds.tasks.mesh.mesh_lines import FixedLines, both, feature_lines, from_outside, scale_lines
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.progress import Progress, Report

# A thing whose creases and borders draw less of its outlines than this is smooth: outlines are added. Of a cylinder as
# high as wide they draw .61. Empirical.
LEAST_OUTLINE = 0.5
# So large a share of the creases may end nowhere: of a machine part few do, of an animal most. Empirical.
MOST_LOOSE = 0.5
# And where some do, creases of a smooth thing that are shorter than this in the mean, a share of its longest side, are
# folds and cracks of a scan: those of a machine part are several times as long. Empirical.
SOME_LOOSE, SHORT = 0.1, 0.08
# Of fewer faces a crease at a scale has too few rows. Empirical.
FINE = 10_000


@dataclass(frozen=True, eq=False)
class Source:
    """What is drawn.

    Attributes:
        mesh: what hides.
        colors: of it, where they are wanted.
        edges: its lines that are there from everywhere, and what each is, where they are known.
        told: what run.json says of how it was read.
    """

    mesh: TriangleMesh
    colors: SurfaceColors | None = None
    edges: FixedLines | None = None
    told: dict[str, object] = field(default_factory=dict)

    def by_forms(self, options: MeshOptions, say: Callable[[str], None]) -> "Source":
        """A mesh by its forms where it is bumpy, rounded or scanned, and without creases that are scraps elsewhere.

        Where it has no creases of faces, or is no form, it has those at a scale. Of what nobody outside sees it has no
        lines then.

        Raises:
            ValueError: as `feature_lines`.
        """
        if self.edges is not None:
            return self
        if options.angle is None and not is_as_meant(self.mesh):
            outer = self._outer()
            found = formed(outer.mesh, options.rounded, say)
            if found is not None:
                edges = with_tangents(found.features, found.kinds, options.tangent)
                lines = from_outside(both(edges, scale_lines(outer.mesh, found.free)), outer.mesh)
                return replace(outer, mesh=found.mesh, edges=lines, told=found.told)
        mesh = creased(self.mesh, options.angle)
        if options.angle is not None or len(mesh) < FINE or mesh.is_crease.any():
            return replace(self, mesh=mesh, edges=feature_lines(mesh))
        outer = replace(self, mesh=mesh)._outer()
        lines = from_outside(both(feature_lines(outer.mesh), scale_lines(outer.mesh)), outer.mesh)
        return replace(outer, edges=lines)

    def _outer(self) -> "Source":
        """Without pieces that nobody outside sees: where walls are double, what lies between the two has no side."""
        kept = outer_faces(self.mesh)
        if kept.all():
            return self
        whole, rows = self.mesh, np.flatnonzero(kept)
        mesh = TriangleMesh(whole.vertices, whole.faces[rows], whole.part[rows], whole.crease, whole.polygon[rows])
        return replace(self, mesh=mesh, colors=None if self.colors is None else self.colors.of_faces(rows[mesh.source]))


def read_source(path: Path, options: MeshOptions, report: Report, say: Callable[[str], None]) -> Source:
    """The mesh or the solids in a file, and the colours where they are wanted."""
    if path.suffix.lower() in SOLIDS:
        return _solids(path, options, report)
    crease = options.angle or CREASE_ANGLE
    if not options.color:
        return Source(load_surface(path, up=options.up, crease=crease))
    mesh, colors = load_colored_surface(path, up=options.up, crease=crease)
    for name in colors.missing:
        say(f"warning: {name} cannot be read from the folder of {path.name}: what it colours may be of another colour")
    return Source(mesh, colors)


def _solids(path: Path, options: MeshOptions, report: Report) -> Source:
    """The solids of a file, by their edges.

    Raises:
        ValueError: as `load_solid`; options that are for meshes.
    """
    for name, given in (("angle", options.angle is not None), ("color", options.color)):
        if given:
            raise ValueError(f"{path}: --{name} is for meshes, and this is a file of solids: leave it out")
    solid = load_solid(path, options.up, lambda done, of: report(Progress("bodies", done, of, None, 0)))
    edges = with_tangents(solid.edges, solid.kinds, options.tangent)
    return Source(solid.mesh, None, edges, told={"parts": list(solid.mesh.parts)})


def creased(mesh: TriangleMesh, angle: float | None) -> TriangleMesh:
    """The mesh without creases where most of them are scraps that end nowhere, or short, unless an angle is given."""
    if angle is not None or not mesh.is_crease.any():
        return mesh
    loose = loose_share(mesh)
    short = loose > SOME_LOOSE and crease_length(mesh) < SHORT * mesh.size and outline_share(mesh) < LEAST_OUTLINE
    return mesh.with_crease(180.0) if loose > MOST_LOOSE or short else mesh
