"""Strokes as one camera sees them: lines on the page, sampled on the exact projected curve, with their arc length."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Int, Tensor
from diff3ds.bezier.curves import bernstein, subcurve_matrix
from diff3ds.page.depth_order import painting_order
from diff3ds.page.screen_pieces import Pieces, screen_pieces
from diff3ds.project import Strokes2D
from diff3ds.render.hits import half_width_at

# px. Beyond the page, more than ink may reach: for the thinnest lines of a technical pen, and dots that are no wider.
MARGIN = 8.0
# px. Cubic pieces that stay so near to the curve have mild parameters; the samples lie on the curve itself.
PIECE_TOLERANCE = 0.05
# Chords between samples turn by less (radians) and keep so near to the curve (px); a cubic with the tangents of their
# ends, which stands for the curve between them, is then off by less than 1e-3 px.
MAX_TURN, CHORD_TOLERANCE = 0.2, 0.25
# px. What is shorter has no direction of its own: it is a corner, as cusps are.
SHORTEST = 1e-3
# Of chords: then the parameter has no digits left.
MAX_HALVINGS = 40
# A joint that turns by less (radians) is smooth but for rounding.
JOINT_TURN = 1e-3
# Around a corner the normal turns in steps of less (radians).
CORNER_STEP = 0.3


@dataclass(frozen=True, eq=False)
class Line:
    """A part of a stroke that the page shows, as n samples along it.

    At a corner samples stand on one point and turn from one direction to the other, by the shorter way.

    Attributes:
        stroke: its number in the sketch.
        points: pixels from the top-left corner of the view.
        angle: of the direction, radians from x towards y, without jumps.
        half_width: of the sketch's stroke across the line, pixels.
        depth: from the camera, world units.
        along: arc length from the first sample, pixels.
        closed: whether the last sample is the first one again.
        begins: whether the first sample is where the stroke begins, and not where the page or the camera cuts it.
        ends: the same of the last sample.
    """

    stroke: int
    points: Float[Array, "n 2"]
    angle: Float[Array, " n"]
    half_width: Float[Array, " n"]
    depth: Float[Array, " n"]
    along: Float[Array, " n"]
    closed: bool = False
    begins: bool = True
    ends: bool = True

    @property
    def length(self) -> float:
        """Pixels."""
        return float(self.along[-1])

    @property
    def normals(self) -> Float[Array, "n 2"]:
        """Unit vectors, a quarter turn from the direction, from x towards y."""
        return np.stack([-np.sin(self.angle), np.cos(self.angle)], -1)

    def refined(self, step: float) -> "Line":
        """The same line with samples at most `step` pixels apart."""
        return self.at(_between(self.along, step))

    def part(self, start: float, stop: float) -> "Line":
        """An open part by arc length."""
        inner = self.along[(self.along > start) & (self.along < stop)]
        part = self.at(np.concatenate([[start], inner, [stop]]))
        begins = self.begins and not self.closed and start <= 0
        ends = self.ends and not self.closed and stop >= self.length
        return replace(part, along=part.along - start, closed=False, begins=begins, ends=ends)

    def at(self, along: Float[Array, " m"]) -> "Line":
        """Samples at these arc lengths; where one is a corner of this line, all samples of it."""
        if self.length <= 0 or len(self.points) < 2:
            return self
        wanted = np.unique(along)
        own = np.flatnonzero(np.isin(self.along, wanted))
        new = wanted[~np.isin(wanted, self.along)]
        value = np.concatenate([self.along[own], new])
        order = value.argsort(kind="stable")
        row = np.concatenate([own, np.full(len(new), -1)])[order]
        value = value[order]
        k = np.searchsorted(self.along, value, "right").clip(1, len(self.along) - 1) - 1
        return self._interpolated(row, k, value)

    def _interpolated(self, row: Int[Array, " m"], k: Int[Array, " m"], value: Float[Array, " m"]) -> "Line":
        """Samples of rows of this line, or where these are -1 within the interval after k."""
        span = (self.along[k + 1] - self.along[k]).clip(1e-300)
        u = ((value - self.along[k]) / span)[:, None]
        directions = np.stack([np.cos(self.angle), np.sin(self.angle)], -1)
        start, stop, d0, d1 = self.points[k], self.points[k + 1], directions[k], directions[k + 1]
        chord = np.linalg.norm(stop - start, axis=1, keepdims=True)
        a, b = start + d0 * chord / 3, stop - d1 * chord / 3
        points = (1 - u) ** 3 * start + 3 * u * (1 - u) ** 2 * a + 3 * u**2 * (1 - u) * b + u**3 * stop
        own = row >= 0

        def mixed(values: Array) -> Array:
            between = values[k] + u[:, 0] * (values[k + 1] - values[k])
            return np.where(own, values[row], between)

        return replace(
            self,
            points=np.where(own[:, None], self.points[row], points),
            angle=mixed(self.angle),
            half_width=mixed(self.half_width),
            depth=mixed(self.depth),
            along=value,
        )


class _Chords(NamedTuple):
    """C chords of pieces: place (segment plus parameter) of both ends, points, and directions of the curve there."""

    piece: Tensor
    start: Tensor
    stop: Tensor
    first: Float[Tensor, "C 2"]
    last: Float[Tensor, "C 2"]
    leaving: Float[Tensor, "C 2"]
    arriving: Float[Tensor, "C 2"]


@torch.no_grad()
def lines_of(strokes: Strokes2D, view: int, size: tuple[int, int], widest: float) -> list[Line]:
    """The lines of one view: strokes in the order in which they are painted, far ones first, none of them cut.

    Args:
        size: of the page, (height, width) in pixels.
        widest: how many times as wide as the stroke ink may reach; what lies farther beyond the page is left out.
    """
    strokes = _alone(strokes, view)
    width = widest * _largest(strokes)[None]
    pieces = screen_pieces(replace(strokes, half_width=MARGIN + width, width_space="image"), 0, size, PIECE_TOLERANCE)
    chords = _chords(strokes, pieces)
    lines, both = [], torch.tensor([0, 1])
    for stroke in _order(strokes, pieces, width[0]):
        runs = list(_runs(pieces, list(range(*torch.searchsorted(pieces.stroke, both + stroke).tolist()))))
        lines += [_line(strokes, stroke, chords, rows, *ends) for rows, *ends in _joined(strokes, pieces, stroke, runs)]
    return lines


def _order(strokes: Strokes2D, pieces: Pieces, width: Float[Tensor, " N"]) -> list[int]:
    """Strokes in the order in which they are painted, where they have these half widths."""
    points = torch.cat([pieces.points[..., :2], width[pieces.stroke, None, None].expand(-1, 4, 1)], -1)
    # Translucent strokes are not cut.
    whole = replace(strokes, opacity=torch.full_like(strokes.opacity, 0.5))
    order = painting_order(whole, 0, pieces._replace(points=points))
    # A stroke in several parts is one here, in the place of the first.
    return list(dict.fromkeys(int(part.pieces.stroke[0]) for part in order))


def _alone(strokes: Strokes2D, view: int) -> Strokes2D:
    """The strokes in one view."""
    row = min(view, len(strokes.half_width) - 1)
    strokes = strokes.detach()
    square = None if strokes.square is None else strokes.square[view, None]
    cubics, half_width = strokes.cubics[view, None].double(), strokes.half_width[row, None].double()
    return replace(strokes, cubics=cubics, half_width=half_width, square=square)


def _largest(strokes: Strokes2D) -> Float[Tensor, " N"]:
    """A bound of the half widths of each stroke where it is seen, pixels."""
    width = strokes.half_width[0]
    rows = strokes.stroke_of(torch.arange(len(strokes.cubics[0])))
    each = width[rows] if width.ndim == 1 else width.amax(1)
    if strokes.width_space == "world":
        depth = strokes.depth(strokes.cubics[0]).amin(1)
        each = each / depth.clamp_min(strokes.near)
    largest = torch.zeros(len(strokes.color), dtype=torch.float64)
    return largest.scatter_reduce(0, rows, each, "amax")


def _runs(pieces: Pieces, rows: list[int]) -> Iterator[list[int]]:
    """Rows of pieces that follow on each other."""
    run: list[int] = []
    for row in rows:
        if run and pieces.start[row] != pieces.stop[run[-1]]:
            yield run
            run = []
        run.append(row)
    if run:
        yield run


def _joined(
    strokes: Strokes2D, pieces: Pieces, stroke: int, runs: list[list[int]]
) -> Iterator[tuple[list[int], bool, bool, bool]]:
    """Runs with whether they are closed, begin and end; of closed strokes those on both sides of the joint as one."""
    chains = strokes.chains
    first, last = (stroke, stroke + 1) if chains is None else chains.first[stroke : stroke + 2].tolist()
    begins = float(pieces.start[runs[0][0]]) == first
    ends = float(pieces.stop[runs[-1][-1]]) == last
    if chains is not None and bool(chains.closed[stroke]) and begins and ends:
        if len(runs) == 1:
            yield runs[0], True, True, True
            return
        runs, begins, ends = [*runs[1:-1], runs[-1] + runs[0]], False, False
    for k, run in enumerate(runs):
        yield run, False, begins and k == 0, ends and k == len(runs) - 1


def _chords(strokes: Strokes2D, pieces: Pieces) -> _Chords:
    """Chords of pieces that turn little, in order along them."""
    segment = pieces.start.floor().long()
    control = strokes.cubics[0, segment][..., :3]
    piece, start, stop = torch.arange(len(segment)), pieces.start - segment, pieces.stop - segment
    done: list[_Chords] = []
    for halving in range(MAX_HALVINGS):
        part = subcurve_matrix(start, stop, 3) @ control[piece]
        points = part[..., :2] / part[..., 2:]
        leaving, arriving = _leaving(points), -_leaving(points.flip(1))
        chord = points[:, 3] - points[:, 0]
        length = torch.linalg.vector_norm(chord, dim=-1, keepdim=True)
        off = (points[..., 0] - points[:, :1, 0]) * chord[:, 1:] - (points[..., 1] - points[:, :1, 1]) * chord[:, :1]
        off = (off / length.clamp_min(1e-300)).abs().amax(1)
        cosine = torch.minimum((leaving * arriving).sum(-1), (leaving * chord).sum(-1) / length[:, 0].clamp_min(1e-300))
        cosine = torch.minimum(cosine, (arriving * chord).sum(-1) / length[:, 0].clamp_min(1e-300))
        good = (cosine > math.cos(MAX_TURN)) & (off <= CHORD_TOLERANCE)
        small = torch.linalg.vector_norm(points - points[:, :1], dim=-1).amax(1) < SHORTEST
        good |= small if halving < MAX_HALVINGS - 1 else True
        chords = _Chords(
            piece, segment[piece] + start, segment[piece] + stop, points[:, 0], points[:, 3], leaving, arriving
        )
        done.append(_Chords(*(column[good] for column in chords)))
        middle, rest = (start + stop) / 2, ~good
        piece = piece[rest].repeat(2)
        start, stop = torch.cat([start[rest], middle[rest]]), torch.cat([middle[rest], stop[rest]])
        if len(piece) == 0:
            break
    chords = _Chords(*(torch.cat(column) for column in zip(*done, strict=True)))
    order = chords.start.argsort(stable=True)
    order = order[chords.piece[order].argsort(stable=True)]
    return _Chords(*(column[order] for column in chords))


def _leaving(points: Float[Tensor, "C 4 2"]) -> Float[Tensor, "C 2"]:
    """The direction in which curves leave their first points: towards the next control point that differs."""
    steps = points[:, 1:] - points[:, :1]
    lengths = torch.linalg.vector_norm(steps, dim=-1)
    which = (lengths > 1e-6 * lengths.amax(1, keepdim=True)).int().argmax(1)
    return torch.nn.functional.normalize(steps[torch.arange(len(steps)), which], dim=-1)


def _line(
    strokes: Strokes2D, stroke: int, chords: _Chords, rows: list[int], closed: bool, begins: bool, ends: bool
) -> Line:
    """The samples of pieces that follow on each other."""
    bounds = torch.searchsorted(chords.piece, torch.tensor([[row, row + 1] for row in rows]))
    inside = torch.cat([torch.arange(*pair) for pair in bounds.tolist()])
    some = _Chords(*(column[inside] for column in chords))
    length = torch.linalg.vector_norm(some.last - some.first, dim=-1)
    moving = length > SHORTEST
    if not bool(moving.any()):
        return _dot(strokes, stroke, some)
    some = _Chords(*(column[moving] for column in some))
    places, points, angle = _around_corners(some, closed)
    t = torch.from_numpy(places)
    segment = t.floor().long().clamp(max=len(strokes.cubics[0]) - 1)
    half_width, depth = _measures(strokes, segment, t - segment)
    half_width = half_width * _across(strokes, angle)
    steps = _arc_steps(points, angle)
    along = np.concatenate([[0.0], steps.cumsum()])
    return Line(stroke, points, angle, half_width, depth, along, closed, begins, ends)


def _dot(strokes: Strokes2D, stroke: int, chords: _Chords) -> Line:
    """A stroke that stands on one point of the page: one sample."""
    segment = chords.start[:1].floor().long()
    half_width, depth = _measures(strokes, segment, chords.start[:1] - segment)
    zero = np.zeros(1)
    # Round, though pixels be oblong: in the mean of two directions.
    half_width = half_width * _across(strokes, np.array([0.0, math.pi / 2])).prod(keepdims=True) ** 0.5
    return Line(stroke, chords.first[:1].numpy(), zero, half_width, depth, zero)


def _measures(strokes: Strokes2D, segment: Tensor, t: Tensor) -> tuple[Array, Array]:
    """Half widths, where pixels are square, and depths at parameters of segments."""
    value = (bernstein(t, 3)[:, None] @ strokes.cubics[0, segment])[:, 0]
    depth = strokes.depth(value)
    half_width = half_width_at(strokes, torch.zeros_like(segment), segment, t, depth)
    return half_width.numpy(), depth.numpy()


def _across(strokes: Strokes2D, angle: Float[Array, " n"]) -> Float[Array, " n"]:
    """Pixels of a unit of half width across lines of these directions."""
    if strokes.square is None:
        return np.ones(len(angle))
    normals = np.stack([-np.sin(angle), np.cos(angle)])
    lengths: Array = np.linalg.norm(np.linalg.solve(strokes.square[0].numpy().T, normals), axis=0)
    return lengths


def _around_corners(chords: _Chords, closed: bool) -> tuple[Array, Array, Array]:
    """Places, points and angles of samples: the ends of chords, and at corners turns from one chord to the next."""
    first, last = chords.first.numpy(), chords.last.numpy()
    out = np.arctan2(*chords.leaving.numpy().T[::-1])
    into = np.arctan2(*chords.arriving.numpy().T[::-1])
    within = _turn(out, into)
    joint = _turn(into, np.roll(out, -1))
    # Places just before the end of a chord, so that a parameter of 1 stays in its segment.
    start, stop = chords.start.numpy(), np.nextafter(chords.stop.numpy(), -np.inf)
    places, points, angles = [start[:1]], [first[:1]], [out[:1]]
    angle = float(out[0])
    count = len(first)
    for k in range(count):
        angle += within[k]
        turn = joint[k] if k < count - 1 or closed else 0.0
        steps = math.ceil(abs(turn) / CORNER_STEP) if abs(turn) > JOINT_TURN else 0
        places.append(np.full(steps + 1, stop[k]))
        points.append(np.repeat(last[k : k + 1], steps + 1, 0))
        angles.append(angle + turn * np.arange(steps + 1) / max(steps, 1))
        angle += turn
    return np.concatenate(places), np.concatenate(points), np.concatenate(angles)


def _turn(before: Array, after: Array) -> Array:
    """Angles from one direction to the other, by the shorter way."""
    return (after - before + math.pi) % (2 * math.pi) - math.pi


def _arc_steps(points: Array, angle: Array) -> Array:
    """Lengths between samples, as of circular arcs, which differ from the curve by less than 1e-4 of it."""
    chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
    half = np.abs(np.diff(angle)) / 2
    return np.where(chord > 0, chord * np.where(half > 1e-4, half / np.sin(half.clip(1e-9, 1.5)), 1.0), 0.0)


def _between(along: Array, step: float) -> Array:
    """Arc lengths of samples, with more between those that are farther apart than a step."""
    unique = np.unique(along)
    if len(unique) < 2:
        return along
    counts = np.ceil(np.diff(unique) / step).astype(int).clip(1)
    rows = np.repeat(np.arange(len(counts)), counts)
    rank = np.arange(len(rows)) - np.repeat(counts.cumsum() - counts, counts)
    inner = unique[rows] + np.diff(unique)[rows] * rank / counts[rows]
    return np.concatenate([inner, unique[-1:]])
