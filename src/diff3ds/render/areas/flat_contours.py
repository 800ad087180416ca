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


def layer_edges(layers: Layers, row: int) -> Float[Tensor, "_ 2 2"]:
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


def _filled(segments: list[Segment], matrix: Float[Tensor, "2 3"]) -> Float[Tensor, "_ 2 2"]:
    parts = [_at(segment, _chords(segment, matrix, False)[:-1])[0] for segment in segments if len(segment[0]) > 1]
    if not parts:
        return matrix.new_zeros((0, 2, 2))
    vertices = torch.cat([*parts, segments[-1][0][-1:]])
    return torch.stack([vertices, vertices.roll(-1, 0)], 1)


def _stroked(segments: list[Segment], matrix: Float[Tensor, "2 3"], closed: bool) -> list[Float[Tensor, "_ 2 2"]]:
    """Triangles on both sides of each chord, half discs at ends, pieces of discs where the direction jumps."""
    scale = float(torch.linalg.matrix_norm(matrix.detach()[:, :2], 2))
    dots = [s for s in segments if bool((s[0].detach() == s[0].detach()[0]).all())]
    edges = [_disc(points[0], widths[0].clamp(min=0), scale) for points, widths in dots]
    ways = [_way(s, matrix) for s in segments if bool((s[0].detach() != s[0].detach()[0]).any())]
    for k, way in enumerate(ways):
        _, widths, tangents = way
        if not bool((widths.detach() > 0).any()):
            continue
        edges += _strip(way, scale)
        start, end = (way[0][0], way[1][0], way[2][0]), (way[0][-1], way[1][-1], way[2][-1])
        if k == 0 and not closed:
            edges.append(_arc(*start, math.pi / 2, math.pi, scale))
        else:
            before = ways[k - 1]
            edges.append(_corner(before[0][-1], before[1][-1], before[2][-1], tangents[0], scale))
        if k == len(ways) - 1 and not closed:
            edges.append(_arc(*end, -math.pi / 2, math.pi, scale))
    return edges


# Centres, half widths and unit tangents at the ends of chords.
Way = tuple[Float[Tensor, "_ 2"], Float[Tensor, " _"], Float[Tensor, "_ 2"]]


def _way(segment: Segment, matrix: Float[Tensor, "2 3"]) -> Way:
    t = _chords(segment, matrix, True)
    centers, widths = _at(segment, t)
    return centers, widths.clamp(min=0), _tangents(segment, t, centers)


def _strip(way: Way, scale: float) -> list[Float[Tensor, "_ 2 2"]]:
    centers, widths, tangents = way
    offsets = widths[:, None] * torch.stack([-tangents[:, 1], tangents[:, 0]], 1)
    edges = []
    for side in (1, -1):
        outer = centers + side * offsets
        edges += [_positive(centers[:-1], centers[1:], outer[1:]), _positive(centers[:-1], outer[1:], outer[:-1])]
    turning = _between(tangents[:-1].detach(), tangents[1:].detach())
    for k in (turning > 2 * _angle(float(widths.detach().max()) * scale)).nonzero().flatten().tolist():
        edges += [_disc(centers[end], widths[end], scale) for end in (k, k + 1)]
    return edges


def _corner(
    center: Float[Tensor, "2"],
    width: Float[Tensor, ""],
    before: Float[Tensor, "2"],
    behind: Float[Tensor, "2"],
    scale: float,
) -> Float[Tensor, "_ 2 2"]:
    """The piece of a disc on the outer side of where one direction gives way to another."""
    turn = float(_between(before.detach(), behind.detach()))
    if turn <= SMOOTH:
        return center.new_zeros((0, 2, 2))
    left = bool((before[0] * behind[1] > before[1] * behind[0]).detach())
    return _arc(center, width, before, -math.pi / 2 if left else math.pi / 2 - turn, turn, scale, pie=True)


def _arc(
    center: Float[Tensor, "2"],
    width: Float[Tensor, ""],
    tangent: Float[Tensor, "2"],
    start: float,
    sweep: float,
    scale: float,
    pie: bool = False,
) -> Float[Tensor, "_ 2 2"]:
    """An arc from an angle against a direction on, closed by a chord or through its centre."""
    count = min(math.ceil(sweep / _angle(float(width.detach()) * scale)), MOST_CHORDS)
    angle = start + sweep * torch.arange(count + 1, dtype=center.dtype) / count
    cos, sin = angle.cos()[:, None], angle.sin()[:, None]
    vertices = center + width * (cos * tangent + sin * torch.stack([-tangent[1], tangent[0]]))
    if pie:
        vertices = torch.cat([vertices, center[None]])
    return torch.stack([vertices, vertices.roll(-1, 0)], 1)


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


def _positive(a: Float[Tensor, "N 2"], b: Float[Tensor, "N 2"], c: Float[Tensor, "N 2"]) -> Float[Tensor, "_ 2 2"]:
    """The edges of triangles, turned around where they wind the other way."""
    u, v = (b - a).detach(), (c - a).detach()
    turned = (u[:, 0] * v[:, 1] < u[:, 1] * v[:, 0])[:, None]
    b, c = torch.where(turned, c, b), torch.where(turned, b, c)
    return torch.cat([torch.stack(pair, 1) for pair in ((a, b), (b, c), (c, a))])


def _disc(center: Float[Tensor, "2"], radius: Float[Tensor, ""], scale: float) -> Float[Tensor, "_ 2 2"]:
    count = min(math.ceil(2 * math.pi / _angle(float(radius.detach()) * scale)), MOST_CHORDS)
    angle = torch.arange(count, dtype=center.dtype) * (2 * math.pi / count)
    vertices = center + radius * torch.stack([angle.cos(), angle.sin()], 1)
    return torch.stack([vertices, vertices.roll(-1, 0)], 1)
