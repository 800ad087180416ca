"""Pictures on other grids of pixels: exact area means, blur, and lens distortion taken out."""

import math

import numpy as np
import torch

from diff3ds._shapes import Bool, Float, Tensor

# The filter of a blur is cut where the renderer cuts its own.
BLUR_REACH = 3.5

# All of this adds up shifted images element by element: the same bits for any number of threads.


def area_means(
    images: Float[Tensor, "B H W C"], size: tuple[int, int], extent: tuple[float, float] | None = None
) -> Float[Tensor, "B h w C"]:
    """Images of another size; each pixel is the mean over the rectangle that it covers, fractions of pixels included.

    Args:
        size: (height, width) of the result.
        extent: (height, width) of the part of the images that the result shows, from the top left corner, in pixels;
            default all.
    """
    height, width = extent or (images.shape[1], images.shape[2])
    return _means(_means(images, 1, height, size[0]), 2, width, size[1])


def blurred(images: Float[Tensor, "B H W C"], blur: float) -> Float[Tensor, "B H W C"]:
    """A normal filter of this standard deviation in pixels; the edge pixels go on beyond the image."""
    if blur == 0:
        return images
    reach = math.ceil(BLUR_REACH * blur)
    kernel = torch.exp(-0.5 * (torch.arange(-reach, reach + 1) / blur) ** 2)
    weights = (kernel / kernel.sum()).tolist()
    for dim in (1, 2):
        count = images.shape[dim]
        wider = images.index_select(dim, torch.arange(-reach, count + reach).clamp(0, count - 1))
        images = torch.zeros_like(images)
        for tap, weight in enumerate(weights):
            images.add_(wider.narrow(dim, tap, count), alpha=weight)
    return images


def undistorted(
    picture: Float[Tensor, "H W C"], intrinsics: Float[Tensor, "3 3"], distortion: tuple[float, ...], rows: range
) -> tuple[Float[Tensor, "h W C"], Bool[Tensor, "h W"]]:
    """Rows of the picture that a camera with the same intrinsics and no distortion takes, and where they are known.

    Each pixel is looked up, bilinearly, where OpenCV's radial and tangential model puts it in the picture. What that
    model puts outside the picture is not known, nor what lies beyond the radius at which the model folds back.

    Args:
        picture: as taken.
        intrinsics: in pixels of the picture.
        distortion: k1, k2, p1, p2, k3.
        rows: which rows to make.
    """
    height, width = picture.shape[:2]
    (fx, _, cx), (_, fy, cy), _ = intrinsics.tolist()
    k1, k2, p1, p2, k3 = distortion
    y = (torch.arange(rows.start, rows.stop, dtype=torch.float64)[:, None] + 0.5 - cy) / fy
    x = (torch.arange(width, dtype=torch.float64) + 0.5 - cx) / fx
    square = x * x + y * y
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    u = fx * (x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)) + cx
    v = fy * (y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y) + cy
    known = (u >= 0) & (u <= width) & (v >= 0) & (v <= height) & (square < _fold(k1, k2, k3))
    grid = torch.stack([2 * u / width - 1, 2 * v / height - 1], -1).float()
    found = torch.nn.functional.grid_sample(
        picture.permute(2, 0, 1)[None], grid[None], mode="bilinear", padding_mode="border", align_corners=False
    )
    return found[0].permute(1, 2, 0), known


def _fold(k1: float, k2: float, k3: float) -> float:
    """Square of the least radius r at which r (1 + k1 r^2 + k2 r^4 + k3 r^6) stops growing."""
    roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
    # A double root is a real one with a rounding error.
    turns = [root.real for root in roots if root.real > 0 and abs(root.imag) < 1e-6 * abs(root)]
    return min(turns, default=math.inf)


def _means(images: Float[Tensor, "B H W C"], dim: int, extent: float, count: int) -> Float[Tensor, "B h w C"]:
    """Area means along one axis."""
    there = images.shape[dim]
    if there == extent == count:
        return images
    if there == extent and there % count == 0:
        parts = images.reshape(*images.shape[:dim], count, -1, *images.shape[dim + 1 :]).unbind(dim + 1)
        total = parts[0].clone()
        for part in parts[1:]:
            total += part
        return total.div_(len(parts))
    ends = torch.arange(count + 1, dtype=torch.float64) * (extent / count)
    start, stop = ends[:-1], ends[1:]
    first = start.floor().long()
    total = images.new_zeros([count if d == dim else n for d, n in enumerate(images.shape)])
    for tap in range(int((stop.ceil().long() - first).max())):
        pixel = first + tap
        overlap = torch.minimum(stop, pixel + 1.0) - torch.maximum(start, pixel.double())
        share = (overlap.clamp(min=0) * (count / extent)).to(images.dtype)
        part = images.index_select(dim, pixel.clamp(max=there - 1))
        total += part.mul_(share.reshape([-1 if d == dim else 1 for d in range(4)]))
    return total
