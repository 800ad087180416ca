"""Points on outlines: the boundary term of Monte Carlo gradients (docs/explanation/mathematics.md, eq. 11, 12)."""

import math
from typing import NamedTuple

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.bezier.curves import bernstein, homogeneous_derivatives
from diff3ds.bezier.measure import _Intervals, chord_intervals
from diff3ds.project import Strokes2D
from diff3ds.render.hits import half_width_at, span_controls
from diff3ds.render.near_plane import Spans

# px between chords and curve; the chords only decide where points are spent.
CHORD_TOLERANCE = 0.02
# Chords turn by less than this (radians) unless they are shorter than that (px): these stand for a jump of the tangent.
MAX_TURN, MIN_LENGTH = 0.3, 1e-6
# A joint that turns by less (radians) is smooth but for rounding: both sides go on across it.
JOINT_TURN = 1e-3
# Longer parts (px) get no more points: they lie off the image, most of them.
MAX_LENGTH = 1e5
# Of chords: then the parameter has no digits left.
MAX_HALVINGS = 32


class Outline(NamedTuple):
    """Points on outlines: view, segment and parameter, position (it moves with the stroke), normal times length."""

    view: Int[Tensor, " P"]
    segment: Int[Tensor, " P"]
    t: Float[Tensor, " P"]
    position: Float[Tensor, "P 2"]
    normal: Float[Tensor, "P 2"]

    def on_image(self, size: tuple[int, int]) -> "Outline":
        """The points that lie on the image."""
        x, y = self.position.detach().unbind(-1)
        inside = (x >= 0) & (y >= 0) & (x < size[1]) & (y < size[0])
        return Outline(*(column[inside] for column in self))

    def place(self, size: tuple[int, int]) -> Int[Tensor, " P"]:
        """Index of the pixel that each point lies in, among those of all views."""
        x, y = self.position.detach().long().unbind(-1)
        return (self.view * size[0] + y) * size[1] + x


class _Strokes(NamedTuple):
    """Strokes with their visible spans and the homogeneous control points of these, where pixels are square."""

    strokes: Strokes2D
    spans: Spans
    control: Float[Tensor, "S 4 4"]

    def half_width(self, span: Tensor, u: Tensor, value: Float[Tensor, "P 4"]) -> Float[Tensor, " P"]:
        """At parameters u of spans, whose homogeneous points these are."""
        view, segment = self.spans.view[span], self.spans.segment[span]
        return half_width_at(self.strokes, view, segment, self.parameter(span, u), self.strokes.depth(value))

    def half_width_slope(self, span: Tensor, u: Tensor) -> Float[Tensor, " P"]:
        """Derivative with respect to u of `Strokes2D.half_width`, where it varies along strokes."""
        view, segment = self.spans.view[span], self.spans.segment[span]
        row = view if len(self.strokes.half_width) > 1 else torch.zeros_like(view)
        control = self.strokes.half_width[row, segment].double()
        slope = 3 * (bernstein(self.parameter(span, u), 2) * control.diff(dim=-1)).sum(-1)
        return slope * (self.spans.stop[span] - self.spans.start[span])

    def parameter(self, span: Tensor, u: Tensor) -> Float[Tensor, " P"]:
        """Of the segment, at parameters u of spans."""
        start, stop = self.spans.start[span], self.spans.stop[span]
        return start + u * (stop - start)

    def neighbours(self) -> tuple[Int[Tensor, " S"], Int[Tensor, " S"]]:
        """The span that each goes on from at a joint, and the one that goes on from it; -1 where there is none."""
        view, segment, start, stop = self.spans
        none = torch.full_like(segment, -1)
        chains = self.strokes.chains
        if chains is None:
            return none, none
        segments = len(chains.stroke)
        rows = torch.arange(len(segment), device=segment.device)

        def at(touches: Tensor, neighbour: Tensor, mine: Tensor) -> Tensor:
            table = torch.full((segments * len(self.strokes.cubics),), -1, device=rows.device)
            table[(view * segments + segment)[touches]] = rows[touches]
            found = table[view * segments + neighbour.clamp_min(0)]
            return torch.where((neighbour >= 0) & mine, found, none)

        before = at(stop == 1, chains.before[segment], start == 0)
        after = at(start == 0, chains.after[segment], stop == 1)
        return before, after

    def outline(self, span: Tensor, u: Tensor, position: Tensor, normal: Tensor) -> Outline:
        """Of points at parameters u of spans, with normals, where pixels are square."""
        if self.strokes.square is not None:
            square = self.strokes.square[self.spans.view[span]]
            position = torch.linalg.solve(square, position)
            area = torch.linalg.det(square.detach())[:, None]
            normal = (normal[:, None] @ square.detach())[:, 0] / area
        return Outline(self.spans.view[span], self.spans.segment[span], self.parameter(span, u), position, normal)


def sample_outline(strokes: Strokes2D, spans: Spans, density: int, seed: int) -> Outline:
    """`density` points a pixel of length on both sides of all strokes, around their ends and where the normal jumps."""
    s = _Strokes(strokes, spans, strokes.on_square(spans.view, span_controls(strokes, spans)))
    generator = torch.Generator(device=s.control.device).manual_seed(seed)
    with torch.no_grad():
        chords = _chords(s.control[..., :3])
        before, after, length = _tangents(chords.control(s.control[..., :3]))
        turn = _turn(before, after)
        jump = turn.abs() > MAX_TURN
        first = torch.ones_like(jump)
        first[1:] = chords.curve[1:] != chords.curve[:-1]
        last = torch.cat([first[1:], first.new_ones(1)])[: len(first)]
        earlier, later = s.neighbours()
        joined, joins = earlier[chords.curve] >= 0, later[chords.curve] >= 0
        # The chord in front of each: that of its span, or at a joint the last one of the span before it.
        end = torch.zeros_like(earlier).index_copy(0, chords.curve[last], last.nonzero()[:, 0])
        front = torch.arange(len(first), device=first.device) - 1
        front = torch.where(first, end[earlier[chords.curve].clamp_min(0)] if len(end) else front, front)
        joint = _turn(after[front], before)
        turns = torch.where(first, joined & (joint.abs() > JOINT_TURN), joint.abs() > MAX_TURN)
        value, *_ = homogeneous_derivatives(s.control[chords.curve], chords.start[:, None])
        # Around the outside of a bend the outline is longer than the chord.
        measure = torch.where(jump, 0.0, length + turn.abs() * s.half_width(chords.curve, chords.start, value[:, 0]))
        rows, fraction, part = _spread(measure, density, generator)
        width = (chords.stop - chords.start)[rows]
        half_turn = torch.full_like(length, math.pi)
    sides = [
        _side(s, chords.curve[rows], chords.start[rows] + fraction * width, part * width, sign) for sign in (1, -1)
    ]
    arcs = (
        (first & ~joined, chords.start, -before, half_turn),
        (last & ~joins, chords.stop, after, half_turn),
        (jump, (chords.start + chords.stop) / 2, before, turn),
        (turns, chords.start, after[front], joint),
    )
    around = [_arc(s, chords.curve[k], u[k], side[k], angle[k], density, generator) for k, u, side, angle in arcs]
    return Outline(*(torch.cat(column) for column in zip(*sides, *around, strict=True)))


def _chords(control: Float[Tensor, "S 4 3"]) -> _Intervals:
    """Chords that turn by less than MAX_TURN, or are shorter than MIN_LENGTH."""
    open_ = chord_intervals(control, CHORD_TOLERANCE)
    done: list[_Intervals] = []
    for _ in range(MAX_HALVINGS):
        before, after, length = _tangents(open_.control(control))
        good = (_turn(before, after).abs() <= MAX_TURN) | (length < MIN_LENGTH)
        done.append(open_.where(good))
        open_ = open_.where(~good).halves()
    return open_.join(done)


def _turn(before: Float[Tensor, "I 2"], after: Float[Tensor, "I 2"]) -> Float[Tensor, " I"]:
    """Angle from one direction to the other, within half a turn."""
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return torch.atan2(cross, (before * after).sum(-1))


def _tangents(control: Float[Tensor, "I 4 3"]) -> tuple[Tensor, Tensor, Tensor]:
    """Unit tangents at both ends of short curves, and the length of their chords."""
    points = control[..., :2] / control[..., 2:]
    length = torch.linalg.vector_norm(points[:, 3] - points[:, 0], dim=-1)

    def leaving(points: Tensor) -> Tensor:
        # The first control point that differs: the curve leaves towards it.
        steps = points[:, 1:] - points[:, :1]
        lengths = torch.linalg.vector_norm(steps, dim=-1)
        which = (lengths > 1e-9 * (1 + length)[:, None]).int().argmax(1)
        step = steps[torch.arange(len(steps)), which]
        return torch.nn.functional.normalize(step, dim=-1)

    return leaving(points), -leaving(points.flip(1)), length


def _spread(length: Float[Tensor, " I"], density: int, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Stratified points on intervals of these lengths: interval, place in [0, 1), and the fraction each stands for."""
    counts = (length.clamp(max=MAX_LENGTH) * density).ceil().long()
    rows = torch.repeat_interleave(torch.arange(len(counts), device=counts.device), counts)
    rank = torch.arange(len(rows), device=rows.device) - (counts.cumsum(0) - counts)[rows]
    jitter = torch.rand(len(rows), generator=generator, dtype=torch.float64, device=rows.device)
    return rows, (rank + jitter) / counts[rows], 1 / counts[rows].double()


def _side(s: _Strokes, span: Tensor, u: Tensor, du: Tensor, sign: int) -> Outline:
    """Points p + r n at parameters u of spans, each standing for du of the parameter."""
    value, first, second = (x[:, 0] for x in homogeneous_derivatives(s.control[span], u[:, None]))
    z, dz = value[:, 2:3], first[:, 2:3]
    p = value[:, :2] / z
    velocity = (first[:, :2] - p * dz) / z
    acceleration = (second[:, :2] - 2 * velocity * dz - p * second[:, 2:3]) / z
    speed = torch.linalg.vector_norm(velocity, dim=-1, keepdim=True)
    tangent = velocity / speed.clamp_min(1e-300)
    normal = sign * torch.stack([-tangent[:, 1], tangent[:, 0]], -1)
    r = s.half_width(span, u, value)[:, None]
    with torch.no_grad():
        # q' = along tangent + slope normal; across it, outwards, the outline's normal times its length (eq. 12).
        along = speed - r * (normal * acceleration).sum(-1, keepdim=True) / speed.clamp_min(1e-300)
        slope = torch.zeros_like(r)
        if s.strokes.width_space == "world":
            depth = z / value[:, 3:]
            slope = -r * (dz - depth * first[:, 3:]) / (value[:, 3:] * depth)
        if s.strokes.half_width.ndim == 3:
            change = s.half_width_slope(span, u)[:, None]
            slope = slope + (change / (z / value[:, 3:]) if s.strokes.width_space == "world" else change)
        # On the inside of bends tighter than r there is no outline.
        outward = torch.where(along > 0, along * normal - slope * tangent, 0.0) * du[:, None]
    return s.outline(span, u, p + r * normal, outward)


def _arc(
    s: _Strokes, span: Tensor, u: Tensor, before: Tensor, turn: Tensor, density: int, generator: torch.Generator
) -> Outline:
    """Points of circles of radius r around points of spans: the outside of a turn from the directions `before` on."""
    value, *_ = homogeneous_derivatives(s.control[span], u[:, None])
    r = s.half_width(span, u, value[:, 0])
    rows, fraction, part = _spread(r.detach() * turn.abs(), density, generator)
    start = torch.atan2(before[:, 1], before[:, 0]) - torch.where(turn > 0, math.pi / 2, -math.pi / 2)
    angle = start[rows] + fraction * turn[rows]
    outward = torch.stack([angle.cos(), angle.sin()], -1)
    position = (value[:, 0, :2] / value[:, 0, 2:3])[rows] + r[rows, None] * outward
    return s.outline(span[rows], u[rows], position, outward * (r.detach() * turn.abs())[rows, None] * part[:, None])
