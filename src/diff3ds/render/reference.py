"""The specification: it rasterizes rational strokes in plain torch, coverage and occlusion, differentiated by autograd.

Any dtype and device. Geometry is computed in float64. Memory is bounded: candidates are searched and pixels are shaded
in blocks, and the shading is computed again in the backward pass. Equations: docs/explanation/mathematics.md.
"""

import math
from collections.abc import Callable
from typing import cast

import torch
from torch.utils.checkpoint import checkpoint

from diff3ds._modes import transformed
from diff3ds._shapes import Float, Int, Tensor
from diff3ds.project import Strokes2D
from diff3ds.render.hits import (
    Hits,
    closest_hits,
    find_near,
    half_width_at,
    moving_parameter,
    pixels_across,
    point_on_stroke,
)
from diff3ds.render.kernel_inputs import Images

# The normal distribution is cut here; what is lost, 2e-4, is given back by scaling so that coverage is continuous.
BLUR_REACH = 3.5
# Pixels with less ink than this have no depth.
MIN_ALPHA = 1e-6
# Distances (px) are rounded up to it, which changes no coverage by more than rounding does.
MIDDLE = 1e-8
# Hits (padded to the longest list) shaded at a time.
SHADE_BLOCK = 1 << 17


def rasterize(
    strokes: Strokes2D, size: tuple[int, int], background: Float[Tensor, "V1 H1 W1 3"], blur: float
) -> Images:
    """Colour over the background, alpha and depth of strokes with analytic coverage, in the dtype of their colours."""
    near = find_near(strokes, size, reach(blur))
    point = near.spans.view[near.span] * (size[0] * size[1]) + near.pixel
    rows = torch.arange(len(near.pixel), device=near.pixel.device)
    hits = closest_hits(strokes, near, rows, point, pixel_centers(near.pixel, size[1]), reach(blur))

    def shade(hits: Hits) -> tuple[Tensor, Tensor]:
        t = moving_parameter(strokes, hits)
        position, depth = point_on_stroke(strokes, hits, t)
        away = strokes.on_square(hits.view, hits.position - position)
        # In the middle of a stroke a norm has no second derivative; the coverage, which is even in it, has.
        distance = (away.square().sum(-1) + MIDDLE**2).sqrt()
        pixels = pixels_across(strokes, hits, t, away, distance)
        half_width = half_width_at(strokes, hits.view, hits.segment, t, depth)
        return coverage(pixels * distance, pixels * half_width, blur), depth

    sums = composite_points(strokes, hits, shade, len(strokes.cubics) * size[0] * size[1])
    return images_from(sums, size, background)


def coverage(distance: Tensor, half_width: Tensor, blur: float) -> Tensor:
    """Fraction of a pixel covered by a strip of this half width whose middle is this far away (docs eq. 7)."""
    if blur == 0:
        inner, outer = half_width - distance + 0.5, -half_width - distance + 0.5
        return inner.clamp(0, 1) - outer.clamp(0, 1)
    sigma = blur_sigma(blur)
    tail = torch.special.ndtr(torch.tensor(-BLUR_REACH, dtype=torch.float64)).item()

    def cumulative(x: Tensor) -> Tensor:
        y: Tensor = (torch.special.ndtr(x / sigma) - tail) / (1 - 2 * tail)
        return y.clamp(0, 1)

    return cumulative(half_width - distance) - cumulative(-half_width - distance)


def blur_sigma(blur: float) -> float:
    """Standard deviation of the filter in pixels: the blur and the variance 1/12 of the pixel's own box."""
    return math.sqrt(blur**2 + 1 / 12)


def reach(blur: float) -> float:
    """How far beyond its half width a stroke is seen, pixels."""
    return 0.5 if blur == 0 else BLUR_REACH * blur_sigma(blur)


def pixel_centers(pixel: Int[Tensor, " P"], width: int) -> Float[Tensor, "P 2"]:
    """Centres of pixels given by flat index."""
    return torch.stack([pixel % width, pixel // width], -1).double() + 0.5


def images_from(sums: Float[Tensor, "M 6"], size: tuple[int, int], background: Float[Tensor, "V1 H1 W1 3"]) -> Images:
    """Images from sums over the hits of every pixel: see `composite_points`."""
    color, depth, ink, clear = torch.split(sums.reshape(-1, *size, 6), [3, 1, 1, 1], -1)
    inked = ink > MIN_ALPHA
    mean_depth = torch.where(inked, depth / torch.where(inked, ink, 1.0), 0.0)
    return color + clear * background, ink[..., 0], mean_depth[..., 0]


def composite_points(
    strokes: Strokes2D, hits: Hits, shade: Callable[[Hits], tuple[Tensor, Tensor]], count: int
) -> Float[Tensor, "M 6"]:
    """Front to back sums over the hits of `count` points (docs eq. 9), in the dtype of the colours.

    Args:
        shade: from hits to their coverage and depth, float64; computed again in the backward pass.

    Returns:
        sum T a (red, green, blue, depth, 1) and the transmittance behind everything.
    """
    dtype, device = strokes.color.dtype, strokes.color.device
    order = _point_order(hits, point_on_stroke(strokes, hits)[1].detach())
    hits = hits.where(order)
    points, counts = torch.unique_consecutive(hits.point, return_counts=True)

    def block(hits: Hits, counts: Tensor) -> Tensor:
        covered, depth = shade(hits)
        alpha = covered.to(dtype) * strokes.opacity[hits.stroke]
        return composite(alpha, strokes.color[hits.stroke], depth.to(dtype), counts)

    nothing = torch.tensor([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], dtype=dtype, device=device)
    # Where nothing is hit the gradients of all tensors are zero, not an error.
    tensors = [strokes.cubics, strokes.half_width, strokes.color, strokes.opacity]
    tensors += [] if strokes.square is None else [strokes.square]
    sums = nothing.expand(count, 6) + sum(t[:0].sum().to(dtype) for t in tensors)
    parts = [_block_of(block, hits.where(slice(a, b)), counts[i:j]) for a, b, i, j in _blocks(counts)]
    return sums.index_put((points,), torch.cat(parts)) if parts else sums


def _block_of(block: Callable[[Hits, Tensor], Tensor], hits: Hits, counts: Int[Tensor, " M"]) -> Tensor:
    """A block, computed again in the backward pass; but not for torch.func and forward mode, which forbid it."""
    if transformed():
        return block(hits, counts)
    return cast(Tensor, checkpoint(block, hits, counts, use_reentrant=False, preserve_rng_state=False))


def composite(
    alpha: Float[Tensor, " P"], color: Float[Tensor, "P 3"], depth: Float[Tensor, " P"], counts: Int[Tensor, " M"]
) -> Float[Tensor, "M 6"]:
    """Front to back sums of M points with `counts` hits each, in order."""
    row = torch.repeat_interleave(torch.arange(len(counts), device=counts.device), counts)
    rank = torch.arange(len(row), device=row.device) - (counts.cumsum(0) - counts)[row]
    channels = torch.cat([alpha[:, None], color, depth[:, None], torch.ones_like(depth[:, None])], -1)
    layers = torch.zeros((len(counts), int(counts.max()), 6), dtype=color.dtype, device=color.device)
    layers = layers.index_put((row, rank), channels)
    clear = torch.ones_like(layers[:, 0, :1])
    total = torch.zeros_like(layers[:, 0, 1:])
    for layer in layers.unbind(1):
        total = total + clear * layer[:, :1] * layer[:, 1:]
        clear = clear * (1 - layer[:, :1])
    return torch.cat([total, clear], -1)


def _point_order(hits: Hits, depth: Tensor) -> Tensor:
    """Order by point, there near to far; of equal depths the later stroke lies on top."""
    order = hits.stroke.argsort(stable=True, descending=True)
    order = order[depth[order].argsort(stable=True)]
    return order[hits.point[order].argsort(stable=True)]


def _blocks(counts: Int[Tensor, " M"]) -> "list[tuple[int, int, int, int]]":
    """Runs of points i..j with their hits a..b, such that points times the longest list stays bounded."""
    blocks, i, a, b, longest = [], 0, 0, 0, 0
    for j, count in enumerate(counts.tolist()):
        longest = max(longest, count)
        if j > i and (j + 1 - i) * longest > SHADE_BLOCK:
            blocks.append((a, b, i, j))
            i, a, longest = j, b, count
        b += count
    return [*blocks, (a, b, i, len(counts))] if len(counts) else []
