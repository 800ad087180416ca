"""Strokes cut into cubics whose radii are those of the sketch where programs weigh or interpolate them otherwise."""

from collections.abc import Callable
from typing import NamedTuple

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier.curves import bernstein, homogeneous, subcurve_matrix
from diff3ds.bezier.pieces import CUBIC_THROUGH_THIRDS, from_standard, polynomial_cubics, standard_form
from diff3ds.sketch import Sketch

# Of the largest radius of a stroke: by how much the radius of a piece may be off. A quarter of a hundredth.
RADIUS = 2.5e-3
# 2^-48 of a stroke is below the resolution of its parameter.
MAX_HALVINGS = 48
# Steps along a piece that are tried, and of how many the last ones are.
STEPS, MOST_STEPS = (4, 8, 12, 24, 48, 96), 192


class Pieces(NamedTuple):
    """P pieces of strokes, in the order of the segments and along them.

    Attributes:
        segment: index of the segment that each is of.
        control: homogeneous control points of a rational cubic; of a polynomial one all weights are 1.
        radii: at the control points of rational pieces (P, 4), weighted along as these are; at the ends of polynomial
            ones (P, 2), between which they change evenly with the parameter.
    """

    segment: Int[Tensor, " P"]
    control: Float[Tensor, "P 4 4"]
    radii: Float[Tensor, "P R"]

    def steps(self, tolerance: float) -> Int[Tensor, " P"]:
        """In how many chords, even in the parameter, each piece is off by no more than a tolerance."""
        found = torch.full((len(self.segment),), MOST_STEPS)
        for count in reversed(STEPS):
            t = torch.linspace(0, 1, 2 * count + 1, dtype=torch.float64)
            place = bernstein(t, 3) @ self.control
            place = place[..., :3] / place[..., 3:]
            off = (place[:, 1::2] - (place[:, :-1:2] + place[:, 2::2]) / 2).norm(dim=-1).amax(-1)
            found = torch.where(off <= tolerance, count, found)
        return found


def rational_pieces(sketch: Sketch, wide: float) -> Pieces:
    """The exact curves, cut where the radii of a NURBS curve, which have its weights, would not be those of the sketch.

    Args:
        sketch: of cubics, float64, with widths along it.
        wide: world units of a width of 1.
    """
    control, radii, most = _given(sketch, wide)

    def fitted(segment: Tensor, start: Tensor, stop: Tensor) -> tuple[tuple[Tensor, Tensor], Bool[Tensor, " P"]]:
        cut = subcurve_matrix(start, stop, 3)
        part, radius = cut @ control[segment], (cut @ radii[segment, :, None])[..., 0]
        weight = part[..., 3]
        t = torch.arange(7, dtype=weight.dtype) / 6
        along, weights = radius @ bernstein(t, 3).T, weight @ bernstein(t, 3).T
        weighted = (along * weights)[:, ::2] @ CUBIC_THROUGH_THIRDS.T
        given = (weighted / weight).clamp(min=0)
        off = ((given * weight) @ bernstein(t, 3).T / weights - along).abs().amax(-1)
        return (part, given), off <= RADIUS * most[segment]

    return _halved(len(control), fitted)


def polynomial_pieces(sketch: Sketch, wide: float, tolerance: float) -> Pieces:
    """Polynomial cubics within a tolerance (world units) of the curves; the rest is as of `rational_pieces`."""
    control, radii, most = _given(sketch, wide)

    def fitted(segment: Tensor, start: Tensor, stop: Tensor) -> tuple[tuple[Tensor, Tensor], Bool[Tensor, " P"]]:
        cut = subcurve_matrix(start, stop, 3)
        part, hurry = standard_form(cut @ control[segment])
        points, error = polynomial_cubics(part)
        u = torch.linspace(0, 1, 5, dtype=points.dtype)
        along = (bernstein(from_standard(u, hurry[:, None]), 3) @ cut @ radii[segment, :, None])[..., 0]
        off = (along - torch.lerp(along[:, :1], along[:, -1:], u)).abs().amax(-1)
        fits = (error <= tolerance) & (off <= RADIUS * most[segment])
        return (homogeneous(points, torch.ones_like(points[..., 0])), along[:, [0, -1]].clamp(min=0)), fits

    return _halved(len(control), fitted)


def _given(sketch: Sketch, wide: float) -> tuple[Float[Tensor, "M 4 4"], Float[Tensor, "M 4"], Float[Tensor, " M"]]:
    """Homogeneous control points, radii along segments, and the largest radius of each."""
    radii = sketch.width * wide / 2
    return homogeneous(sketch.points, sketch.weights), radii, radii.amax(-1)


def _halved(count: int, fitted: Callable[[Tensor, Tensor, Tensor], tuple[tuple[Tensor, Tensor], Tensor]]) -> Pieces:
    """Segments, halved until all parts fit."""
    segment, start = torch.arange(count), torch.zeros(count, dtype=torch.float64)
    stop, done = start + 1, []
    for _ in range(MAX_HALVINGS):
        columns, fits = fitted(segment, start, stop)
        done.append([column[fits] for column in (segment, segment + start, *columns)])
        segment, start, middle, stop = (c[~fits] for c in (segment, start, (start + stop) / 2, stop))
        segment, start, stop = segment.repeat(2), torch.cat([start, middle]), torch.cat([middle, stop])
        if not len(segment):
            break
    segment, place, control, radii = (torch.cat(column) for column in zip(*done, strict=True))
    order = place.argsort(stable=True)
    return Pieces(segment[order], control[order], radii[order])
