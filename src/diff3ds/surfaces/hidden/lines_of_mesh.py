"""What one camera sees of a mesh and of strokes around it: contours, and which parts of strokes are hidden."""

from dataclasses import dataclass

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask, Tensor
from diff3ds.bezier.measure import chord_intervals
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.curves.directions import has_corner, unit
from diff3ds.curves.even_out import evened
from diff3ds.page.chords import at, chords_of
from diff3ds.page.parts import Parts
from diff3ds.page.picture import Picture
from diff3ds.project import project
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hatching.dots import dot_strokes
from diff3ds.surfaces.hatching.hatch_lines import hatch_chains
from diff3ds.surfaces.hatching.hatch_strokes import hatch_strokes
from diff3ds.surfaces.hatching.tones import Hatch
from diff3ds.surfaces.hidden.crossings import Outlines, crossings
from diff3ds.surfaces.hidden.mesh_view import MeshView
from diff3ds.surfaces.hidden.visibility import EXACT, Ask, Care, parts_of
from diff3ds.surfaces.lines.contour_gradients import contours_of
from diff3ds.surfaces.lines.contours import Chain, contour_chains
from diff3ds.surfaces.lines.edge_runs import seam_runs
from diff3ds.surfaces.lines.fit_picture import FittedChains, fit_chains
from diff3ds.surfaces.shape.intersections import APART, Seams, places_on_seams
from diff3ds.surfaces.shape.nearest import Nearest
from diff3ds.surfaces.shape.on_lines import along_chords
from diff3ds.surfaces.shape.smooth_surface import SmoothMesh
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Faces within two rings of a contour's point do not hide it: beside a contour facets hide each other.
RINGS = 2
# Of the steps along a contour over which it bends away from the line of sight, or towards it, so few are noise.
# Empirical.
LEAST_RUN = 4
# Of the points that a part of a contour is asked about, so large a share is noise: facets beside it. Empirical.
STRAY = 0.25

# Segments and parameters at which something may change.
Cuts = tuple[Int[Index, " X"], Float[Array, " X"]]


class MeshSeen:
    """A mesh in one view.

    Attributes:
        lines: the contours as strokes, black, of the default width, hidden ones too; then the seams where pieces of the
            mesh go through each other.
        kinds: "contour" or "intersection" for each.
    """

    def __init__(
        self,
        mesh: TriangleMesh,
        cameras: Cameras,
        view: int,
        tolerance: float | None,
        drawn: "Drawn",
        care: Care = EXACT,
    ) -> None:
        """Finds the lines.

        Args:
            mesh: what is seen.
            cameras: the views.
            view: which of them.
            tolerance: largest distance between lines and the strokes that are fitted to them, pixels; None where no
                lines are wanted.
            drawn: what strokes draw already.
            care: how exactly lines are found.
        """
        self._care = care
        self._mesh, self._cameras, self._picture = mesh, cameras[view], Picture.of(cameras, view)
        self._kept: tuple[MeshView, Outlines] | None = None
        found = [] if tolerance is None else contour_chains(mesh, self._picture, drawn.creases)
        own = _parts_of(found, self._picture.seen(_points_of(found))[1] > self._picture.near)
        if mesh.specks > 0:
            own = [chain for chain in own if chain.length > mesh.specks]
        if mesh.beside > 0:
            own = _parts_of(own, ~drawn.run_along(own, mesh.beside))
            own = [c for c in own if c.closed or c.length > mesh.beside]
        self._fit_contours(own, tolerance or 1.0)
        self._seams = _fitted_seams(Seams.of(mesh), ~drawn.seams, self._picture, tolerance)
        self.lines = Sketch.concatenate([self._contours, self._seams]) if len(self._seams) else self._contours
        self.kinds = ("contour",) * len(self._contours) + ("intersection",) * len(self._seams)

    def _fit_contours(self, chains: list[Chain], tolerance: float) -> None:
        # Closed chains come back to their first point.
        rows = [np.arange(len(c.points) + c.closed) % len(c.points) for c in chains]
        first = np.cumsum([0, *(len(row) for row in rows)])
        self._points = np.concatenate([np.zeros((0, 3)), *(c.points[row] for c, row in zip(chains, rows, strict=True))])
        self._own = np.concatenate(
            [np.zeros((0, 3), np.int64), *(c.own[row] for c, row in zip(chains, rows, strict=True))]
        )
        convex = np.ones(len(self._points), bool)
        # What is no end of a chain.
        inner = convex.copy()
        inner[first[:-1]] = inner[first[1:] - 1] = False
        convex[np.delete(np.arange(len(convex)), first[1:] - 1)] = _bends(chains, least_run(self._mesh))
        bent = inner & (convex != np.roll(convex, 1))
        turns = np.concatenate([np.flatnonzero(bent), self._corners(np.flatnonzero(inner))])
        self._fitted = fitted = fit_chains(self._points, first, turns, self._picture, tolerance, self._care.spacing)
        self._convex = convex[fitted.start]
        control = self._control()
        weights = control[..., 3]
        points = control[..., :3] / weights[..., None]
        counts = np.bincount(fitted.chain, minlength=len(chains))
        made = Chains.of(counts.tolist(), [c.closed for c in chains])
        self._contours = Sketch(points, weights / weights[:, :1], chains=made)

    def _corners(self, inner: Int[Index, " I"]) -> Int[Index, " U"]:
        """The points of contours that are corners at vertices on creases; what turns on a smooth part is noise."""
        on_crease = np.zeros(len(self._mesh.vertices), bool)
        on_crease[self._mesh.edges[self._mesh.is_crease | (self._mesh.edge_counts != 2)]] = True
        inner = inner[on_crease[self._own[inner]].all(1)]
        before, here, after = (self._points[inner + step] for step in (-1, 0, 1))
        return inner[has_corner(here - before, after - here)]

    def _control(self) -> Float[Tensor, "C 4 4"]:
        """Homogeneous control points of the contours; functions of the vertices where gradients are wanted."""
        vertices, fitted = self._mesh.points, self._fitted
        if not (vertices.requires_grad and torch.is_grad_enabled() and len(fitted.start)):
            return torch.from_numpy(fitted.control)
        return contours_of(vertices, self._own, torch.from_numpy(self._points), fitted, self._cameras)

    def _hiding(self) -> tuple[MeshView, Outlines]:
        """What hides: the mesh in the picture, and where in the picture that may change.

        Made when it is first asked for. Until Python 3.12 a `cached_property` made it for one view at a time.
        """
        if self._kept is None:
            view = MeshView(self._mesh, self._picture)
            self._kept = view, self._outlines(view)
        return self._kept

    def _outlines(self, view: MeshView) -> Outlines:
        """Edges between a face that is seen from outside and one from inside, and edges without just two faces."""
        one, other = self._mesh.edge_faces.T
        outside = view.above > 0
        chosen = (self._mesh.edge_counts != 2) | (outside[one] != outside[other])
        ends, near = self._mesh.edges[chosen], self._picture.near
        depths = view.depths[ends]
        ends, depths = ends[(depths > near).any(1)], depths[(depths > near).any(1)]
        # What reaches behind the near plane is cut there.
        way = depths[:, ::-1] - depths
        share = np.clip((near - depths) / np.where(way == 0, 1.0, way), 0, 1) * (depths < near)
        points = self._mesh.vertices[ends]
        pixels, depths = self._picture.seen(points + share[..., None] * (points[:, ::-1] - points))
        return Outlines.of(pixels, np.maximum(depths, near))

    def line_parts(self) -> Parts:
        """Which parts of the lines are seen."""
        inside = ~self._convex & self._mesh.is_closed
        behind = self._behind(self._fitted, self._points, self._own, RINGS)

        def hidden(segment: Int[Index, " Q"], t: Float[Array, " Q"]) -> Bool[Mask, " Q"]:
            return behind(segment, t) | inside[segment]

        contours = self._parts(self._contours, hidden, 0.0, STRAY, self._through_seams(*self._fitted.places))
        return Parts.concatenate(contours, self.parts(self._seams), len(self._contours.points))

    def hatching(self, hatch: Hatch) -> Sketch:
        """What is seen of lines or dots that make the mesh as dark as is asked."""
        if hatch.stipple:
            return dot_strokes(self._mesh, self._cameras, hatch, self._hiding()[0].hides)
        found = hatch_chains(self._mesh, self._cameras, hatch)
        strokes, fitted = hatch_strokes(found, self._picture)
        behind = self._behind(fitted, found.points, self._mesh.faces[found.face], 0)
        return self._parts(strokes, behind, 0.0, 0.0).seen_of(strokes)

    def _behind(self, fitted: FittedChains, points: Float[Array, "M 3"], own: Int[Index, "M 3"], rings: int) -> Ask:
        """What asks whether something of the mesh lies in front of chains on it; as `MeshView.in_front`."""
        axis, place = fitted.places

        def behind(segment: Int[Index, " Q"], t: Float[Array, " Q"]) -> Bool[Mask, " Q"]:
            along = np.interp(segment + t, axis, place)
            before = np.minimum(along.astype(np.int64), len(points) - 2)
            share = self._in_perspective(points, before, along - before, 1)[:, None]
            asked = points[before] * (1 - share) + points[before + 1] * share
            return self._hiding()[0].in_front(asked, own[np.rint(along).astype(np.int64)], rings)

        return behind

    def parts(self, sketch: Sketch) -> Parts:
        """Which parts of a sketch's segments are seen; those that are near the mesh lie on it."""
        if not len(sketch):
            return Parts.none()
        tolerance = self._mesh.near
        nearest = Nearest.of(self._mesh, tolerance)
        control = _homogeneous(sketch)

        def hidden(segment: Int[Index, " Q"], t: Float[Array, " Q"]) -> Bool[Mask, " Q"]:
            value = at(control[segment], t)
            points = value[:, :3] / value[:, 3:]
            moved, own = nearest.places(points)
            found = self._hiding()[0].in_front(moved, own)
            if self._mesh.beside > 0:
                # An edge outside of its rounding is seen where that is already on the other side.
                found[found] = self._hiding()[0].in_front(points[found], own[found])
            return found

        return self._parts(sketch, hidden, tolerance, 0.0)

    def _through_seams(self, axis: Float[Array, " A"], place: Float[Array, " A"]) -> Cuts:
        """Where contours go into another piece of the mesh: their pictures only touch that of the seam there."""
        if not len(axis):
            return np.zeros(0, np.int64), axis
        seam = Seams.of(self._mesh)
        before, share = places_on_seams(self._points, seam, APART * self._mesh.size)
        along = before + self._in_perspective(self._points, before, share, -1)
        segment, t = np.divmod(np.interp(along, place, axis), 1)
        return segment.astype(np.int64), t

    def _in_perspective(
        self, points: Float[Array, "M 3"], before: Int[Index, " Q"], share: Float[Array, " Q"], power: int
    ) -> Float[Array, " Q"]:
        """Shares of the way from one point of a contour to the next, in the picture (power 1), in space, or back (-1).

        Strokes that are fitted in the picture go along it evenly, and faster in space where it is farther away.
        """
        if self._picture.orthographic:
            return share
        near, far = (self._picture.seen(points[row])[1] ** power for row in (before, before + 1))
        return share * near / ((1 - share) * far + share * near)

    def _parts(self, sketch: Sketch, hidden: Ask, behind: float, stray: float, more: Cuts | None = None) -> Parts:
        cubics = project(sketch.detach(), self._cameras).cubics[0].detach().cpu().numpy()
        chords = chords_of(cubics, self._picture)
        cuts = crossings(cubics, chords, self._hiding()[1], self._picture, behind)
        if more is not None:
            cuts = np.concatenate([cuts[0], more[0]]), np.concatenate([cuts[1], more[1]])
        return parts_of(chords, cuts, hidden, stray, self._care)


@dataclass(frozen=True, eq=False)
class Drawn:
    """What strokes of a sketch draw of a mesh already.

    Attributes:
        creases: of the edges, those creases that strokes run along.
        seams: which steps of its seams they run along.
        chords: of the strokes.
    """

    creases: Bool[Mask, " E"]
    seams: Bool[Mask, " S"]
    chords: Float[Array, "C 2 3"]

    @staticmethod
    def by(sketch: Sketch, mesh: TriangleMesh) -> "Drawn":
        """By the strokes of this sketch."""
        seam, chords = Seams.of(mesh), chords_in_space(sketch, mesh.near / 4)
        seams = along_chords(seam.points[seam.steps].mean(1), chords, mesh.near)
        return Drawn(creases_along(mesh, chords), seams, chords)

    def run_along(self, chains: list[Chain], distance: float) -> Bool[Mask, " M"]:
        """Which points of contours lie within a distance of strokes that go their way, but for short runs of others."""
        points = _points_of(chains)
        first, chain = _firsts_of(chains)
        rows = np.arange(len(points))
        before, after = np.maximum(rows - 1, first[chain]), np.minimum(rows + 1, first[chain + 1] - 1)
        # As of `np.gradient`, chain by chain.
        ways = unit((points[after] - points[before]) / np.maximum(after - before, 1)[:, None])
        along = along_chords(points, self.chords, distance, ways)
        return evened(along, np.ones(len(along)), LEAST_RUN, chain)


def prepare(mesh: TriangleMesh, with_strokes: bool) -> None:
    """Makes what all views need of a mesh, so that those that are looked at side by side do not each make it."""
    _ = mesh.corner_normals, mesh.is_closed, mesh.edge_keys
    if with_strokes or len(Seams.of(mesh).steps):
        Nearest.of(mesh, mesh.near)


def _fitted_seams(seam: Seams, chosen: Bool[Mask, " S"], picture: Picture, tolerance: float | None) -> Sketch:
    """Strokes along some steps of seams, where these are in front of the near plane."""
    steps = seam.steps[chosen & (picture.seen(seam.points)[1] > picture.near)[seam.steps].all(1)]
    chains = [] if tolerance is None else seam_runs(seam.points, steps)
    rows = np.concatenate([np.zeros(0, np.int64), *(np.array(chain) for chain in chains)])
    first = np.cumsum([0, *(len(chain) for chain in chains)])
    fitted = fit_chains(seam.points[rows], first, np.zeros(0, np.int64), picture, tolerance or 1.0)
    control = torch.from_numpy(fitted.control)
    weights = control[..., 3]
    counts = np.bincount(fitted.chain, minlength=len(chains)).tolist()
    made = Chains.of(counts, [chain[0] == chain[-1] for chain in chains])
    return Sketch(control[..., :3] / weights[..., None], weights / weights[:, :1], chains=made)


def creases_along(mesh: TriangleMesh, chords: Float[Array, "C 2 3"]) -> Bool[Mask, " E"]:
    """The creases of a mesh that straight chords of strokes run along."""
    along = mesh.is_crease.copy()
    along[along] = along_chords(mesh.vertices[mesh.edges[along]].mean(1), chords, mesh.near)
    return along


def chords_in_space(sketch: Sketch, tolerance: float) -> Float[Array, "C 2 3"]:
    """The strokes of a sketch as straight chords within a tolerance, world units."""
    if not len(sketch):
        return np.zeros((0, 2, 3))
    control = _homogeneous(sketch)
    intervals = chord_intervals(torch.from_numpy(control), tolerance)
    own = control[intervals.curve.numpy()]
    ends = [at(own, t.numpy()) for t in (intervals.start, intervals.stop)]
    return np.stack([end[:, :3] / end[:, 3:] for end in ends], 1)


def _homogeneous(sketch: Sketch) -> Float[Array, "M 4 4"]:
    raised = sketch.detach().to(torch.float64).elevate()
    control: Tensor = torch.cat([raised.points * raised.weights[..., None], raised.weights[..., None]], -1)
    return control.cpu().numpy()


def least_run(mesh: TriangleMesh) -> int:
    """So many steps along a contour of the mesh are no noise."""
    return LEAST_RUN * (mesh.finer if isinstance(mesh, SmoothMesh) else 1)


def _bends(chains: list[Chain], least: int) -> Bool[Mask, " S"]:
    """Over which steps of all chains the surface bends away from the line of sight, but for noise."""
    count = [len(chain.convex) for chain in chains]
    number = np.repeat(np.arange(len(chains)), count)
    convex = np.concatenate([np.zeros(0, bool), *(chain.convex for chain in chains)])
    closed = np.array([chain.closed for chain in chains], bool)[number]
    return evened(convex, np.ones(len(convex)), least, number, closed)


def _points_of(chains: list[Chain]) -> Float[Array, "M 3"]:
    """The points of all chains, one after the other."""
    return np.concatenate([np.zeros((0, 3)), *(c.points for c in chains)])


def _firsts_of(chains: list[Chain]) -> tuple[Int[Index, " C_1"], Int[Index, " M"]]:
    """Where each chain begins among the points of all, and where the last one ends; the chain of each point."""
    counts = np.array([len(c.points) for c in chains], np.int64)
    return np.append(0, np.cumsum(counts)), np.repeat(np.arange(len(chains)), counts)


def _parts_of(chains: list[Chain], kept: Bool[Mask, " M"]) -> list[Chain]:
    """The parts of chains of which some points are kept, of all of them; parts of a closed one are open."""
    if kept.all():
        return chains
    first, chain = _firsts_of(chains)
    whole = np.bincount(chain, ~kept, len(chains)) == 0
    # A closed one is opened where it is not kept.
    lost = np.flatnonzero(~kept)
    broken, place = np.unique(chain[lost], return_index=True)
    turn = np.zeros(len(chains), np.int64)
    turn[broken] = (lost[place] - first[broken]) * np.array([chains[row].closed for row in broken])
    local = (np.arange(len(chain)) - first[chain] + turn[chain]) % np.diff(first)[chain]
    rows = first[chain] + local
    points, own = _points_of(chains)[rows], np.concatenate([c.own for c in chains])[rows]
    # An open chain has no step from its last point, with which a part ends at any rate.
    steps = np.array([len(c.convex) for c in chains], np.int64)
    before = np.cumsum(steps) - steps
    convex = np.concatenate([c.convex for c in chains])[before[chain] + np.minimum(local, steps[chain] - 1)]
    fresh = np.append(True, (chain[1:] != chain[:-1]) | (kept[rows[1:]] != kept[rows[:-1]]))
    start = np.flatnonzero(fresh)
    stop = np.append(start[1:], len(rows))
    some = kept[rows[start]] & (whole[chain[start]] | (stop - start > 1))
    return [
        chains[row] if all_of_it else Chain(points[a:b], own[a:b], convex[a : b - 1], False)
        for row, all_of_it, a, b in zip(
            *(column[some].tolist() for column in (chain[start], whole[chain[start]], start, stop)), strict=True
        )
    ]
