"""Monte Carlo antialiasing, the paper's estimator, in plain torch: the specification of the kernels' one.

Samples are stratified and inside a stroke or not; they are composited in their own order of depth. Their gradient is
the interior term (autograd, for colour, opacity and depth) and the Reynolds boundary term on outlines, added to the
images as zeros with the right derivative (docs/explanation/mathematics.md, eq. 10 to 12).
"""

import math
from dataclasses import replace

import torch

from diff3ds._modes import transformed
from diff3ds._shapes import Float, Int, Tensor
from diff3ds.project import Strokes2D
from diff3ds.render.autograd import sampled
from diff3ds.render.hits import (
    Hits,
    Near,
    closest_hits,
    find_near,
    half_width_at,
    moving_parameter,
    point_on_stroke,
)
from diff3ds.render.kernel_inputs import Images
from diff3ds.render.outline import Outline, sample_outline
from diff3ds.render.reference import composite_points, images_from

# An outline point this much (px) inside its own stroke is hidden by it; as long as the chords that stand for a jump.
OUTLINE_SLACK = 1e-6
# And one this much (px) outside the nearest part of its stroke belongs to a wider one farther away: no outline either.
OUTLINE_GAP = 1e-4


def rasterize(
    strokes: Strokes2D, size: tuple[int, int], background: Float[Tensor, "V1 H1 W1 3"], strata: int, seed: int
) -> Images:
    """As `reference.rasterize` with strata x strata samples a pixel; the same seed gives the kernels' samples."""
    names = ("cubics", "half_width", "color", "opacity", *(() if strokes.square is None else ("square",)))
    given = sampled(tuple(getattr(strokes, name) for name in names))
    strokes = replace(strokes, **dict(zip(names, given, strict=True)))
    near = find_near(strokes, size, 0.0)
    count = len(strokes.cubics) * size[0] * size[1]
    sums = torch.stack([_stratum(strokes, near, size, strata, s, seed) for s in range(strata**2)]).mean(0)
    if transformed() or (torch.is_grad_enabled() and any(moved.requires_grad for moved in (*given[:2], *given[4:]))):
        outline = sample_outline(strokes, near.spans, strata, seed).on_image(size)
        jump = outline_jump(strokes, near, outline, size)
        moved = ((outline.position - outline.position.detach()) * outline.normal).sum(-1)
        sums = sums.index_add(0, outline.place(size), (jump * moved[:, None]).to(sums.dtype))
    return images_from(sums.reshape(count, 6), size, background)


def _stratum(
    strokes: Strokes2D, near: Near, size: tuple[int, int], strata: int, stratum: int, seed: int
) -> Float[Tensor, "M 6"]:
    """Sums over the hits of one sample in every pixel."""
    view = near.spans.view[near.span]
    position = sample_positions(view, near.pixel, size[1], strata, stratum, seed)
    rows = torch.arange(len(near.pixel), device=near.pixel.device)
    hits = closest_hits(strokes, near, rows, view * (size[0] * size[1]) + near.pixel, position, 0.0)

    def shade(hits: Hits) -> tuple[Tensor, Tensor]:
        depth = point_on_stroke(strokes, hits, moving_parameter(strokes, hits))[1]
        return torch.ones_like(depth), depth

    return composite_points(strokes, hits, shade, len(strokes.cubics) * size[0] * size[1])


def mix(h: Int[Tensor, " P"]) -> Int[Tensor, " P"]:
    """A hash of 32 bits (csrc/common/hash.h)."""
    mask = 0xFFFFFFFF
    h = ((h ^ (h >> 16)) * 0x7FEB352D) & mask
    h = ((h ^ (h >> 15)) * 0x846CA68B) & mask
    return h ^ (h >> 16)


def _unit(h: Int[Tensor, " P"]) -> Float[Tensor, " P"]:
    return (h >> 8).double() / 2**24


def _seeded(word: Int[Tensor, " P"], seed: int) -> Int[Tensor, " P"]:
    return mix((seed & 0xFFFFFFFF) ^ mix((seed >> 32) ^ mix(word)))


def sample_positions(
    view: Int[Tensor, " P"], pixel: Int[Tensor, " P"], width: int, strata: int, stratum: int, seed: int
) -> Float[Tensor, "P 2"]:
    """Where the sample of a stratum lies in pixels of views: the kernels' numbers."""
    u = mix(_seeded(view * strata**2 + stratum, seed) ^ (pixel & 0xFFFFFFFF))
    v = mix(u ^ 0x9E3779B9)
    x = (stratum % strata + _unit(u)) / strata
    y = (stratum // strata + _unit(v)) / strata
    return torch.stack([pixel % width + x, pixel // width + y], -1)


@torch.no_grad()
def outline_jump(strokes: Strokes2D, near: Near, outline: Outline, size: tuple[int, int]) -> Float[Tensor, "P 6"]:
    """What the sums of a sample gain where outline points move outwards: their value just inside less just outside.

    Zero for points that lie inside another part of their own stroke.
    """
    rows, point = _pairs_at(near, outline.place(size), size)
    position = outline.position.detach()
    # Of a stroke's own parts, those that do not reach a point matter too.
    hits = closest_hits(strokes, near, rows, point, position[point], math.inf)
    own_stroke = strokes.stroke_of(outline.segment)
    own = hits.stroke == own_stroke[hits.point]
    on_curve, depth = point_on_stroke(strokes, hits)
    away = strokes.on_square(hits.view, hits.position - on_curve)
    inside = half_width_at(strokes, hits.view, hits.segment, hits.t, depth) - torch.linalg.vector_norm(away, dim=-1)
    hidden = torch.zeros(len(position), dtype=torch.bool, device=position.device)
    hidden[hits.point[own & ((inside > OUTLINE_SLACK) | (inside < -OUTLINE_GAP))]] = True
    others = hits.where(~own & (inside > 0))
    index = torch.arange(len(position), device=position.device)
    fixed = torch.zeros_like(index, dtype=torch.bool)
    itself = Hits(outline.view, own_stroke, index, position, outline.segment, outline.t, fixed)
    both = Hits(*(torch.cat(pair) for pair in zip(others, itself, strict=True)))

    def shade(hits: Hits) -> tuple[Tensor, Tensor]:
        depth = point_on_stroke(strokes, hits)[1]
        return torch.ones_like(depth), depth

    with_, without = (composite_points(strokes, h, shade, len(position)) for h in (both, others))
    return torch.where(hidden[:, None], 0.0, with_ - without)


def _pairs_at(near: Near, place: Int[Tensor, " P"], size: tuple[int, int]) -> tuple[Tensor, Tensor]:
    """Rows of `near` for the pixels that points lie in, and the index of the point for each row."""
    key, order = (near.spans.view[near.span] * (size[0] * size[1]) + near.pixel).sort(stable=True)
    start, stop = torch.searchsorted(key, place), torch.searchsorted(key, place, right=True)
    counts = stop - start
    point = torch.repeat_interleave(torch.arange(len(place), device=place.device), counts)
    rank = torch.arange(len(point), device=place.device) - (counts.cumsum(0) - counts)[point]
    return order[start[point] + rank], point
