"""Lens distortion taken out of pictures, which are reduced in the same pass."""

import functools
import math
from dataclasses import dataclass

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.distortion import Distortion
from diff3ds.pictures.reading.resample import even_ends, means_between, strips

# Strips of maps that are remembered, 12 bytes a pixel: the pictures of one camera share them, up to 30 million pixels.
REMEMBERED = 256


@dataclass(frozen=True, eq=False)
class LensMap:
    """Where each pixel of some rows of a straight picture lies in the picture as taken.

    Attributes:
        grid: (x, y) from -1 to 1 across the rows `taken`, for torch's `grid_sample`.
        known: whether it lies in it.
        taken: the rows of the picture as taken that are needed.
    """

    grid: Float[Tensor, "h W 2"]
    known: Bool[Tensor, "h W"]
    taken: range


def undistorted(
    picture: Float[Tensor, "H W C"], intrinsics: Float[Tensor, "3 3"], distortion: Distortion, rows: range
) -> tuple[Float[Tensor, "C h W"], Bool[Tensor, "h W"]]:
    """Rows of the picture that a camera with the same intrinsics and no distortion takes, and where they are known.

    Each pixel is looked up, bilinearly, where the lens puts it in the picture. What that model puts outside the picture
    is not known, nor what lies beyond the radius at which the model folds back. Of a fisheye picture the middle stays:
    a straight picture of this size has no room for the rest.

    Args:
        picture: as taken.
        intrinsics: in pixels of the picture.
        distortion: of the lens.
        rows: which rows to make.
    """
    height, width = picture.shape[:2]
    found = lens_map(tuple(intrinsics.flatten().tolist()), distortion, (height, width), rows)
    source = picture[found.taken.start : found.taken.stop].permute(2, 0, 1)[None].contiguous()
    looked_up = torch.nn.functional.grid_sample(
        source, found.grid[None], mode="bilinear", padding_mode="border", align_corners=False
    )
    return looked_up[0], found.known


def straightened(
    picture: Float[Tensor, "H W C"],
    intrinsics: Float[Tensor, "3 3"],
    distortion: Distortion,
    size: tuple[int, int],
    extent: tuple[float, float],
) -> tuple[Float[Tensor, "h w C"], Float[Tensor, "h w"]]:
    """Area means, as `area_means` makes them, of the picture without distortion, as `undistorted` makes it.

    Returns:
        The means, in which pixels that are not known count as 0; and the fraction of each that is known.
    """
    means, known = picture.new_empty((*size, picture.shape[2])), picture.new_empty(size)
    across = even_ends(size[1], extent[1])
    for rows, ends, source in strips(size[0], extent[0], picture[:1].numel()):
        # What is rounded up may reach beyond the picture.
        there = range(source.start, min(source.stop, len(picture)))
        strip, seen = undistorted(picture, intrinsics, distortion, there)
        both = torch.cat([strip * seen, seen[None].to(strip.dtype)])
        reduced = means_between(means_between(both, 1, ends), 2, across)
        means[rows.start : rows.stop] = reduced[:-1].permute(1, 2, 0)
        known[rows.start : rows.stop] = reduced[-1]
    return means, known


@functools.lru_cache(maxsize=REMEMBERED)
def lens_map(intrinsics: tuple[float, ...], distortion: Distortion, size: tuple[int, int], rows: range) -> LensMap:
    """The map of these rows.

    Args:
        intrinsics: the 9 numbers of the matrix, row by row.
        distortion: of the lens.
        size: (height, width) of the picture.
    """
    height, width = size
    fx, skew, cx, _, fy, cy, *_ = intrinsics
    y = (torch.arange(rows.start, rows.stop, dtype=torch.float64)[:, None] + 0.5 - cy) / fy
    x = (torch.arange(width, dtype=torch.float64) + 0.5 - cx - skew * y) / fx
    seen_x, seen_y = distortion.bent(x, y)
    u, v = fx * seen_x + skew * seen_y + cx, fy * seen_y + cy
    known = (u >= 0) & (u <= width) & (v >= 0) & (v <= height) & (x * x + y * y < distortion.fold())
    # Both rows between which a known pixel lies, of those that there are.
    low, high = (torch.where(known, v, y.new_tensor(other)) for other in (math.inf, -math.inf))
    top = min(max(math.floor(float(low.min()) - 0.5), 0), height - 1) if bool(known.any()) else 0
    bottom = min(max(math.floor(float(high.max()) - 0.5) + 2, top + 1), height) if bool(known.any()) else 1
    grid = torch.stack([2 * u / width - 1, 2 * (v - top) / (bottom - top) - 1], -1).float()
    return LensMap(grid, known, range(top, bottom))
