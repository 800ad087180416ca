"""Curves that keep what they were recognised as: lines stay straight, arcs exact, shared end points shared."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.curves.shapes.primitives import Circle, Kind, Primitive, circle_of

# [units; numerical] Lengths are at least so small where something is divided by them.
TINY = 1e-9
# [points; numerical] Sample points of a curve where nothing else is said.
SAMPLES = 64
# How far apart the inner points of an elliptic arc are, see `Curves.constrained`, at sweeps of 20 and of 220 degrees:
# at 0 it is a parabola, and at 240 the inner weights vanish.
FLATTEST, ROUNDEST = (1 / (1 + 2 * math.cos(math.radians(sweep) / 2)) for sweep in (20, 220))


@dataclass(frozen=True, eq=False)
class Curves:
    """N curves; any control points become such curves by `constrained`; `smooth_joints.sketch_of` is the way out.

    Attributes:
        points: control points of cubics; those of arcs of circles and ellipses are rational, their weights follow from
            the points. Of a closed curve they are those of one half: the other half is its reflection.
        kind: values of `Kind`.
        vertex: the shared vertices at start and end; equal numbers mean one point of space. A closed curve shares
            none: it has two numbers of its own, for the ends of its half.
    """

    points: Float[Tensor, "N 4 3"]
    kind: Int[Tensor, " N"]
    vertex: Int[Tensor, "N 2"]

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, index: Tensor) -> "Curves":
        """Some of the curves, by mask or indices."""
        return Curves(self.points[index], self.kind[index], self.vertex[index])

    @property
    def closed(self) -> Bool[Tensor, " N"]:
        """Which curves are whole circles and ellipses."""
        return (self.kind == Kind.CIRCLE) | (self.kind == Kind.ELLIPSE)

    @property
    def owner(self) -> Int[Tensor, " S"]:
        """The curve that each of the `segments` draws."""
        return torch.arange(len(self)).repeat_interleave(1 + self.closed.long())

    @property
    def circles(self) -> dict[int, Circle]:
        """The whole circles, by their numbers."""
        rows = torch.nonzero(self.kind == Kind.CIRCLE)[:, 0].tolist()
        control = self.constrained(self.points)[0].double().numpy() if rows else np.zeros((0, 4, 3))
        return {row: circle_of(control[row]) for row in rows}

    def moved(self, points: Float[Tensor, "N 4 3"]) -> "Curves":
        """Curves of the same kinds nearest to these control points."""
        return replace(self, points=self.constrained(points)[0])

    def segments(self, points: Float[Tensor, "N 4 3"]) -> tuple[Float[Tensor, "S 4 3"], Float[Tensor, "S 4"]]:
        """Control points and weights of the rational cubics that draw curves of these kinds: closed ones in two halves.

        In the order of the curves, halves side by side (`owner`); differentiable, from any control points.
        """
        points, weights = self.constrained(points)
        owner = self.owner
        second = torch.zeros(len(owner), dtype=torch.bool)
        second[1:] = owner[1:] == owner[:-1]
        halves, weights = points[owner], weights[owner]
        opposite = halves[:, :1] + halves[:, 3:] - halves
        return torch.where(second[:, None, None], opposite, halves), weights

    def at(self, t: Float[Tensor, " T"]) -> Float[Tensor, "N T 3"]:
        """Points along the curves; closed ones go all around as t goes from 0 to 1."""
        points, weights = self.constrained(self.points)
        found = evaluate(points, weights, t)
        closed = self.closed
        if bool(closed.any()):
            second = t > 0.5
            half = evaluate(points[closed], weights[closed], torch.where(second, 2 * t - 1, 2 * t))
            twice_center = points[closed, :1] + points[closed, 3:]
            found = found.index_put((closed,), torch.where(second[:, None], twice_center - half, half))
        return found

    def constrained(self, points: Float[Tensor, "N 4 3"]) -> tuple[Float[Tensor, "N 4 3"], Float[Tensor, "N 4"]]:
        """Control points and weights of these kinds from any control points; differentiable, leaves its results alone.

        Shared vertices are the means of the curves' ends, lines keep their ends, arcs their ends and how far they
        bulge; those of ellipses also in which direction, and their weight. Closed curves keep the ends of their half.
        """
        start, stop = self._ends(points)
        middle, chord = (start + stop) / 2, stop - start
        inner = points[:, 1:3]
        line = torch.stack([start + chord / 3, start + 2 / 3 * chord], 1)
        along = (chord * chord).sum(1, keepdim=True).clamp(min=TINY)
        half = along.sqrt() / 2
        free = inner.mean(1) - middle
        kind, closed = self.kind[:, None], self.closed[:, None]
        bulge = free - (free * chord).sum(1, keepdim=True) / along * chord
        # The half of a circle bulges by twice the half chord (see `_half_sweep`).
        bulge = torch.where(closed, 2 * half * torch.nn.functional.normalize(bulge, dim=1), bulge)
        # 1 + 2 w for weights 1, w, 1 as a conic. The inner points (P0 + 2 w P1) / (1 + 2 w) and
        # (2 w P1 + P2) / (1 + 2 w) are 1 / (1 + 2 w) of the chord from each other; with w < 1 any bulge makes an
        # ellipse. The half of a closed curve has w = 0.
        apart = ((inner[:, 1] - inner[:, 0]) * chord).sum(1, keepdim=True) / along
        oval = (kind == Kind.ELLIPTIC_ARC) | (kind == Kind.ELLIPSE)
        weight = torch.where(oval, 1 / apart.clamp(FLATTEST, ROUNDEST), 1 + 2 * _half_sweep(bulge, half).cos())
        weight = torch.where(closed, 1.0, weight)
        bulge = torch.where(oval, free, bulge)
        arc = torch.stack([middle + bulge - chord / (2 * weight), middle + bulge + chord / (2 * weight)], 1)
        conic = (kind == Kind.ARC) | (kind == Kind.CIRCLE) | oval
        inner = torch.where(kind[:, None] == Kind.LINE, line, torch.where(conic[:, None], arc, inner))
        one = torch.ones_like(weight)
        middle_weight = torch.where(conic, weight / 3, one)
        weights = torch.cat([one, middle_weight, middle_weight, one], 1)
        return torch.cat([start[:, None], inner, stop[:, None]], 1), weights

    def _ends(self, points: Float[Tensor, "N 4 3"]) -> tuple[Float[Tensor, "N 3"], Float[Tensor, "N 3"]]:
        ends = points[:, [0, 3]].reshape(-1, 3)
        vertex = self.vertex.reshape(-1)
        count = int(vertex.max()) + 1 if len(vertex) else 0
        total = points.new_zeros(count, 3).index_add(0, vertex, ends)
        members = points.new_zeros(count).index_add(0, vertex, points.new_ones(len(vertex)))
        shared = (total / members.clamp(min=1)[:, None])[vertex].reshape(-1, 2, 3)
        return shared[:, 0], shared[:, 1]


def _half_sweep(bulge: Float[Tensor, "N 3"], half: Float[Tensor, "N 1"]) -> Float[Tensor, "N 1"]:
    """Half the sweep θ of an arc whose mean inner control point lies this far from the middle of its chord.

    With the inner points of `primitives.arc_control`, bulge / half chord = k = 2 sin θ / (1 + 2 cos θ), so that
    2 sin θ - 2 k cos θ = k and θ = atan k + asin(k / (2 sqrt(1 + k²))).
    """
    k = (bulge.square().sum(1, keepdim=True) + TINY**2).sqrt() / half
    return k.atan() + (k / (2 * (1 + k * k).sqrt())).asin()


def curves_of(primitives: Sequence[Primitive]) -> Curves:
    """Curves without shared vertices."""
    count = len(primitives)
    points = torch.tensor([p.control.tolist() for p in primitives], dtype=torch.float32).reshape(count, 4, 3)
    kind = torch.tensor([int(p.kind) for p in primitives], dtype=torch.int64)
    return Curves(points, kind, torch.arange(2 * count).reshape(count, 2))


def concatenated(first: Curves, second: Curves) -> Curves:
    """Both sets of curves."""
    shift = int(first.vertex.max()) + 1 if len(first) else 0
    return Curves(
        torch.cat([first.points, second.points]),
        torch.cat([first.kind, second.kind]),
        torch.cat([first.vertex, second.vertex + shift]),
    )


def sampled(curves: Curves, count: int = SAMPLES) -> Float[Array, "N S 3"]:
    """Points along every curve at even parameters, the ends included."""
    return curves.at(torch.linspace(0, 1, count)).double().numpy()
