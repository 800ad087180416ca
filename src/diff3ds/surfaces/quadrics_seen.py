"""What one camera sees of a union of quadrics and of strokes around it: its lines, and which parts are hidden."""

from functools import cached_property

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.project import project
from diff3ds.sketch import Sketch
from diff3ds.surfaces.arrays import Index, Mask
from diff3ds.surfaces.bernstein_roots import bernstein_roots, quadratic_form
from diff3ds.surfaces.crossings import chords_of
from diff3ds.surfaces.cut_sketch import cut_sketch
from diff3ds.surfaces.mesh_view import Picture
from diff3ds.surfaces.quadric_forms import Forms
from diff3ds.surfaces.quadrics import ARCS, Quadrics, conics
from diff3ds.surfaces.visibility import Ask, Parts, parts_of

# What lies so deep in a solid, as a share of its radius, is inside: rounding; and strokes that lie on it, which float32
# and fits leave a little inside.
ROUNDING, ON_SURFACE = 1e-7, 2e-3
# Of the points that a part is asked about, so large a share is noise: parts are cut where anything changes.
STRAY = 0.3
KINDS = ("contour", "crease", "crease")


class QuadricsSeen:
    """Quadrics in one view.

    Attributes:
        lines: contours and the ends of cylinders and cones, without what lies inside of other solids; hidden ones too.
            Gradients flow to the quadrics and the camera.
        kinds: "contour" or "crease" for each stroke.
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
        segment, ends = self._outside(sketch, solid)
        start, stop = ends.detach().numpy().T
        self.lines, stroke = cut_sketch(sketch, segment, start, stop, ends)
        first = np.cumsum([0, *counts])[:-1]
        self.kinds = tuple(KINDS[k] for k in kind[first[stroke]])
        made = (self.lines.chains or Chains.plain(len(self.lines))).stroke.numpy()
        self._own, self._kind = solid[first[stroke]][made], kind[first[stroke]][made]

    def _outside(self, sketch: Sketch, own: Int[Index, " S"]) -> tuple[Index, Tensor]:
        """The parts of segments that lie in no other solid: their segments, and their ends with gradients."""
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
        return segment[kept], ends

    def _differentiable(self, sketch: Sketch, segment: Index, solid: Index, which: Index, t: Array) -> Tensor:
        """Roots with gradients: one step of Newton's method changes nothing, and has the derivative of the root."""
        if not len(t):
            return torch.zeros(0, dtype=torch.float64)
        rows, of = torch.from_numpy(segment), torch.from_numpy(solid)
        weights = sketch.weights[rows]
        control = torch.cat([sketch.points[rows] * weights[..., None], weights[..., None]], -1)
        at_t = torch.from_numpy(t)
        basis = torch.stack([(1 - at_t) ** 2, 2 * at_t * (1 - at_t), at_t**2], 1)
        slope = torch.stack([-2 * (1 - at_t), 2 - 4 * at_t, 2 * at_t], 1)
        point, speed = (basis[..., None] * control).sum(1), (slope[..., None] * control).sum(1)
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
        control = _control(self.lines)
        row, other = self._near_in_picture(self.lines)
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

        return self._decided(self.lines, cuts, hidden)

    def parts(self, sketch: Sketch) -> Parts:
        """Which parts of a sketch's segments are seen."""
        control = _control(sketch)
        row, other = self._near_in_picture(sketch)
        cuts = [self._sight_cuts(control, row, other), _roots_of_lines(control, row, self._forms.polar[other])]
        pair, t = bernstein_roots(quadratic_form(control[row], self._forms.inside[other]))
        cuts.append((row[pair], t))
        cuts += [_roots_of_lines(control, row, self._forms.ends[other, k]) for k in (0, 1)]

        def hidden(segment: Int[Index, " Q"], t: Float[Array, " Q"]) -> Bool[Mask, " Q"]:
            points = _points(control, segment, t)
            part, solid = _pairs_of(segment, row, other, len(control))
            behind = np.zeros(len(segment), bool)
            behind[part[self._forms.hide(points[part], solid, ON_SURFACE)]] = True
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

    def _near(self, sketch: Sketch, own: Int[Index, " S"]) -> tuple[Index, Index]:
        """Segments and other solids whose boxes meet."""
        points = sketch.points.detach().numpy()
        low, high = points.min(1), points.max(1)
        least, most = self._boxes
        meet = ((low[:, None] <= most) & (high[:, None] >= least)).all(2)
        meet[np.arange(len(own)), own] = False
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
