"""Curves that keep what they were recognised as: lines stay straight, arcs exact, shared end points shared."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.edges.shapes.primitives import Kind, Primitive
from diff3ds.sketch import Sketch

TINY = 1e-9
# How far apart the inner points of an elliptic arc are, see `Curves._elliptic`, at sweeps of 20 and of 220 degrees: at
# 0 it is a parabola, and at 240 the inner weights vanish.
FLATTEST, ROUNDEST = (1 / (1 + 2 * math.cos(math.radians(sweep) / 2)) for sweep in (20, 220))


@dataclass(frozen=True, eq=False)
class Curves:
    """N curves; any control points become such curves by `constrained`.

    Attributes:
        points: control points of cubics; those of arcs of circles and ellipses are rational, their weights follow from
            the points.
        kind: values of `Kind`.
        vertex: the shared vertices at start and end; equal numbers mean one point of space.
        other: the arc that completes a full circle or ellipse with this one, or -1.
    """

    points: Float[Tensor, "N 4 3"]
    kind: Int[Tensor, " N"]
    vertex: Int[Tensor, "N 2"]
    other: Int[Tensor, " N"]

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, index: Tensor) -> "Curves":
        """Some of the curves, by mask or increasing indices; a circle without its other half becomes an arc."""
        rows = index.nonzero()[:, 0] if index.dtype == torch.bool else index
        place = torch.full((len(self) + 1,), -1)
        place[rows] = torch.arange(len(rows))
        return Curves(self.points[rows], self.kind[rows], self.vertex[rows], place[self.other[rows]])

    def moved(self, points: Float[Tensor, "N 4 3"]) -> "Curves":
        """Curves of the same kinds nearest to these control points."""
        return replace(self, points=self.constrained(points)[0])

    def sketch(self, width: float) -> Sketch:
        """The curves as black strokes."""
        points, weights = self.constrained(self.points)
        return Sketch(points, weights, width=width)

    def at(self, t: Float[Tensor, " S"]) -> Float[Tensor, "N S 3"]:
        """Points along the curves."""
        return evaluate(*self.constrained(self.points), t)

    def constrained(self, points: Float[Tensor, "N 4 3"]) -> tuple[Float[Tensor, "N 4 3"], Float[Tensor, "N 4"]]:
        """Control points and weights of these kinds from any control points; differentiable, leaves its results alone.

        Shared vertices are the means of the curves' ends, lines keep their ends, arcs their ends and how far they
        bulge; those of ellipses also in which direction, and their weight.
        """
        start, stop = self._ends(points)
        middle, chord = (start + stop) / 2, stop - start
        inner = points[:, 1:3]
        line = torch.stack([start + chord / 3, start + 2 / 3 * chord], 1)
        along = (chord * chord).sum(1, keepdim=True).clamp(min=TINY)
        half = along.sqrt() / 2
        free = inner.mean(1) - middle
        bulge = self._circular(free - (free * chord).sum(1, keepdim=True) / along * chord, half)
        share = 1 + 2 * _half_sweep(bulge, half).cos()
        elliptic = self._elliptic(free, ((inner[:, 1] - inner[:, 0]) * chord).sum(1, keepdim=True) / along)
        kind = self.kind[:, None]
        bulge, share = (torch.where(kind == Kind.ELLIPSE, e, c) for e, c in zip(elliptic, (bulge, share), strict=True))
        arc = torch.stack([middle + bulge - chord / (2 * share), middle + bulge + chord / (2 * share)], 1)
        conic = (kind == Kind.ARC) | (kind == Kind.ELLIPSE)
        inner = torch.where(kind[:, None] == Kind.LINE, line, torch.where(conic[:, None], arc, inner))
        one = torch.ones_like(share)
        middle_weight = torch.where(conic, share / 3, one)
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

    def _circular(self, bulge: Float[Tensor, "N 3"], half: Float[Tensor, "N 1"]) -> Float[Tensor, "N 3"]:
        """Bulges of half circles where two arcs make a circle: opposite, twice the half chord (see `_half_sweep`)."""
        paired = self.other >= 0
        if not bool(paired.any()):
            return bulge
        outward = bulge - bulge[self.other.clamp(min=0)]
        outward = 2 * half * torch.nn.functional.normalize(outward, dim=1)
        return torch.where(paired[:, None], outward, bulge)

    def _elliptic(
        self, bulge: Float[Tensor, "N 3"], apart: Float[Tensor, "N 1"]
    ) -> tuple[Float[Tensor, "N 3"], Float[Tensor, "N 1"]]:
        """How elliptic arcs bulge, and their 1 + 2 w for weights 1, w, 1 as a conic.

        The inner points (P0 + 2 w P1) / (1 + 2 w) and (2 w P1 + P2) / (1 + 2 w) are `apart` = 1 / (1 + 2 w) of the
        chord from each other; with w < 1 any bulge makes an ellipse. Its halves have opposite bulges and w = 0.
        """
        paired = (self.other >= 0)[:, None]
        bulge = torch.where(paired, (bulge - bulge[self.other.clamp(min=0)]) / 2, bulge)
        return bulge, torch.where(paired, 1.0, 1 / apart.clamp(FLATTEST, ROUNDEST))


def _half_sweep(bulge: Float[Tensor, "N 3"], half: Float[Tensor, "N 1"]) -> Float[Tensor, "N 1"]:
    """Half the sweep θ of an arc whose mean inner control point lies this far from the middle of its chord.

    With the inner points of `primitives.arc_control`, bulge / half chord = k = 2 sin θ / (1 + 2 cos θ), so that
    2 sin θ - 2 k cos θ = k and θ = atan k + asin(k / (2 sqrt(1 + k²))).
    """
    k = (bulge.square().sum(1, keepdim=True) + TINY**2).sqrt() / half
    return k.atan() + (k / (2 * (1 + k * k).sqrt())).asin()


def curves_of(primitives: list[Primitive], circles: Sequence[list[Primitive]] = ()) -> Curves:
    """Curves without shared vertices, but for the two halves of each circle, which come last."""
    strokes = [*primitives, *(half for circle in circles for half in circle)]
    count = len(strokes)
    points = torch.tensor([p.control.tolist() for p in strokes], dtype=torch.float32).reshape(count, 4, 3)
    kind = torch.tensor([int(p.kind) for p in strokes], dtype=torch.int64)
    vertex = torch.arange(2 * count).reshape(count, 2)
    other = torch.full((count,), -1)
    for first in range(len(primitives), count, 2):
        vertex[first + 1] = vertex[first].flip(0)
        other[first : first + 2] = torch.tensor([first + 1, first])
    return Curves(points, kind, vertex, other)
