"""Strokes as closed surfaces of triangles: tubes as thick as the stroke, with round ends."""

import itertools
import math
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Float, Int
from diff3ds.bezier import evaluate, tessellate
from diff3ds.bezier.curves import bernstein
from diff3ds.curves.directions import turns
from diff3ds.formats.framing import FILLED, ball_of
from diff3ds.sketch import Sketch

Array = NDArray[np.float64]

# Of the largest radius of a stroke: how far the surface may be off the tube.
TOLERANCE = 0.05
# Where a line of chords turns by more, the tube ends and another begins, both with round ends: a mitre would be thin.
SHARP = math.radians(45)


class Tube(NamedTuple):
    """A closed surface; all triangles are counter-clockwise seen from outside.

    Attributes:
        vertices: world units, as the sketch.
        normals: unit vectors of the round surface that the triangles stand for.
        faces: three vertices each.
    """

    vertices: Float[NDArray[np.float64], "V 3"]
    normals: Float[NDArray[np.float64], "V 3"]
    faces: Int[NDArray[np.int64], "F 3"]


def width_unit(sketch: Sketch) -> float:
    """How many world units a unit of the sketch's widths is; of image units, in a picture that the sketch fills."""
    return 1.0 if sketch.width_space == "world" else 2 * ball_of(sketch)[1] / FILLED


def tubes_of(sketch: Sketch) -> list[Tube]:
    """A tube a stroke, float64; one without width has no triangles.

    The surface lies within `TOLERANCE` (5 % of the largest radius of the stroke) of the discs swept along it. Widths in
    image units are taken as in a picture that the sketch fills, whose shorter side is its ball's diameter over .9.
    A stroke that turns sharply is several closed tubes, which overlap in a ball.
    """
    sketch = sketch.detach().to("cpu").to(torch.float64)
    radii = sketch.with_widths_along().width * width_unit(sketch) / 2
    first = range(len(sketch) + 1) if sketch.chains is None else sketch.chains.first.tolist()
    largest = torch.stack([radii[first[i] : first[i + 1]].max() for i in range(len(sketch))]) if len(sketch) else radii
    # In units of each stroke's tolerance; the places of strokes without width are not needed.
    stroke = torch.arange(len(sketch)) if sketch.chains is None else sketch.chains.stroke
    unit_of = torch.where(largest > 0, TOLERANCE * largest, math.inf)[stroke][:, None, None]
    lines = [t for t, _ in tessellate(sketch.points / unit_of, sketch.weights, 1.0)]
    found = []
    for i in range(len(sketch)):
        rows = slice(first[i], first[i + 1])
        closed = sketch.chains is not None and bool(sketch.chains.closed[i])
        found.append(_tube(sketch.points[rows], sketch.weights[rows], radii[rows], lines[rows], closed))
    return found


def _tube(
    points: torch.Tensor, weights: torch.Tensor, radii: torch.Tensor, lines: list[torch.Tensor], closed: bool
) -> Tube:
    """The tube of the segments of one stroke, given the parameters of the ends of their chords."""
    largest = float(radii.max())
    if largest == 0:
        return Tube(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    places, sizes = [], []
    for row, chords in enumerate(lines):
        t = _refined(chords, radii[row], TOLERANCE * largest)
        places.append(evaluate(points[row], weights[row], t)[:-1])
        sizes.append((bernstein(t, radii.shape[1] - 1) @ radii[row])[:-1])
    end = (points[-1, -1:], radii[-1, -1:])
    line = torch.cat([*places, end[0]]).numpy()
    thick = torch.cat([*sizes, end[1]]).numpy()
    moved = np.concatenate([[True], np.linalg.norm(np.diff(line, axis=0), axis=1) > 1e-9 * largest])
    moved[-1], last = True, moved[-1]
    if not last and moved.sum() > 2:
        moved[np.flatnonzero(moved[:-1])[-1]] = False
    line, thick = line[moved], thick[moved]
    sides = max(6, math.ceil(math.pi / math.acos(1 - TOLERANCE)))
    parts = [_swept(*part, sides) for part in _smooth_parts(line, thick, closed)]
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Tube(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)]),
    )


def _refined(t: torch.Tensor, radii: torch.Tensor, tolerance: float) -> torch.Tensor:
    """Parameters so close that the radius changes by at most twice the tolerance along each chord."""
    slope = (len(radii) - 1) * float(radii.diff().abs().max())
    if slope == 0:
        return t
    parts = [max(1, math.ceil(float(step) * slope / (2 * tolerance))) for step in t.diff()]
    steps = [
        torch.arange(n, dtype=t.dtype) / n * (b - a) + a for (a, b), n in zip(itertools.pairwise(t), parts, strict=True)
    ]
    return torch.cat([*steps, t[-1:]])


def _smooth_parts(line: Array, thick: Array, closed: bool) -> list[tuple[Array, Array, bool]]:
    """Lines of chords without sharp corners: vertices, radii, and whether the last vertex joins the first."""
    if len(line) < 3:
        return [(line, thick, False)]
    ahead = np.diff(line, axis=0)
    corners = np.flatnonzero(turns(ahead[:-1], ahead[1:]) > SHARP) + 1
    if closed and len(line) > 3 and turns(ahead[-1], ahead[0]) <= SHARP:
        if not len(corners):
            return [(line[:-1], thick[:-1], True)]
        # From one corner all round to it.
        turn = corners[0]
        line = np.concatenate([line[turn:-1], line[: turn + 1]])
        thick = np.concatenate([thick[turn:-1], thick[: turn + 1]])
        corners = corners[1:] - turn
    ends = [0, *corners.tolist(), len(line) - 1]
    return [(line[a : b + 1], thick[a : b + 1], False) for a, b in itertools.pairwise(ends)]


def _swept(line: Array, thick: Array, ring: bool, sides: int) -> Tube:
    """The surface round one smooth line of chords."""
    count = len(line)
    around = np.concatenate([line[-1:], line, line[:1]]) if ring else np.concatenate([line[:1], line, line[-1:]])
    tangents = _unit(_unit(np.diff(around, axis=0)[:-1]) + _unit(np.diff(around, axis=0)[1:]))
    frame = _carried(tangents)
    angles = 2 * math.pi * np.arange(sides) / sides
    if ring:
        # What the frame has turned when it comes back is spread over the way.
        back = _turned(frame[-1], tangents[-1], tangents[0])
        side = np.cross(tangents[0], frame[0])
        twist = math.atan2(back @ side, back @ frame[0])
        angles = angles[None] - twist * np.arange(count)[:, None] / count
    cosine, sine = np.broadcast_to(np.cos(angles), (count, sides)), np.broadcast_to(np.sin(angles), (count, sides))
    outward = cosine[..., None] * frame[:, None] + sine[..., None] * np.cross(tangents, frame)[:, None]
    rings = line[:, None] + thick[:, None, None] * outward
    normals = outward
    if not ring:
        before, after = (
            _cap(line[0], thick[0], -tangents[0], outward[0]),
            _cap(line[-1], thick[-1], tangents[-1], outward[-1]),
        )
        rings = np.concatenate([before[0][::-1], rings, after[0]])
        normals = np.concatenate([before[1][::-1], normals, after[1]])
    total = len(rings)
    a = np.arange(total if ring else total - 1)[:, None] * sides + np.arange(sides)
    b = np.arange(total if ring else total - 1)[:, None] * sides + (np.arange(sides) + 1) % sides
    c, d = (a + sides) % (total * sides), (b + sides) % (total * sides)
    faces = np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    vertices, normals = rings.reshape(-1, 3), normals.reshape(-1, 3)
    if ring:
        return Tube(vertices, normals, faces)
    poles = np.stack([line[0] - thick[0] * tangents[0], line[-1] + thick[-1] * tangents[-1]])
    k, n = np.arange(sides), len(vertices)
    start = np.stack([np.full(sides, n), (k + 1) % sides, k], -1)
    stop = np.stack([np.full(sides, n + 1), n - sides + k, n - sides + (k + 1) % sides], -1)
    return Tube(
        np.concatenate([vertices, poles]),
        np.concatenate([normals, -tangents[:1], tangents[-1:]]),
        np.concatenate([faces, start, stop]),
    )


def _cap(center: Array, radius: float, axis: Array, outward: Array) -> tuple[Array, Array]:
    """Rings of half a ball from the equator, which is left out, towards the pole; and their normals."""
    rings = max(2, math.ceil(len(outward) / 4))
    angles = np.arange(1, rings) / rings * math.pi / 2
    normals = np.cos(angles)[:, None, None] * outward + np.sin(angles)[:, None, None] * axis
    return center + radius * normals, normals


def _carried(tangents: Array) -> Array:
    """Normals along a line that turn as little as they can, each from the one before."""
    first = np.eye(3)[np.abs(tangents[0]).argmin()]
    frame = [_unit((first - (first @ tangents[0]) * tangents[0])[None])[0]]
    for before, after in itertools.pairwise(tangents):
        frame.append(_turned(frame[-1], before, after))
    return np.stack(frame)


def _turned(vector: Array, before: Array, after: Array) -> Array:
    """A vector turned as the shortest turn of one direction to another, which are less than half a turn apart."""
    both = before + after
    turned = vector - 2 * (vector @ both) / max(float(both @ both), 1e-300) * both
    # Two mirrors: along the middle of both, then along the second.
    turned = turned - 2 * (turned @ after) * after
    return np.asarray(_unit((turned - (turned @ after) * after)[None])[0])


def _unit(vectors: Array) -> Array:
    """Vectors of length 1; those of length 0 stay, and where none has a length all point up."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    good = lengths[:, 0] > 0
    if not good.any():
        return np.broadcast_to(np.array([0.0, 0.0, 1.0]), vectors.shape).copy()
    return np.where(lengths > 0, vectors / np.where(lengths > 0, lengths, 1), 0.0)
