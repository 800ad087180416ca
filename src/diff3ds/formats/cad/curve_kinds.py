"""Strokes as CAD programs name them: lines, arcs of circles and ellipses, and B-splines for what is none of these."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Float
from diff3ds.bezier import to_nurbs
from diff3ds.sketch import Sketch

Vector = Float[NDArray[np.float64], " 3"]

# How far from the curve what stands for it may lie, relative to its size: so many steps of rounding of the sketch's
# dtype, in which a circle of `bezier.circle` stays one. [empirical: 8 are needed]
STEPS = 64


class Line(NamedTuple):
    """A straight line from one point to another."""

    start: Vector
    stop: Vector


class Arc(NamedTuple):
    """center + cos t major + sin t minor for t from start to stop, radians.

    The axes are at right angles; the first is not shorter than the second, and as long but for rounding where the arc
    is circular. It begins in [0, 2 pi), circular ones at 0; a whole circle or ellipse goes from 0 to 2 pi exactly.
    """

    center: Vector
    major: Vector
    minor: Vector
    start: float
    stop: float
    circular: bool = False

    @property
    def whole(self) -> bool:
        """Whether it goes all round."""
        return self.start == 0 and self.stop == 2 * math.pi

    def at(self, t: float) -> Vector:
        """The point of a parameter."""
        return self.center + math.cos(t) * self.major + math.sin(t) * self.minor


class Spline(NamedTuple):
    """A rational B-spline with clamped knots, whole numbers of the multiplicity of the degree inside."""

    points: Float[NDArray[np.float64], "P 3"]
    weights: Float[NDArray[np.float64], " P"]
    knots: Float[NDArray[np.float64], " L"]
    degree: int


Curve = Line | Arc | Spline


def curves_of(sketch: Sketch) -> Iterator[list[Curve]]:
    """What each stroke is made of, from its start to its end.

    Arcs of one circle or ellipse that follow on each other are one, and so are segments that are neither lines nor
    arcs. Arcs are found up to the rounding of the sketch's dtype (`STEPS`), and those of circles begin and end where
    the stroke's control points are, to float64; of B-splines the control points and weights are kept to the last bit,
    but for the factor of `to_nurbs`. At a joint a segment begins exactly where the one before it ends.
    """
    sketch = sketch.detach().to("cpu")
    tolerance = STEPS * torch.finfo(sketch.points.dtype).eps
    points, weights = sketch.points.double(), sketch.weights.double()
    points = points if sketch.chains is None else sketch.chains.joined(points)
    first = range(len(sketch) + 1) if sketch.chains is None else sketch.chains.first.tolist()
    for stroke in range(len(sketch)):
        found: list[Curve] = []
        rest: list[int] = []
        for segment in range(first[stroke], first[stroke + 1]):
            curve = _simple(points[segment].numpy(), weights[segment].numpy(), tolerance)
            if curve is None:
                rest.append(segment)
                continue
            found += [_spline(points, weights, rest)] if rest else []
            rest = []
            last = found[-1] if found else None
            if isinstance(last, Arc) and isinstance(curve, Arc) and _continues(last, curve, tolerance):
                found[-1] = _joined(last, curve, tolerance)
            else:
                found.append(curve)
        yield found + ([_spline(points, weights, rest)] if rest else [])


def _spline(points: torch.Tensor, weights: torch.Tensor, segments: list[int]) -> Spline:
    """Segments that follow on each other, as one B-spline."""
    control, weight, knots = to_nurbs(points[segments], weights[segments])
    return Spline(control.numpy(), weight.numpy(), knots.numpy(), points.shape[1] - 1)


def _simple(points: NDArray[np.float64], weights: NDArray[np.float64], tolerance: float) -> Line | Arc | None:
    """A segment as line or arc, if it is one."""
    chord = points[-1] - points[0]
    size = float(np.ptp(points, axis=0).max())
    length = float(np.linalg.norm(chord))
    if length > tolerance * size:
        along = (points - points[0]) @ (chord / length)
        off = points - points[0] - along[:, None] * (chord / length)
        # With its control points in order along the chord, the curve does not turn back.
        if float(np.abs(off).max()) <= tolerance * size and bool((np.diff(along) >= 0).all()):
            return Line(points[0], points[-1])
    if len(points) == 2 or size == 0:
        return None
    origin = points[0]
    control = np.concatenate([(points - origin) * weights[:, None], weights[:, None]], 1)
    if len(points) == 4:
        middle = (3 * control[1] - control[0]) / 2
        if float(np.abs((control[3] + 2 * middle) / 3 - control[2]).max()) > tolerance * float(np.abs(control).max()):
            return None
        control = np.stack([control[0], middle, control[3]])
    arc = _conic(control)
    if arc is None or not _is_on(arc, control, tolerance * size):
        return None
    major, minor = float(np.linalg.norm(arc.major)), float(np.linalg.norm(arc.minor))
    if major - minor <= tolerance * major:
        arc = _circular(arc, np.zeros(3), points[-1] - origin)
    arc = arc._replace(center=arc.center + origin)
    return arc if np.isfinite([arc.center, arc.major, arc.minor]).all() else None


def _circular(arc: Arc, start: Vector, stop: Vector) -> Arc:
    """An arc that is round but for rounding, as one of a circle that begins and ends exactly at these points."""
    normal = np.cross(arc.major, arc.minor)
    normal /= np.linalg.norm(normal)
    middle, along = (start + stop) / 2, (stop - start) / np.linalg.norm(stop - start)
    # The centre is as far from both ends.
    across = np.cross(normal, along)
    center = middle + ((arc.center - middle) @ across) * across
    major, end = start - center, stop - center
    minor = np.cross(normal, major)
    return Arc(center, major, minor, 0.0, math.atan2(end @ minor, end @ major) % (2 * math.pi), circular=True)


def _conic(control: NDArray[np.float64]) -> Arc | None:
    """The ellipse of a rational quadratic of homogeneous control points (w P, w); None of a parabola or hyperbola."""
    ends = math.sqrt(control[0, 3] * control[2, 3])
    weight = float(control[1, 3]) / ends
    rest = 1 - weight**2
    if rest <= 0:
        return None
    first, last = control[0, :3] / control[0, 3], control[2, :3] / control[2, 3]
    tip = control[1, :3] / ends
    center = ((first + last) / 2 - weight * tip) / rest
    # Conjugate half diameters: the curve is center + cos t a + sin t b, for t up to the angle both ways.
    a, b = tip - weight * center, (last - first) / (2 * math.sqrt(rest))
    angle = math.acos(weight)
    axes, lengths, turn = np.linalg.svd(np.stack([a, b], 1), full_matrices=False)
    if lengths[1] <= 0:
        return None
    major, minor = axes[:, 0] * lengths[0], axes[:, 1] * lengths[1]
    if turn[0, 0] * turn[1, 1] < turn[0, 1] * turn[1, 0]:
        minor, turn = -minor, np.stack([turn[0], -turn[1]])
    start = (math.atan2(turn[1, 0], turn[0, 0]) - angle) % (2 * math.pi)
    return Arc(center, major, minor, start, start + 2 * angle)


def _is_on(arc: Arc, control: NDArray[np.float64], tolerance: float) -> bool:
    """Whether points of a quadratic lie on the arc; between its ends in the order of their parameters."""
    s = np.linspace(0, 1, 5)
    basis = np.stack([(1 - s) ** 2, 2 * s * (1 - s), s**2], 1)
    on = basis @ control
    on = on[:, :3] / on[:, 3:] - arc.center
    angle = np.arctan2(on @ arc.minor / (arc.minor @ arc.minor), on @ arc.major / (arc.major @ arc.major))
    near = np.cos(angle)[:, None] * arc.major + np.sin(angle)[:, None] * arc.minor
    return bool(np.abs(near - on).max() <= tolerance)


def _continues(arc: Arc, after: Arc, tolerance: float) -> bool:
    """Whether an arc goes on where another ends, on the same circle or ellipse and in the same direction."""
    size = float(np.linalg.norm(arc.major))
    # Short arcs tell less of the ellipse than long ones.
    slack = 8 * tolerance * size / min(1.0, arc.stop - arc.start, after.stop - after.start) ** 2
    shapes = [np.outer(x.major, x.major) + np.outer(x.minor, x.minor) for x in (arc, after)]
    normals = [np.cross(x.major, x.minor) for x in (arc, after)]
    return bool(
        arc.circular == after.circular
        and np.abs(arc.center - after.center).max() <= slack
        and np.abs(shapes[0] - shapes[1]).max() <= 2 * slack * size
        and normals[0] @ normals[1] > 0
        and arc.stop - arc.start + after.stop - after.start <= 2 * math.pi * (1 + 8 * tolerance)
        and np.abs(arc.at(arc.stop) - after.at(after.start)).max() <= slack
    )


def _joined(arc: Arc, after: Arc, tolerance: float) -> Arc:
    """Two arcs as one; what is all round but for rounding goes all round."""
    turn = arc.stop - arc.start + after.stop - after.start
    if abs(turn - 2 * math.pi) <= 8 * tolerance * 2 * math.pi:
        return arc._replace(start=0.0, stop=2 * math.pi)
    # Of a circle but for a gap the gap tells little of where the centre is.
    if arc.circular and turn < 1.9 * math.pi:
        return _circular(arc, arc.at(arc.start), after.at(after.stop))
    return arc._replace(stop=arc.start + turn)
