"""What one camera sees of a union of quadrics and of strokes around it: its lines, and which parts are hidden."""

from collections.abc import Callable
from functools import cached_property
from typing import cast

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask, Tensor
from diff3ds.bezier.curves import bernstein, homogeneous_derivatives
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.curves.bernstein_roots import bernstein_roots, quadratic_form
from diff3ds.page.chords import chords_of
from diff3ds.page.parts import Parts, cut_sketch
from diff3ds.page.picture import Picture
from diff3ds.project import project
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hatching.dots import dot_strokes
from diff3ds.surfaces.hatching.hatch_lines import hatch_chains
from diff3ds.surfaces.hatching.hatch_strokes import hatch_strokes
from diff3ds.surfaces.hatching.tones import Hatch
from diff3ds.surfaces.hidden.mesh_view import MeshView
from diff3ds.surfaces.hidden.visibility import Ask, parts_of
from diff3ds.surfaces.lines.fit_picture import fit_chains
from diff3ds.surfaces.lines.quadric_meets import bounds, meeting_chains, onto_both, triangles_of
from diff3ds.surfaces.shape.quadric_forms import Forms
from diff3ds.surfaces.shape.quadrics import ARCS, Quadrics, conics
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# What lies so deep in a solid, as a share of its radius, is inside: rounding; and strokes that lie on it, which float32
# and fits leave a little inside.
ROUNDING, ON_SURFACE = 1e-7, 2e-3
# Of the points that a part is asked about, so large a share is noise: parts are cut where anything changes.
STRAY = 0.3
# Largest distance between a curve in which two solids meet and the strokes that are fitted to it, pixels.
MEETING = 0.1
KINDS = ("contour", "crease", "crease")


class QuadricsSeen:
    """Quadrics in one view.

    Attributes:
        lines: contours and the ends of cylinders and cones, without what lies inside of other solids; hidden ones too.
            Then the curves in which solids meet. Gradients flow to the quadrics and the camera.
        kinds: "contour", "crease" or "intersection" for each stroke.
    """

    def __init__(self, solids: Quadrics, cameras: Cameras, view: int) -> None:
        """Finds the lines.

        Args:
            solids: the quadrics.
            cameras: the views.
            view: which of them.
        """
        # Whatever draws them, these are few numbers.
        solids, cameras = solids.to("cpu"), cameras.to("cpu")
        self._solids, self._cameras, self._picture = solids, cameras[view], Picture.of(cameras, view)
        orthographic = self._picture.orthographic
        eye = -self._picture.forward if orthographic else self._picture.center
        self._forms = Forms.of(solids, np.append(eye, 0.0 if orthographic else 1.0))
        found = conics(solids, cameras, view)
        whole = found.following.cpu().numpy() >= 0
        # Rings are in a row.
        counts = [ARCS if ring else 1 for ring in _firsts(whole)]
        sketch = Sketch(found.points, found.weights, chains=Chains.of(counts, [n > 1 for n in counts]))
        solid, kind = found.solid.cpu().numpy(), found.kind.cpu().numpy()
        self._conics, stroke = self._outside(sketch, solid[:, None])
        first = np.cumsum([0, *counts])[:-1]
        self.kinds = tuple(KINDS[k] for k in kind[first[stroke]])
        made = (self._conics.chains or Chains.plain(len(self._conics))).stroke.numpy()
        self._own, self._kind = solid[first[stroke]][made], kind[first[stroke]][made]
        self._meets = self._meeting_lines()
        self.kinds += ("intersection",) * len(self._meets)
        self.lines = Sketch.concatenate([self._conics, self._meets]) if len(self._meets) else self._conics

    def _meeting_lines(self) -> Sketch:
        """Curves in which solids meet, fitted in the picture."""
        least, most = self._boxes
        pairs = np.argwhere(np.triu(((least[:, None] <= most) & (most[:, None] >= least)).all(2), 1))
        taper, axes = (v.detach().double().numpy() for v in (self._solids.taper, self._solids.axes))
        found = meeting_chains(self._forms, taper, axes, pairs)
        chains = [chain for chain in found if _in_front(chain[0], self._picture)]
        rows = [np.append(points, points[:1], 0) if closed else points for points, closed, _ in chains]
        first = np.cumsum([0, *(len(row) for row in rows)])
        nothing = np.zeros(0, np.int64)
        points = np.concatenate([np.zeros((0, 3)), *rows])
        fitted = fit_chains(points, first, nothing, self._picture, MEETING)
        control = torch.from_numpy(fitted.control)
        weights = control[..., 3]
        made = Chains.of(np.bincount(fitted.chain, minlength=len(chains)).tolist(), [closed for _, closed, _ in chains])
        both = np.array([pair for _, _, pair in chains], np.int64).reshape(-1, 2)[fitted.chain]
        moved = control[..., :3] / weights[..., None] + self._motion(fitted.control, both)
        if len(moved):
            moved = made.joined(moved)
        lines, stroke = self._outside(Sketch(moved, weights / weights[:, :1], chains=made), both)
        first = made.first.numpy()[:-1]
        of = (lines.chains or Chains.plain(len(lines))).stroke.numpy()
        self._both = both[first[stroke]][of]
        return lines

    def _motion(self, control: Float[Array, "S 4 4"], both: Int[Index, "S 2"]) -> Float[Tensor, "S 4 3"]:
        """What moves control points with the solids: nothing, with the derivatives of four points of each curve.

        A point on both surfaces moves across them as they do; along the curve it may slide, which changes no picture.
        """
        basis = bernstein(np.linspace(0, 1, 4), 3) * control[:, None, :, 3]
        basis /= basis.sum(2, keepdims=True)
        points = basis @ (control[..., :3] / control[..., 3:])
        x = np.concatenate([points, np.ones_like(points[..., :1])], -1).reshape(-1, 4)
        forms, local = self._solids.forms(), self._solids.to_local()
        changes, slopes = [], []
        for side in np.repeat(both, 4, axis=0).T:
            bound, slope = bounds(self._forms, side, x)
            of, place = torch.from_numpy(side), torch.from_numpy(x)
            curved = (place * (forms[of] * place[:, None]).sum(-1)).sum(-1)
            sign = torch.from_numpy(np.where(bound == 1, -1.0, 1.0))
            flat = sign * (local[of, 2] * place).sum(-1) - 1
            value = torch.where(torch.from_numpy(bound == 0), curved, flat)
            changes.append(value - value.detach())
            slopes.append(slope)
        slope = np.stack(slopes, 1)
        gram = slope @ slope.transpose(0, 2, 1)
        back = slope.transpose(0, 2, 1) @ np.linalg.pinv(gram)
        step = -(torch.from_numpy(back) * torch.stack(changes, 1)[:, None]).sum(-1).reshape(-1, 4, 3)
        return torch.from_numpy(np.linalg.inv(basis)) @ step

    def _outside(self, sketch: Sketch, own: Int[Index, "S O"]) -> tuple[Sketch, Index]:
        """The parts of strokes that lie in no solid but those on which they are, and of which stroke each is."""
        control = _control(sketch)
        row, other = self._near(sketch, own)
        forms = [self._forms.inside[other], *(_squared(self._forms.ends[other, k]) for k in (0, 1))]
        found = [bernstein_roots(quadratic_form(control[row], form)) for form in forms]
        pair = np.concatenate([f[0] for f in found])
        t = np.concatenate([f[1] for f in found])
        which = np.repeat(np.arange(3), [len(f[0]) for f in found])
        count = len(control)
        everywhere = np.arange(count)
        places = np.concatenate([np.zeros(count), t, np.ones(count)])
        segments = np.concatenate([everywhere, row[pair], everywhere])
        label = np.concatenate([np.full(count, -1), np.arange(len(t)), np.full(count, -1)])
        order = np.lexsort((places, segments))
        places, segments, label = places[order], segments[order], label[order]
        real = (segments[1:] == segments[:-1]) & (places[1:] > places[:-1])
        segment, start, stop = segments[:-1][real], places[:-1][real], places[1:][real]
        middle = _points(control, segment, (start + stop) / 2)
        part, solid = _pairs_of(segment, row, other, count)
        buried = np.zeros(len(segment), bool)
        buried[part[self._forms.holds(middle[part], solid, ROUNDING)]] = True
        kept = np.flatnonzero(~buried)
        cuts = self._differentiable(sketch, row[pair], other[pair], which, t)
        joined = torch.cat([torch.tensor([0.0, 1.0], dtype=torch.float64), cuts])
        ends = torch.stack(
            [
                joined[torch.from_numpy(np.where(label[side][real][kept] < 0, fixed, label[side][real][kept] + 2))]
                for side, fixed in ((slice(None, -1), 0), (slice(1, None), 1))
            ],
            1,
        )
        return cut_sketch(sketch, segment[kept], start[kept], stop[kept], ends)

    def _differentiable(self, sketch: Sketch, segment: Index, solid: Index, which: Index, t: Array) -> Tensor:
        """Roots with gradients: one step of Newton's method changes nothing, and has the derivative of the root."""
        if not len(t):
            return torch.zeros(0, dtype=torch.float64)
        rows, of = torch.from_numpy(segment), torch.from_numpy(solid)
        weights = sketch.weights[rows]
        control = torch.cat([sketch.points[rows] * weights[..., None], weights[..., None]], -1)
        at_t = torch.from_numpy(t)
        point, speed, _ = (value[:, 0] for value in homogeneous_derivatives(control, at_t[:, None]))
        form = self._solids.forms()[of]
        local = self._solids.to_local()[of]
        sign = torch.where(torch.from_numpy(which) == 1, -1.0, 1.0)[:, None]
        end = sign * local[:, 2] - local[:, 3]
        curved = torch.from_numpy(which == 0)
        value = torch.where(curved, (point * (form * point[:, None]).sum(-1)).sum(-1), (end * point).sum(-1))
        change = torch.where(curved, 2 * (speed * (form * point[:, None]).sum(-1)).sum(-1), (end * speed).sum(-1))
        change = change.detach()
        step = torch.where(change == 0, 0.0, (value - value.detach()) / torch.where(change == 0, 1.0, change))
        return at_t - step

    def line_parts(self) -> Parts:
        """Which parts of the lines are seen."""
        control = _control(self._conics)
        row, other = self._near_in_picture(self._conics)
        apart = other != self._own[row]
        row, other = row[apart], other[apart]
        cuts = [self._sight_cuts(control, row, other)]
        rims = np.flatnonzero(self._kind > 0)
        # At the end of a cylinder its own side turns away where a contour begins.
        cuts.append(_roots_of_lines(control, rims, self._forms.polar[self._own[rims]]))
        facing = np.einsum("nka,a->nk", self._forms.ends, self._forms.eye) > 0

        def hidden(segment: Int[Index, " Q"], t: Float[Array, " Q"]) -> Bool[Mask, " Q"]:
            points = _points(control, segment, t)
            own, kind = self._own[segment], self._kind[segment]
            turned = np.einsum("qa,qa->q", points, self._forms.polar[own]) < 0
            behind = (kind > 0) & turned & ~facing[own, np.maximum(kind - 1, 0)]
            part, solid = _pairs_of(segment, row, other, len(control))
            behind[part[self._forms.hide(points[part], solid, ROUNDING)]] = True
            return behind

        conics = self._decided(self._conics, cuts, hidden)

        def exact(segment: Int[Index, " Q"], points: Float[Array, "Q 4"]) -> Float[Array, "Q 4"]:
            one, other = self._both[segment].T
            return np.column_stack([onto_both(self._forms, one, other, points[:, :3]), points[:, 3]])

        meets = self._parts(self._meets, 10 * ROUNDING, exact)
        return Parts.concatenate(conics, meets, len(self._conics.points))

    def hatching(self, hatch: Hatch) -> Sketch:
        """What is seen of lines or dots that make the solids as dark as is asked."""
        if hatch.stipple:
            return dot_strokes(self._mesh, self._cameras, hatch, MeshView(self._mesh, self._picture).hides)
        strokes, _ = hatch_strokes(hatch_chains(self._mesh, self._cameras, hatch), self._picture)
        return self.parts(strokes).seen_of(strokes)

    @property
    def _mesh(self) -> TriangleMesh:
        """The solids as triangles, which they keep."""
        kept = self._solids.__dict__.get("_mesh")
        if kept is None:
            taper = self._solids.taper.detach().double().numpy()
            solids = [triangles_of(self._forms, taper, solid) for solid in range(len(self._solids))]
            first = np.cumsum([0, *(len(points) for points, _ in solids)])
            faces = np.concatenate([faces + start for (_, faces), start in zip(solids, first, strict=False)])
            kept = TriangleMesh(np.concatenate([points[:, :3] for points, _ in solids]), faces)
            self._solids.__dict__["_mesh"] = kept
        return cast(TriangleMesh, kept)

    def parts(self, sketch: Sketch) -> Parts:
        """Which parts of a sketch's segments are seen."""
        return self._parts(sketch, ON_SURFACE, lambda segment, points: points)

    def _parts(self, sketch: Sketch, depth: float, placed: Callable[[Index, Array], Array]) -> Parts:
        """The same, for strokes that are at `placed` points, and hidden by what lies so deep."""
        control = _control(sketch)
        row, other = self._near_in_picture(sketch)
        cuts = [self._sight_cuts(control, row, other), _roots_of_lines(control, row, self._forms.polar[other])]
        pair, t = bernstein_roots(quadratic_form(control[row], self._forms.inside[other]))
        cuts.append((row[pair], t))
        cuts += [_roots_of_lines(control, row, self._forms.ends[other, k]) for k in (0, 1)]

        def hidden(segment: Int[Index, " Q"], t: Float[Array, " Q"]) -> Bool[Mask, " Q"]:
            points = placed(segment, _points(control, segment, t))
            part, solid = _pairs_of(segment, row, other, len(control))
            behind = np.zeros(len(segment), bool)
            behind[part[self._forms.hide(points[part], solid, depth)]] = True
            return behind

        return self._decided(sketch, cuts, hidden)

    def _decided(self, sketch: Sketch, cuts: list[tuple[Index, Array]], hidden: Ask) -> Parts:
        cubics = project(sketch.detach(), self._cameras).cubics[0].detach().cpu().numpy()
        segment, t = (np.concatenate(column) for column in zip(*cuts, strict=True))
        return parts_of(chords_of(cubics, self._picture), (segment, t), hidden, STRAY)

    def _sight_cuts(self, control: Array, row: Index, other: Index) -> tuple[Index, Array]:
        """Where pictures of segments cross those of contours and ends."""
        forms = [self._forms.cone[other], self._forms.rims[other, 0], self._forms.rims[other, 1]]
        found = [bernstein_roots(quadratic_form(control[row], form)) for form in forms]
        return np.concatenate([row[pair] for pair, _ in found]), np.concatenate([t for _, t in found])

    def _near(self, sketch: Sketch, own: Int[Index, "S O"]) -> tuple[Index, Index]:
        """Segments and other solids whose boxes meet."""
        points = sketch.points.detach().numpy()
        low, high = points.min(1), points.max(1)
        least, most = self._boxes
        meet = ((low[:, None] <= most) & (high[:, None] >= least)).all(2)
        meet[np.arange(len(own))[:, None], own] = False
        row, other = np.nonzero(meet)
        return row, other

    @cached_property
    def _boxes(self) -> tuple[Array, Array]:
        """Boxes around the solids."""
        center, axes = (v.detach().double().cpu().numpy() for v in (self._solids.center, self._solids.axes))
        wide = np.maximum(1, self._solids.taper.detach().double().cpu().numpy())[:, None]
        ball = np.linalg.norm(axes, axis=2)
        rod = wide * np.hypot(axes[:, :, 0], axes[:, :, 1]) + np.abs(axes[:, :, 2])
        reach = np.where(self._forms.is_round[:, None], ball, rod)
        return center - reach, center + reach

    def _near_in_picture(self, sketch: Sketch) -> tuple[Index, Index]:
        """Segments and solids whose boxes meet in the picture, or come behind the near plane."""
        low, high = _picture_boxes(sketch.points.detach().double().cpu().numpy(), self._picture)
        least, most = self._boxes
        pick = np.array([[k >> axis & 1 for axis in range(3)] for k in range(8)], bool)
        solid_low, solid_high = _picture_boxes(np.where(pick, most[:, None], least[:, None]), self._picture)
        row, other = np.nonzero(((low[:, None] <= solid_high) & (high[:, None] >= solid_low)).all(2))
        return row, other


def _in_front(points: Float[Array, "M 3"], picture: Picture) -> bool:
    """Whether a chain is one, and lies in front of the near plane."""
    return len(points) > 2 and bool((picture.seen(points)[1] > picture.near).all())


def _firsts(whole: Bool[Mask, " C"]) -> list[bool]:
    """Of strokes in a row whether each is a ring."""
    flags = whole.tolist()
    strokes, k = [], 0
    while k < len(flags):
        strokes.append(flags[k])
        k += ARCS if flags[k] else 1
    return strokes


def _control(sketch: Sketch) -> Float[Array, "S K 4"]:
    points, weights = sketch.points.detach().double(), sketch.weights.detach().double()
    return torch.cat([points * weights[..., None], weights[..., None]], -1).cpu().numpy()


def _points(control: Float[Array, "S K 4"], segment: Int[Index, " Q"], t: Float[Array, " Q"]) -> Float[Array, "Q 4"]:
    """Homogeneous points of weight 1."""
    own, s = control[segment], 1 - t
    while own.shape[1] > 1:
        own = own[:, :-1] * s[:, None, None] + own[:, 1:] * t[:, None, None]
    return own[:, 0] / own[:, 0, 3:]


def _squared(form: Float[Array, "P 4"]) -> Float[Array, "P 4 4"]:
    """A linear form as a quadratic one that has its sign on points of weight 1."""
    last = np.array([0.0, 0, 0, 1])
    return (form[:, :, None] * last + last[:, None] * form[:, None, :]) / 2


def _roots_of_lines(
    control: Float[Array, "S K 4"], row: Int[Index, " P"], form: Float[Array, "P 4"]
) -> tuple[Int[Index, " R"], Float[Array, " R"]]:
    pair, t = bernstein_roots(np.einsum("pka,pa->pk", control[row], form))
    return row[pair], t


def _pairs_of(
    segment: Int[Index, " Q"], row: Int[Index, " P"], other: Int[Index, " P"], count: int
) -> tuple[Int[Index, " X"], Int[Index, " X"]]:
    """Pairs of a query about a segment and a solid near it, from pairs of both; rows rise."""
    first = np.searchsorted(row, np.arange(count + 1))
    numbers = (first[1:] - first[:-1])[segment]
    query = np.repeat(np.arange(len(segment)), numbers)
    place = np.arange(len(query)) - np.repeat(np.cumsum(numbers) - numbers, numbers) + first[segment][query]
    return query, other[place]


def _picture_boxes(points: Float[Array, "N K 3"], picture: Picture) -> tuple[Float[Array, "N 2"], Float[Array, "N 2"]]:
    """Boxes in the picture around hulls of points; everything where some are not in front of the camera."""
    pixels, depths = picture.seen(points)
    behind = (depths <= picture.near).any(1, keepdims=True)
    return np.where(behind, -np.inf, pixels.min(1)), np.where(behind, np.inf, pixels.max(1))
