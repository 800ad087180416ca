"""Strokes as CAD programs name them: lines, arcs of circles and ellipses, and B-splines for what is none of these.

What stands for a curve lies within a tolerance of it everywhere. By default that is how well the sketch's coordinates
are known, so that kinds depend neither on where a drawing lies nor on how it was turned there (docs/reference/files.md,
"Kinds of curves").
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import evaluate, to_nurbs
from diff3ds.bezier.curves import from_homogeneous, homogeneous
from diff3ds.bezier.pieces import standard_form
from diff3ds.curves.directions import cross
from diff3ds.formats.cad.arcs import Arc, Vector, arc_along
from diff3ds.sketch import Sketch

# How well coordinates are known, relative to the largest of the sketch. float64: a curve goes through fits, turns and
# shifts, of some tens of steps of rounding each (2e-16), and through files of 13 digits and more; in a drawing of 100 m
# it is the 1e-7 mm that kernels such as OCCT take for one place. Others: so many steps of rounding, in which a circle
# of `bezier.circle` stays one. [empirical: 8 are needed]
DOUBLE, STEPS = 1e-12, 64
# What is taken for a curve by itself may be off by so much of its own size: small parts of large drawings keep shape.
# It is what polylines are off (`polylines.TOLERANCE`), of the sketch there.
MOST = 1e-4
# Of a line that is off by more than rounding: an arc is taken in its place if it is so many times nearer. Noise is
# nearer to arcs than to lines by less than 2. [empirical]
NEARER = 8
# Chebyshev's points, on which a polynomial of degree 6 is known between them to 1 / cos(6 pi / 48) = 1.09 of its
# largest value there (Ehlich and Zeller 1964): squared distances of cubics from a circle are such, over weights.
_SAMPLES = (1 - torch.cos(torch.linspace(0, torch.pi, 25, dtype=torch.float64))) / 2
# Along arcs of many segments, so many are enough to tell whether the next one goes on.
_MOST_SAMPLES = 400


class Line(NamedTuple):
    """A straight line from one point to another."""

    start: Vector
    stop: Vector


class Spline(NamedTuple):
    """A rational B-spline with clamped knots, whole numbers of the multiplicity of the degree inside."""

    points: Float[NDArray[np.float64], "P 3"]
    weights: Float[NDArray[np.float64], " P"]
    knots: Float[NDArray[np.float64], " L"]
    degree: int


Curve = Line | Arc | Spline


def resolution(sketch: Sketch) -> float:
    """How well coordinates of a sketch are known, world units."""
    largest = float(sketch.points.detach().abs().max()) if len(sketch) else 0.0
    dtype = sketch.points.dtype
    return largest * (DOUBLE if dtype == torch.float64 else STEPS * torch.finfo(dtype).eps)


def curves_of(sketch: Sketch, tolerance: float | None = None) -> Iterator[list[Curve]]:
    """What each stroke is made of, from its start to its end.

    Arcs of one circle or ellipse that follow on each other are one, and so are segments that are neither lines nor
    arcs. Those of circles begin and end where the stroke's control points are, to float64; of B-splines the control
    points and weights are kept to the last bit, but for the factor of `to_nurbs`. At a joint a segment begins exactly
    where the one before it ends, and so do strokes whose ends lie within the tolerance of each other.

    Args:
        tolerance: how far what stands for a curve may lie off it, world units; by default `resolution`, and at most
            `MOST` of the curve's size.
    """
    sketch = sketch.detach().to("cpu")
    known = resolution(sketch)
    first = range(len(sketch) + 1) if sketch.chains is None else sketch.chains.first.tolist()
    points, weights = _meeting(sketch, known if tolerance is None else tolerance), sketch.weights.double()
    # Relative to where the stroke begins, there is no rounding by its distance from the origin.
    begins = torch.arange(len(sketch)) if sketch.chains is None else sketch.chains.first[sketch.chains.stroke]
    local = points - points[begins, :1]
    control, _ = standard_form(homogeneous(local, weights))
    samples = evaluate(*from_homogeneous(control), _SAMPLES).numpy()
    for stroke in range(len(sketch)):
        rows = slice(first[stroke], first[stroke + 1])
        yield _Stroke(points[rows], weights[rows], local[rows].numpy(), samples[rows], known, tolerance).curves()


class _Stroke(NamedTuple):
    """The segments of a stroke; its control points and samples along it also relative to where it begins."""

    points: Float[Tensor, "M K 3"]
    weights: Float[Tensor, "M K"]
    local: Float[NDArray[np.float64], "M K 3"]
    samples: Float[NDArray[np.float64], "M S 3"]
    known: float
    given: float | None

    def curves(self) -> list[Curve]:
        """Runs of segments, each a curve."""
        found: list[Curve] = []
        rest: list[int] = []
        begin = 0
        for segment in range(len(self.points)):
            curve = self._simple(segment)
            if curve is None:
                rest.append(segment)
                continue
            found += [self._spline(rest)] if rest else []
            joined = self._joined(found[-1], curve, begin, segment) if found and not rest else None
            rest = []
            if joined is not None:
                found[-1] = joined
            else:
                found.append(curve)
                begin = segment
        found += [self._spline(rest)] if rest else []
        origin = self.points[0, 0].numpy()
        return [curve._replace(center=curve.center + origin) if isinstance(curve, Arc) else curve for curve in found]

    def _tolerance(self, points: NDArray[np.float64]) -> float:
        """Of what lies along these points."""
        return min(self.known, MOST * float(np.ptp(points, axis=0).max())) if self.given is None else self.given

    def _arc(self, points: NDArray[np.float64], circular: bool) -> tuple[Arc, float] | None:
        """The circular arc along points, or the elliptic one."""
        far = float(self.points[0, 0].abs().max())
        return arc_along(points, self._tolerance(points), far, circular)

    def _simple(self, segment: int) -> Line | Arc | None:
        """A segment as line or arc, if it is one."""
        points, samples = self.local[segment], self.samples[segment]
        tolerance = self._tolerance(points)
        off = _off_chord(points, tolerance)
        line = Line(*self.points[segment][[0, -1]].numpy()) if off <= tolerance else None
        if len(points) == 2 or off <= min(self.known, tolerance) or _leaves_plane(samples, tolerance):
            return line
        found = self._arc(samples, True)
        if line is not None:
            return found[0] if found and NEARER * found[1] <= off else line
        found = found or self._arc(samples, False)
        return found[0] if found else None

    def _joined(self, last: Curve, curve: Curve, begin: int, segment: int) -> Arc | None:
        """The arc from one segment on and the one after it as one, if they are."""
        if not isinstance(last, Arc) or not isinstance(curve, Arc):
            return None
        along = self.samples[begin : segment + 1].reshape(-1, 3)
        along = along[np.linspace(0, len(along) - 1, min(len(along), _MOST_SAMPLES)).astype(int)]
        found = self._arc(along, True)
        if not found and not (last.circular and curve.circular):
            found = self._arc(along, False)
        return found[0] if found else None

    def _spline(self, segments: list[int]) -> Spline:
        """Segments that follow on each other, as one B-spline, in world coordinates."""
        control, weight, knots = to_nurbs(self.points[segments], self.weights[segments])
        return Spline(control.numpy(), weight.numpy(), knots.numpy(), self.points.shape[1] - 1)


def _leaves_plane(points: NDArray[np.float64], tolerance: float) -> bool:
    """Whether points surely lie in no plane to the tolerance, as those of arcs do: four of them say so of most curves.

    Were they so near to one, ways between them would leave it by twice the tolerance at most, and the volume that three
    of these span would be that much times the areas that two of them do.
    """
    a, b, c = points[8::8] - points[0]
    lengths = [math.sqrt(way @ way) for way in (a, b, c)]
    areas = lengths[0] * lengths[1] + lengths[1] * lengths[2] + lengths[2] * lengths[0]
    return bool(abs(cross(a, b) @ c) > 2 * tolerance * areas)


def _off_chord(points: NDArray[np.float64], tolerance: float) -> float:
    """How far control points lie off the chord; infinite where they turn back along it, or where it is a point."""
    chord = points[-1] - points[0]
    length = float(np.linalg.norm(chord))
    if not length > 0 or not np.isfinite(chord / length).all():
        return np.inf
    along = points @ (chord / length)
    if bool((np.diff(along) < -tolerance).any()):
        return np.inf
    return float(np.linalg.norm(points - points[0] - (along - along[0])[:, None] * (chord / length), axis=1).max())


def _meeting(sketch: Sketch, tolerance: float) -> Float[Tensor, "M K 3"]:
    """Control points, float64; ends of strokes within the tolerance of each other are at one place, the first's."""
    from scipy.spatial import cKDTree

    chains = sketch.chains
    points = sketch.points.double() if chains is None else chains.joined(sketch.points.double())
    first = torch.arange(len(points)) if chains is None else chains.first[:-1]
    last = torch.arange(len(points)) if chains is None else chains.first[1:] - 1
    open_ = torch.ones(len(sketch), dtype=torch.bool) if chains is None else ~chains.closed
    long = (points[last, -1] - points[first, 0]).norm(dim=1) > 2 * tolerance
    # Shorter ones would become points.
    first, last = first[open_ & long], last[open_ & long]
    ends = torch.cat([points[first, 0], points[last, -1]])
    if not len(ends):
        return points
    tree = cKDTree(ends.numpy())
    moved, near = ends.clone(), torch.full((len(ends),), -1)
    for i, others in enumerate(tree.query_ball_point(ends.numpy(), tolerance)):
        if near[i] < 0:
            free = [j for j in others if near[j] < 0]
            near[free], moved[free] = i, ends[i].clone()
    points = points.clone()
    points[first, 0], points[last, -1] = moved[: len(first)], moved[len(first) :]
    return points
