"""The specification: strokes to pixels in plain torch, differentiated by autograd alone.

Any dtype and device. Geometry is computed in float64. Memory is bounded: candidates are searched and pixels are shaded
in blocks, and the shading is computed again in the backward pass. Equations: docs/mathematics.md.
"""

import math
from typing import NamedTuple

import torch
from torch.utils.checkpoint import checkpoint

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.bezier.closest import closest_parameter, differentiable_parameter
from diff3ds.bezier.curves import bernstein, subcurve_matrix
from diff3ds.bezier.measure import chord_intervals, homogeneous_box
from diff3ds.project import Strokes2D
from diff3ds.render.visible import Spans, visible_spans

# The normal distribution is cut here; what is lost, 2e-4, is given back by scaling so that coverage is continuous.
BLUR_REACH = 3.5
# Pixels with less ink than this have no depth.
MIN_ALPHA = 1e-6
# Candidates (chord, pixel) tested at a time, and hits (padded to the longest list) shaded at a time.
CANDIDATE_BLOCK = 1 << 20
SHADE_BLOCK = 1 << 17
# Chords are used to find candidates only; any value gives the same picture.
CHORD_TOLERANCE = 0.5


class Hits(NamedTuple):
    """Strokes over pixels: view, stroke, flat pixel index, parameter, and whether the parameter can move."""

    view: Int[Tensor, " P"]
    stroke: Int[Tensor, " P"]
    pixel: Int[Tensor, " P"]
    t: Float[Tensor, " P"]
    free: Tensor


def rasterize(
    strokes: Strokes2D, size: tuple[int, int], background: Float[Tensor, "V1 H1 W1 3"], blur: float
) -> tuple[Float[Tensor, "V H W 3"], Float[Tensor, "V H W"], Float[Tensor, "V H W"]]:
    """Colour over the background, alpha and depth of strokes with analytic coverage, in the dtype of their colours."""
    views, (height, width) = len(strokes.cubics), size
    hits = find_hits(strokes, size, blur)
    depth = point_on_stroke(strokes, hits)[1].detach()
    order = _pixel_order(hits, depth, height * width)
    hits = Hits(*(column[order] for column in hits))
    flat = background.expand(views, height, width, 3).reshape(-1, 3)
    place = hits.view * (height * width) + hits.pixel
    pixels, counts = place.unique_consecutive(return_counts=True)
    shaded = [
        checkpoint(_shade, strokes, Hits(*(c[a:b] for c in hits)), counts[i:j], flat[pixels[i:j]], width, blur,
                   use_reentrant=False, preserve_rng_state=False)
        for a, b, i, j in _blocks(counts)
    ]  # fmt: skip
    color, ink = flat, torch.zeros(len(flat), 2, dtype=flat.dtype, device=flat.device)
    if shaded:
        color = color.index_put((pixels,), torch.cat([s[0] for s in shaded]))
        ink = ink.index_put((pixels,), torch.cat([s[1] for s in shaded]))
    alpha, depth = ink.reshape(views, height, width, 2).unbind(-1)
    return color.reshape(views, height, width, 3), alpha, depth


def coverage(distance: Tensor, half_width: Tensor, blur: float) -> Tensor:
    """Share of a pixel covered by a strip of this half width whose middle is this far away (docs eq. 7)."""
    if blur == 0:
        inner, outer = half_width - distance + 0.5, -half_width - distance + 0.5
        return inner.clamp(0, 1) - outer.clamp(0, 1)
    sigma = blur_sigma(blur)
    tail = torch.special.ndtr(torch.tensor(-BLUR_REACH, dtype=torch.float64)).item()
    inner, outer = (
        ((torch.special.ndtr(x / sigma) - tail) / (1 - 2 * tail)).clamp(0, 1)
        for x in (half_width - distance, -half_width - distance)
    )
    return inner - outer


def blur_sigma(blur: float) -> float:
    """Standard deviation of the filter in pixels: the blur and the variance 1/12 of the pixel's own box."""
    return math.sqrt(blur**2 + 1 / 12)


def reach(blur: float) -> float:
    """How far beyond its half width a stroke is seen, pixels."""
    return 0.5 if blur == 0 else BLUR_REACH * blur_sigma(blur)


def half_width_at(strokes: Strokes2D, view: Tensor, stroke: Tensor, depth: Tensor) -> Tensor:
    """Half width in pixels of strokes at points of this depth (docs eq. 8)."""
    row = view if len(strokes.half_width) > 1 else torch.zeros_like(view)
    half_width = strokes.half_width[row, stroke].double()
    return half_width if strokes.width_space == "image" else half_width / depth


def point_on_stroke(strokes: Strokes2D, hits: Hits, t: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Screen position and camera depth at the hits' parameters, or at t."""
    value = (bernstein(hits.t if t is None else t, 3)[:, None] @ strokes.cubics[hits.view, hits.stroke])[:, 0]
    return value[:, :2] / value[:, 2:3], value[:, 2] / value[:, 3]


def pixel_centers(pixel: Int[Tensor, " P"], width: int) -> Float[Tensor, "P 2"]:
    """Centres of pixels given by flat index."""
    return torch.stack([pixel % width, pixel // width], -1).double() + 0.5


@torch.no_grad()
def find_hits(strokes: Strokes2D, size: tuple[int, int], blur: float) -> Hits:
    """Every stroke over every pixel centre within reach, at its closest visible point."""
    spans = visible_spans(strokes.cubics, strokes.near)
    matrices = subcurve_matrix(spans.start, spans.stop, 3)
    control = matrices @ strokes.cubics[spans.view, spans.stroke]
    far = _largest_half_width(strokes, spans, control) + reach(blur)
    pairs = [_no_pairs(control), *_candidates(control[..., :3], far, size)]
    span, pixel = (torch.cat(column) for column in zip(*pairs, strict=True))
    place = (span * (size[0] * size[1]) + pixel).unique()
    span, pixel = place // (size[0] * size[1]), place % (size[0] * size[1])
    center = pixel_centers(pixel, size[1])
    u = torch.cat([_closest(control, s, c) for s, c in zip(span.split(1 << 16), center.split(1 << 16), strict=True)])
    t = spans.start[span] + u * (spans.stop - spans.start)[span]
    hits = Hits(spans.view[span], spans.stroke[span], pixel, t, (u > 0) & (u < 1))
    position, depth = point_on_stroke(strokes, hits)
    distance = torch.linalg.vector_norm(center - position, dim=-1)
    nearest = _nearest_of_stroke(hits, distance, strokes.cubics.shape[1], size[0] * size[1])
    seen = distance < half_width_at(strokes, hits.view, hits.stroke, depth) + reach(blur)
    return Hits(*(column[nearest & seen] for column in hits))


def _closest(control: Tensor, span: Tensor, center: Tensor) -> Tensor:
    return closest_parameter(control[span][..., :3], center[:, None])[:, 0]


def _no_pairs(control: Tensor) -> tuple[Tensor, Tensor]:
    none = torch.zeros(0, dtype=torch.int64, device=control.device)
    return none, none


def _largest_half_width(strokes: Strokes2D, spans: Spans, control: Float[Tensor, "S 4 4"]) -> Float[Tensor, " S"]:
    """Largest half width of each visible stroke (of all its spans, so that the nearest of them is found) in pixels."""
    depth = homogeneous_box(control[..., 2:])[0][..., 0].clamp_min(strokes.near)
    largest = half_width_at(strokes, spans.view, spans.stroke, depth)
    key = spans.view * strokes.cubics.shape[1] + spans.stroke
    most = largest.new_zeros(strokes.cubics.shape[0] * strokes.cubics.shape[1])
    return most.scatter_reduce(0, key, largest, "amax")[key]


def _candidates(
    control: Float[Tensor, "S 4 3"], far: Float[Tensor, " S"], size: tuple[int, int]
) -> "list[tuple[Tensor, Tensor]]":
    """Pairs (span, pixel), some twice, that contain every pixel centre within `far` of a span."""
    chords = chord_intervals(control, CHORD_TOLERANCE)
    ends = chords.control(control)[:, [0, 3]]
    ends = ends[..., :2] / ends[..., 2:]
    margin = far[chords.curve] + CHORD_TOLERANCE
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
    return torch.linalg.vector_norm(offset - along.clamp(0, 1)[:, None] * chord, dim=-1)


def _groups(counts: Int[Tensor, " M"], block: int) -> "list[Tensor]":
    """Rows with a positive count, in groups of about `block` in all."""
    rows = counts.nonzero()[:, 0]
    group = (counts[rows].cumsum(0) - counts[rows]) // block
    sizes = group.unique_consecutive(return_counts=True)[1].tolist()
    return list(rows.split(sizes)) if sizes else []


def _nearest_of_stroke(hits: Hits, distance: Tensor, strokes: int, area: int) -> Tensor:
    """Mask of the hits that are the nearest of their stroke at their pixel (the first of equals)."""
    key = (hits.view * strokes + hits.stroke) * area + hits.pixel
    order = distance.argsort(stable=True)
    order = order[key[order].argsort(stable=True)]
    ordered = key[order]
    first = torch.ones_like(ordered, dtype=torch.bool)
    first[1:] = ordered[1:] != ordered[:-1]
    mask = torch.zeros_like(first)
    mask[order] = first
    return mask


def _pixel_order(hits: Hits, depth: Tensor, area: int) -> Tensor:
    """Order by pixel, there near to far, ties by stroke index."""
    order = hits.stroke.argsort(stable=True)
    order = order[depth[order].argsort(stable=True)]
    return order[(hits.view * area + hits.pixel)[order].argsort(stable=True)]


def _blocks(counts: Int[Tensor, " M"]) -> "list[tuple[int, int, int, int]]":
    """Runs of pixels i..j with their hits a..b, such that pixels times the longest list stays bounded."""
    blocks, i, a, b, longest = [], 0, 0, 0, 0
    for j, count in enumerate(counts.tolist()):
        longest = max(longest, count)
        if j > i and (j + 1 - i) * longest > SHADE_BLOCK:
            blocks.append((a, b, i, j))
            i, a, longest = j, b, count
        b += count
    return [*blocks, (a, b, i, len(counts))] if len(counts) else []


def _shade(
    strokes: Strokes2D, hits: Hits, counts: Int[Tensor, " M"], behind: Float[Tensor, "M 3"], width: int, blur: float
) -> tuple[Float[Tensor, "M 3"], Float[Tensor, "M 2"]]:
    """Colour, and (alpha, depth), of M pixels from their hits in order of pixel and depth."""
    center = pixel_centers(hits.pixel, width)
    t = _moving_parameter(strokes, hits, center)
    position, depth = point_on_stroke(strokes, hits, t)
    distance = torch.linalg.vector_norm(center - position, dim=-1)
    covered = coverage(distance, half_width_at(strokes, hits.view, hits.stroke, depth), blur)
    alpha = covered.to(behind.dtype) * strokes.opacity[hits.stroke]
    return composite(alpha, strokes.color[hits.stroke], depth.to(behind.dtype), counts, behind)


def _moving_parameter(strokes: Strokes2D, hits: Hits, center: Tensor) -> Tensor:
    """The hits' parameters with their derivative, constant at the ends of the visible part."""
    control = strokes.cubics[hits.view, hits.stroke][..., :3]
    t = differentiable_parameter(control, center[:, None], hits.t[:, None])[:, 0]
    return torch.where(hits.free, t, hits.t)


def composite(
    alpha: Float[Tensor, " P"],
    color: Float[Tensor, "P 3"],
    depth: Float[Tensor, " P"],
    counts: Int[Tensor, " M"],
    behind: Float[Tensor, "M 3"],
) -> tuple[Float[Tensor, "M 3"], Float[Tensor, "M 2"]]:
    """Front to back over the background (docs eq. 9): colour, and (alpha, depth), of M pixels with `counts` hits."""
    row = torch.repeat_interleave(torch.arange(len(counts), device=counts.device), counts)
    rank = torch.arange(len(row), device=row.device) - (counts.cumsum(0) - counts)[row]
    channels = torch.cat([alpha[:, None], color, depth[:, None], torch.ones_like(depth[:, None])], -1)
    shape = (len(counts), int(counts.max()) if len(counts) else 0, 6)
    layers = torch.zeros(shape, dtype=behind.dtype, device=behind.device).index_put((row, rank), channels)
    clear = torch.ones_like(behind[:, :1])
    total = torch.zeros_like(layers[:, 0, 1:])
    for layer in layers.unbind(1):
        total = total + clear * layer[:, :1] * layer[:, 1:]
        clear = clear * (1 - layer[:, :1])
    # The sum of T a; 1 - clear is the same, but has few digits where ink is faint.
    ink = total[:, 4:]
    inked = ink > MIN_ALPHA
    mean_depth = torch.where(inked, total[:, 3:4] / torch.where(inked, ink, 1.0), 0.0)
    return total[:, :3] + clear * behind, torch.cat([ink, mean_depth], -1)
