"""Which strokes cover which points of the images, and where on the stroke: exact, found in blocks of bounded size."""

import math
from typing import NamedTuple, cast

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.bezier.closest import closest_parameter, differentiable_parameter
from diff3ds.bezier.curves import bernstein, homogeneous_derivatives, subcurve_matrix
from diff3ds.bezier.measure import chord_intervals, homogeneous_box
from diff3ds.project import Strokes2D
from diff3ds.render.near_plane import Spans, visible_spans

# Candidates (chord, pixel) tested at a time, and (span, point) solved at a time.
CANDIDATE_BLOCK = 1 << 20
SOLVE_BLOCK = 1 << 16
# Distances, and segments, (px) that are too short to say where from, or where to. [empirical]
NO_DIRECTION = 1e-3
# Chords are used to find candidates only; any value gives the same picture.
CHORD_TOLERANCE = 0.5


class Near(NamedTuple):
    """Visible spans of segments, and pairs (span, flat pixel) such that the pixel may hold points within reach."""

    spans: Spans
    span: Int[Tensor, " C"]
    pixel: Int[Tensor, " C"]


class Hits(NamedTuple):
    """Strokes over points: view, stroke, index of the point, its position; segment and parameter of the closest point.

    free: whether the parameter can move, that is does not sit at an end of the visible part.
    """

    view: Int[Tensor, " P"]
    stroke: Int[Tensor, " P"]
    point: Int[Tensor, " P"]
    position: Float[Tensor, "P 2"]
    segment: Int[Tensor, " P"]
    t: Float[Tensor, " P"]
    free: Tensor

    def where(self, rows: Tensor | slice) -> "Hits":
        """Some of the hits."""
        return Hits(*(column[rows] for column in self))


def half_width_at(
    strokes: Strokes2D, view: Tensor, segment: Tensor, t: Float[Tensor, " P"], depth: Float[Tensor, " P"]
) -> Float[Tensor, " P"]:
    """Half width in pixels at parameters t of segments, which have this depth there (docs eq. 8)."""
    row = view if len(strokes.half_width) > 1 else torch.zeros_like(view)
    if strokes.half_width.ndim == 2:
        half_width = strokes.half_width[row, strokes.stroke_of(segment)].double()
    else:
        half_width = (bernstein(t, 3) * strokes.half_width[row, segment].double()).sum(-1)
    return half_width if strokes.width_space == "image" else half_width / depth


def point_on_stroke(strokes: Strokes2D, hits: Hits, t: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Screen position and camera depth at the hits' parameters, or at t."""
    value = (bernstein(hits.t if t is None else t, 3)[:, None] @ strokes.cubics[hits.view, hits.segment])[:, 0]
    return value[:, :2] / value[:, 2:3], strokes.depth(value)


def moving_parameter(strokes: Strokes2D, hits: Hits) -> Tensor:
    """The hits' parameters with their derivative, constant at the ends of the visible part (docs eq. 6)."""
    control = strokes.on_square(hits.view, strokes.cubics[hits.view, hits.segment][..., :3])
    position = strokes.on_square(hits.view, hits.position)
    t = differentiable_parameter(control, position[:, None], hits.t[:, None])[:, 0]
    return torch.where(hits.free, t, hits.t)


def pixels_across(
    strokes: Strokes2D, hits: Hits, t: Float[Tensor, " P"], away: Float[Tensor, "P 2"], distance: Float[Tensor, " P"]
) -> Float[Tensor, " P"] | float:
    """Pixels of a unit of distance from strokes where pixels are square, at hits that are so far away (docs eq. 8b)."""
    if strokes.square is None:
        return 1.0
    control = strokes.on_square(hits.view, strokes.cubics[hits.view, hits.segment][..., :3])
    value, slope, _ = (x[:, 0] for x in homogeneous_derivatives(control, t[:, None]))
    velocity = (slope[:, :2] - value[:, :2] / value[:, 2:3] * slope[:, 2:3]) / value[:, 2:3]
    across = torch.stack([-velocity[:, 1], velocity[:, 0]], -1)
    # At an end, and where a stroke is but a dot, the way to the point says where from; on the dot itself nothing does.
    near = distance < NO_DIRECTION
    by_tangent = (velocity.square().sum(-1) > NO_DIRECTION**2) & (hits.free | near)
    away = torch.where(near[:, None], away.new_tensor([1.0, 0.0]), away)
    across = torch.where(by_tangent[:, None], across, away)
    unit = torch.nn.functional.normalize(across, dim=-1)
    in_pixels = (unit[:, None] @ strokes.square[hits.view])[:, 0]
    return 1 / cast(Tensor, torch.linalg.vector_norm(in_pixels, dim=-1))


@torch.no_grad()
def find_near(strokes: Strokes2D, size: tuple[int, int], reach: float) -> Near:
    """All (span, pixel) of which the pixel may hold a point within `reach` px of the stroke's edge."""
    strokes = strokes.detach()
    spans = visible_spans(strokes.margin)
    control = span_controls(strokes, spans)
    far = _largest_half_width(strokes, spans, control) + reach
    none = torch.zeros(0, dtype=torch.int64, device=control.device)
    pairs = [(none, none), *_candidates(control[..., :3], far, size)]
    span, pixel = (torch.cat(column) for column in zip(*pairs, strict=True))
    place = torch.unique(span * (size[0] * size[1]) + pixel)
    return Near(spans, place // (size[0] * size[1]), place % (size[0] * size[1]))


def span_controls(strokes: Strokes2D, spans: Spans) -> Float[Tensor, "S 4 4"]:
    """Homogeneous control points of the visible spans as curves of their own."""
    return subcurve_matrix(spans.start, spans.stop, 3) @ strokes.cubics[spans.view, spans.segment]


@torch.no_grad()
def closest_hits(
    strokes: Strokes2D, near: Near, rows: Int[Tensor, " C"], point: Int[Tensor, " C"], position: Float[Tensor, "C 2"],
    reach: float,
) -> Hits:  # fmt: skip
    """Hits of points with the strokes in rows of `near`: each once, at its closest visible point, if in reach."""
    strokes = strokes.detach()
    spans, span = near.spans, near.span[rows]
    control = strokes.on_square(spans.view, span_controls(strokes, spans)[..., :3])
    place = strokes.on_square(spans.view[span], position)
    blocks = zip(torch.split(span, SOLVE_BLOCK), torch.split(place, SOLVE_BLOCK), strict=True)
    u = torch.cat([closest_parameter(control[s], q[:, None])[:, 0] for s, q in blocks])
    t = spans.start[span] + u * (spans.stop - spans.start)[span]
    segment = spans.segment[span]
    hits = Hits(spans.view[span], strokes.stroke_of(segment), point, position, segment, t, (u > 0) & (u < 1))
    on_curve, depth = point_on_stroke(strokes, hits)
    distance = torch.linalg.vector_norm(strokes.on_square(hits.view, position - on_curve), dim=-1)
    nearest = _nearest_of_stroke(hits, distance)
    if strokes.square is not None:
        # As far as pixels reach there.
        reach = reach * float(torch.linalg.matrix_norm(strokes.square, 2).max())
    seen = distance < half_width_at(strokes, hits.view, hits.segment, hits.t, depth) + reach
    return hits.where(nearest & seen)


def _largest_half_width(strokes: Strokes2D, spans: Spans, control: Float[Tensor, "S 4 4"]) -> Float[Tensor, " S"]:
    """Largest half width of each visible stroke (of all its spans, so that the nearest of them is found) in pixels."""
    depth = homogeneous_box(control[..., 2:])[0][..., 0].clamp_min(strokes.near)
    if strokes.half_width.ndim == 2:
        largest = half_width_at(strokes, spans.view, spans.segment, spans.start, depth)
    else:
        # A polynomial is below its greatest Bernstein coefficient.
        row = spans.view if len(strokes.half_width) > 1 else torch.zeros_like(spans.view)
        largest = strokes.half_width[row, spans.segment].double().amax(-1)
        largest = largest if strokes.width_space == "image" else largest / depth
    key = spans.view * len(strokes.opacity) + strokes.stroke_of(spans.segment)
    most = largest.new_zeros(strokes.cubics.shape[0] * len(strokes.opacity))
    return most.scatter_reduce(0, key, largest, "amax")[key]


def _candidates(
    control: Float[Tensor, "S 4 3"], far: Float[Tensor, " S"], size: tuple[int, int]
) -> "list[tuple[Tensor, Tensor]]":
    """Pairs (span, pixel), some twice, that contain every pixel within `far` of a span."""
    chords = chord_intervals(control, CHORD_TOLERANCE)
    ends = chords.control(control)[:, [0, 3]]
    ends = ends[..., :2] / ends[..., 2:]
    # From the centre of a pixel to its corners: points may lie anywhere in it.
    margin = far[chords.curve] + CHORD_TOLERANCE + math.sqrt(0.5)
    height, width = size
    limit = torch.tensor([width, height], dtype=torch.float64, device=control.device)
    # Pixel centres within the box around each chord; clamped first, strokes may end at 1e9.
    low = (ends.amin(1) - margin[:, None] - 0.5).clamp(min=torch.zeros_like(limit), max=limit).ceil().long()
    high = (ends.amax(1) + margin[:, None] - 0.5).clamp(min=-torch.ones_like(limit), max=limit - 1).floor().long()
    spread = (high - low + 1).clamp_min(0)
    counts = spread.prod(-1)
    pairs = []
    for rows in _groups(counts, CANDIDATE_BLOCK):
        chord = torch.repeat_interleave(rows, counts[rows])
        first = counts[rows].cumsum(0) - counts[rows]
        index = torch.arange(len(chord), device=chord.device) - first.repeat_interleave(counts[rows])
        x = low[chord, 0] + index % spread[chord, 0]
        y = low[chord, 1] + index // spread[chord, 0]
        near = _segment_distance(ends[chord], torch.stack([x, y], -1) + 0.5) <= margin[chord]
        pairs.append((chords.curve[chord[near]], (y * width + x)[near]))
    return pairs


def _segment_distance(ends: Float[Tensor, "P 2 2"], query: Float[Tensor, "P 2"]) -> Float[Tensor, " P"]:
    chord, offset = ends[:, 1] - ends[:, 0], query - ends[:, 0]
    along = (offset * chord).sum(-1) / chord.square().sum(-1).clamp_min(1e-300)
    across: Tensor = torch.linalg.vector_norm(offset - along.clamp(0, 1)[:, None] * chord, dim=-1)
    return across


def _groups(counts: Int[Tensor, " M"], block: int) -> "list[Tensor]":
    """Rows with a positive count, in groups of about `block` in all."""
    rows = counts.nonzero()[:, 0]
    group = (counts[rows].cumsum(0) - counts[rows]) // block
    sizes = torch.unique_consecutive(group, return_counts=True)[1].tolist()
    return list(torch.split(rows, sizes)) if sizes else []


def _nearest_of_stroke(hits: Hits, distance: Tensor) -> Tensor:
    """Mask of the hits that are the nearest of their stroke at their point (the first of equals)."""
    if len(distance) == 0:
        return torch.zeros(0, dtype=torch.bool, device=distance.device)
    key = hits.point * (int(hits.stroke.max()) + 1) + hits.stroke
    order = distance.argsort(stable=True)
    order = order[key[order].argsort(stable=True)]
    ordered = key[order]
    first = torch.ones_like(ordered, dtype=torch.bool)
    first[1:] = ordered[1:] != ordered[:-1]
    mask = torch.zeros_like(first)
    mask[order] = first
    return mask
