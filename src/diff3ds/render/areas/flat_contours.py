"""The reference of what contours fill or stroke: polygons whose vertices are functions of the control points."""

import math

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier.curves import bernstein
from diff3ds.render.areas.painted_layers import STROKE, Layers

# How far chords may be from curves, in pixels: a pixel's area is off by at most two thirds of it.
TOLERANCE = 0.01
# A curve is cut in at most so many chords, and a circle.
MOST_CHORDS = 1024


def layer_edges(layers: Layers, row: int) -> Float[Tensor, "E 2 2"]:
    """Directed edges, in pixels, of polygons whose winding numbers, by the rule of the layer, say what is painted.

    Those of strokes all wind the same way, so that the rule of nonzero winding numbers gives their union.
    """
    first, count, rule, transform, _ = layers.layers[row].tolist()
    matrix = layers.transforms[transform]
    edges = []
    for contour in range(first, first + count):
        segments = _segments(layers, contour)
        closed = bool(layers.contours[contour, 4])
        edges += _stroked(segments, matrix, closed) if rule == STROKE else [_filled(segments, matrix)]
    local = torch.cat(edges) if edges else layers.points.new_zeros((0, 2, 2))
    return local @ matrix[:, :2].T + matrix[:, 2]


Segment = tuple[Float[Tensor, "_ 2"], Float[Tensor, " _"]]


def _segments(layers: Layers, contour: int) -> list[Segment]:
    """Control points and half widths of each segment; one of a single point, if that is all there is."""
    start, points, first, count, _ = layers.contours[contour].tolist()
    at, found = 0, []
    for inner in layers.inner[first : first + count].tolist():
        index = [start + (at + k) % points for k in range(inner + 2)]
        found.append((layers.points[index], layers.half_widths[index]))
        at += inner + 1
    return found or [(layers.points[[start]], layers.half_widths[[start]])] if points else []


def _chords(segment: Segment, matrix: Float[Tensor, "2 3"], stroke: bool) -> Float[Tensor, " C"]:
    """The parameters, from 0 to 1, between which chords stand for a segment.

    A chord of a curve over 1/n of its parameter is off by at most max |C''| / 8 n^2. The offset curve at the half width
    w is off by w / 8 times the square of the angle by which a chord turns, and a Bézier curve turns by no more than its
    control polygon.
    """
    points, widths = segment[0].detach(), segment[1].detach()
    scale = float(torch.linalg.matrix_norm(matrix.detach()[:, :2], 2))
    degree = len(points) - 1
    count = 1.0
    if degree > 1:
        second = (points[2:] - 2 * points[1:-1] + points[:-2]).norm(dim=1).max()
        count = math.sqrt(degree * (degree - 1) / 8 * float(second) * scale / TOLERANCE)
        if stroke:
            count = max(count, _turn(points) / _angle(float(widths.max()) * scale))
    n = min(max(math.ceil(count), 1), MOST_CHORDS)
    return torch.arange(n + 1, dtype=points.dtype) / n


def _angle(half_width: float) -> float:
    """The angle that a chord of a circle of this radius may span."""
    return min(math.sqrt(8 * TOLERANCE / half_width), math.pi / 2) if half_width > 0 else math.pi / 2


def _turn(points: Float[Tensor, "K 2"]) -> float:
    legs = points.diff(dim=0)
    return float(_between(legs[:-1], legs[1:]).sum())


def _between(a: Float[Tensor, "*N 2"], b: Float[Tensor, "*N 2"]) -> Float[Tensor, "*N"]:
    """Angles between vectors, 0 for those without length."""
    return torch.atan2((a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]).abs(), (a * b).sum(-1))


def _at(segment: Segment, t: Float[Tensor, " C"]) -> tuple[Float[Tensor, "C 2"], Float[Tensor, " C"]]:
    basis = bernstein(t, len(segment[0]) - 1)
    return basis @ segment[0], basis @ segment[1]


def _filled(segments: list[Segment], matrix: Float[Tensor, "2 3"]) -> Float[Tensor, "E 2 2"]:
    parts = [_at(segment, _chords(segment, matrix, False)[:-1])[0] for segment in segments if len(segment[0]) > 1]
    if not parts:
        return matrix.new_zeros((0, 2, 2))
    vertices = torch.cat([*parts, segments[-1][0][-1:]])
    return torch.stack([vertices, vertices.roll(-1, 0)], 1)


def _stroked(segments: list[Segment], matrix: Float[Tensor, "2 3"], closed: bool) -> list[Float[Tensor, "E 2 2"]]:
    """Triangles on both sides of each chord, discs at ends and wherever the direction jumps."""
    edges, jumps = [], []
    directions = []
    scale = float(torch.linalg.matrix_norm(matrix.detach()[:, :2], 2))
    for segment in segments:
        if len(segment[0]) == 1 or bool((segment[0].detach() == segment[0].detach()[0]).all()):
            jumps += [(segment[0][0], segment[1][0])]
            continue
        t = _chords(segment, matrix, True)
        centers, widths = _at(segment, t)
        tangents = _tangents(segment, t, centers)
        offsets = widths[:, None] * torch.stack([-tangents[:, 1], tangents[:, 0]], 1)
        for side in (1, -1):
            outer = centers + side * offsets
            edges += [_positive(centers[:-1], centers[1:], outer[1:]), _positive(centers[:-1], outer[1:], outer[:-1])]
        turning = _between(tangents[:-1].detach(), tangents[1:].detach())
        limit = 2 * _angle(float(segment[1].detach().max()) * scale)
        for k in (turning > limit).nonzero().flatten().tolist():
            jumps += [(centers[k], widths[k]), (centers[k + 1], widths[k + 1])]
        directions.append((centers, widths, tangents))
    for k, (centers, widths, tangents) in enumerate(directions):
        before = directions[k - 1][2][-1] if k or closed else None
        if before is None or float(_between(before.detach(), tangents[0].detach())) > SMOOTH:
            jumps.append((centers[0], widths[0]))
        if k == len(directions) - 1 and not closed:
            jumps.append((centers[-1], widths[-1]))
    return edges + [_disc(center, width, scale) for center, width in jumps if float(width.detach()) > 0]


# Directions that differ by less go on in each other: the gap is narrower than a thousandth of a half width.
SMOOTH = 1e-3


def _tangents(segment: Segment, t: Float[Tensor, " C"], centers: Float[Tensor, "C 2"]) -> Float[Tensor, "C 2"]:
    """Unit vectors along a segment; where it stands still, along the chord there, as a constant."""
    degree = len(segment[0]) - 1
    speed = degree * bernstein(t, degree - 1) @ segment[0].diff(dim=0)
    chords = centers.detach().diff(dim=0)
    beside = torch.cat([chords[:1], chords[:-1] + chords[1:], chords[-1:]])
    reach = (segment[0].detach() - segment[0].detach()[0]).norm(dim=1).max()
    still = speed.detach().norm(dim=1) < STILL * reach
    return torch.nn.functional.normalize(torch.where(still[:, None], beside, speed), dim=1, eps=0)


# Slower than this, in terms of its size, a curve has no direction of its own there (float32 leaves 1e-7).
STILL = 1e-6


def _positive(a: Float[Tensor, "N 2"], b: Float[Tensor, "N 2"], c: Float[Tensor, "N 2"]) -> Float[Tensor, "E 2 2"]:
    """The edges of triangles, turned around where they wind the other way."""
    u, v = (b - a).detach(), (c - a).detach()
    turned = (u[:, 0] * v[:, 1] < u[:, 1] * v[:, 0])[:, None]
    b, c = torch.where(turned, c, b), torch.where(turned, b, c)
    return torch.cat([torch.stack(pair, 1) for pair in ((a, b), (b, c), (c, a))])


def _disc(center: Float[Tensor, "2"], radius: Float[Tensor, ""], scale: float) -> Float[Tensor, "E 2 2"]:
    count = min(math.ceil(2 * math.pi / _angle(float(radius.detach()) * scale)), MOST_CHORDS)
    angle = torch.arange(count, dtype=center.dtype) * (2 * math.pi / count)
    vertices = center + radius * torch.stack([angle.cos(), angle.sin()], 1)
    return torch.stack([vertices, vertices.roll(-1, 0)], 1)
