"""Bends a sketch as a whole towards the lines of a drawing, as its camera sees both.

The bend is a smooth map of space: a polynomial displacement of few coefficients, held small. Strokes that met still
meet, and what was straight stays straight; on both sides of the middle it does the same if the thing has two like
sides. Lines that the drawing lacks, such as hidden ones, go along. Each round matches every point of the drawing with
the nearest point of a stroke of its direction and solves for all coefficients at once (iterated closest points with a
polynomial map; Amberg, Romdhani and Vetter 2007 do the same with affine maps).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from numpy.polynomial.legendre import legvander

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras
from diff3ds.recognition.side_seen import PlacedLines, heading
from diff3ds.sketch import Sketch

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Of the displacement in each coordinate, with Legendre polynomials. Empirical, as all that follows.
DEGREE = 4
# Rounds, and how far from a stroke, as a fraction of the image height, a line may lie to pull at it, at first and last.
ROUNDS, FAR, NEAR = 30, 0.12, 0.03
# How much the points of strokes ask for lines of the drawing; those of the drawing ask for strokes with 1. A drawing
# lacks hidden lines.
BACKWARD = 0.3
# Against the bend: of constant, linear, quadratic, ... terms, and the factor of all at first and last.
STIFFNESS, STIFF, LOOSE = (1e-3, 1e-3, 5e-3, 3e-2, 1e-1), 3.0, 0.3
# Points on a stroke, evenly spaced in its parameter.
SAMPLES = 33
# Strokes whose control points lie this near to a line, as a fraction of their length, are straight.
STRAIGHT = 1e-3


def bend_to(sketch: Sketch, lines: PlacedLines, mirrored: bool) -> "Bend":
    """Finds how a sketch is bent towards lines.

    Args:
        sketch: in the unit ball, in front of the lines' camera.
        lines: of the drawing.
        mirrored: whether the bend is the same on both sides of the plane y = 0.
    """
    from scipy.spatial import cKDTree

    t = torch.linspace(0, 1, SAMPLES, dtype=torch.float64)
    places = evaluate(sketch.points.detach().double(), sketch.weights.detach().double(), t)
    terms = _terms(mirrored)
    basis = _basis(places.flatten(0, 1), terms)
    # Each term moves one coordinate, by this much.
    coordinate, amount = torch.tensor([t.coordinate for t in terms]), basis.sum(1)
    stiffness = torch.tensor([STIFFNESS[sum(t.powers)] for t in terms], dtype=torch.float64)
    drawn, along = torch.from_numpy(lines.points), _unit(torch.from_numpy(lines.lines.tangents).double())
    normals = torch.stack([-along[:, 1], along[:, 0]], 1)
    drawing = cKDTree(torch.cat([drawn, heading(along)], 1).numpy())
    bend = torch.zeros(len(terms), dtype=torch.float64)
    for share in np.linspace(0, 1, ROUNDS):
        reach, hold = FAR * (NEAR / FAR) ** share, STIFF * (LOOSE / STIFF) ** share
        seen, slope = seen_by(places.flatten(0, 1) + basis @ bend, lines.camera)
        pairs = _matches(seen.reshape(*places.shape[:2], 2), drawing)
        # Each match asks the point of a stroke to lie on the line through the drawing's, along its direction.
        gap, normal = drawn[pairs.drawn] - seen[pairs.stroke], normals[pairs.drawn]
        across = (normal[:, None] @ slope[pairs.stroke])[:, 0]
        pull = across[:, coordinate] * amount[pairs.stroke]
        wanted = (gap * normal).sum(1) + pull @ bend
        # Far matches are no matches (Geman and McClure's weights).
        weight = pairs.weight / (1 + gap.square().sum(1) / reach**2) ** 2
        weighed = pull.T * weight
        bend = torch.linalg.solve(weighed @ pull + torch.diag(hold * stiffness), weighed @ wanted)
    return Bend(tuple(terms), bend)


class _Term(NamedTuple):
    """A term of the displacement: of one coordinate, a product of Legendre polynomials of these degrees in x, y, z."""

    coordinate: int
    powers: tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Bend:
    """A smooth map of space: a displacement by a sum of terms.

    Attributes:
        terms: of the sum.
        amounts: of each term.
    """

    terms: tuple[_Term, ...]
    amounts: Float[Tensor, " T"]

    def places(self, points: Float[Tensor, "*N 3"]) -> Float[Tensor, "*N 3"]:
        """Points where the bend brings them, in float64."""
        points = points.detach().double()
        return points + (_basis(points.reshape(-1, 3), self.terms) @ self.amounts).reshape(points.shape)

    def sketch(self, sketch: Sketch) -> Sketch:
        """The sketch with its control points displaced; straight strokes stay straight."""
        points = sketch.points.detach().double()
        moved = self.places(points)
        chord = points[:, -1:] - points[:, :1]
        length = torch.linalg.vector_norm(chord, dim=-1).clamp(min=1e-12)
        along = ((points - points[:, :1]) * chord).sum(-1) / length.square()
        aside = torch.linalg.vector_norm(points - points[:, :1] - along[..., None] * chord, dim=-1).amax(1)
        level = moved[:, :1] + along[..., None] * (moved[:, -1:] - moved[:, :1])
        straight = (aside < STRAIGHT * length[:, 0])[:, None, None]
        return replace(sketch, points=torch.where(straight, level, moved).to(sketch.points))


class _Matches(NamedTuple):
    """Points of strokes and of the drawing that lie by each other, by their indices, and what each pair counts."""

    stroke: Int[Tensor, " M"]
    drawn: Int[Tensor, " M"]
    weight: Float[Tensor, " M"]


def _terms(mirrored: bool) -> list[_Term]:
    """All terms; those that a reflection in y leaves as they are, if the bend is mirrored."""
    degrees = range(DEGREE + 1)
    powers = [(a, b, c) for a, b, c in product(degrees, degrees, degrees) if a + b + c <= DEGREE]
    return [_Term(c, p) for c in range(3) for p in powers if not mirrored or p[1] % 2 == (1 if c == 1 else 0)]


def _basis(places: Float[Tensor, "P 3"], terms: Sequence[_Term]) -> Float[Tensor, "P 3 T"]:
    """What each term moves points by."""
    values = torch.from_numpy(legvander(places.numpy(), DEGREE))
    basis = places.new_zeros(len(places), 3, len(terms))
    for i, (coordinate, (a, b, c)) in enumerate(terms):
        basis[:, coordinate, i] = values[:, 0, a] * values[:, 1, b] * values[:, 2, c]
    return basis


def seen_by(places: Float[Tensor, "P 3"], camera: Cameras) -> tuple[Float[Tensor, "P 2"], Float[Tensor, "P 2 3"]]:
    """Where one camera sees points, as fractions of the image height, and how that changes as they move."""
    matrix = camera.projection[0]
    seen = places @ matrix[:3, :3].T + matrix[:3, 3]
    pixels = seen[:, :2] / seen[:, 2:]
    slope = (matrix[None, :2, :3] - pixels[..., None] * matrix[None, 2:3, :3]) / seen[:, 2:, None]
    return pixels / camera.size[0], slope / camera.size[0]


def _matches(seen: Float[Tensor, "C S 2"], drawing: "cKDTree") -> _Matches:
    """The nearest point of a stroke for each of the drawing, and the other way round, among those of like direction."""
    from scipy.spatial import cKDTree

    tangents = _unit(torch.gradient(seen, dim=1)[0]).flatten(0, 1)
    strokes = torch.cat([seen.flatten(0, 1), heading(tangents)], 1).numpy()
    of_drawing, of_strokes = cKDTree(strokes).query(drawing.data)[1], drawing.query(strokes)[1]
    weights = [1 / drawing.n, BACKWARD / len(strokes)]
    return _Matches(
        torch.from_numpy(np.concatenate([of_drawing, np.arange(len(strokes))])),
        torch.from_numpy(np.concatenate([np.arange(drawing.n), of_strokes])),
        torch.tensor(weights, dtype=torch.float64).repeat_interleave(torch.tensor([drawing.n, len(strokes)])),
    )


def _unit(vectors: Float[Tensor, "*N 2"]) -> Float[Tensor, "*N 2"]:
    return torch.nn.functional.normalize(vectors, dim=-1)
