"""Pictures on other grids of pixels: exact area means, and blur."""

import math
from collections.abc import Iterator

import torch

from diff3ds._shapes import Float, Tensor

# The filter of a blur is cut where the renderer cuts its own.
BLUR_REACH = 3.5

# Numbers of an image that are worked on at a time: with what is made of them they fit the caches of one core.
STRIP = 1 << 18

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
    there = (images.shape[1], images.shape[2])
    height, width = extent or there
    if (height, width) == there == size:
        return images
    means = images.new_empty((images.shape[0], *size, images.shape[3]))
    for rows, ends, source in strips(size[0], height, images[:, :1].numel()):
        part = images[:, source.start : source.stop]
        means[:, rows.start : rows.stop] = means_between(means_between(part, 1, ends), 2, even_ends(size[1], width))
    return means


def even_ends(count: int, extent: float) -> Float[Tensor, " N"]:
    """The places where so many pixels begin that share this length evenly, and where the last one ends; float64."""
    return torch.arange(count + 1, dtype=torch.float64) * (extent / count)


def strips(count: int, extent: float, row: int) -> Iterator[tuple[range, Float[Tensor, " N"], range]]:
    """Rows of a smaller image, few at a time, with the rows of the larger one that they cover.

    Args:
        count: rows of the smaller image.
        extent: rows of the larger one that they cover together.
        row: numbers in a row of the larger one.

    Yields:
        Rows of the smaller image; their `even_ends`, counted from the first row of the larger one that they cover; and
        the rows of the larger one, of which the last may lie beyond it by less than one.
    """
    step = max(1, int(STRIP / row * count / extent))
    ends = even_ends(count, extent)
    for first in range(0, count, step):
        some = ends[first : first + step + 1]
        top, bottom = math.floor(some[0]), math.ceil(some[-1])
        yield range(first, first + len(some) - 1), some - top, range(top, bottom)


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


def means_between(images: Float[Tensor, "*S"], dim: int, ends: Float[Tensor, " N"]) -> Float[Tensor, "*T"]:
    """Area means along one axis: each pixel is the mean from one of these places to the next."""
    there, count, length = images.shape[dim], len(ends) - 1, float(ends[1] - ends[0])
    if ends[0] == 0 and ends[-1] == there and there % count == 0:
        parts = images.reshape(*images.shape[:dim], count, -1, *images.shape[dim + 1 :]).unbind(dim + 1)
        total: Tensor = parts[0].clone()
        for part in parts[1:]:
            total += part
        return total.div_(len(parts))
    start, stop = ends[:-1], ends[1:]
    first = start.floor().long()
    total = images.new_zeros([count if d == dim else n for d, n in enumerate(images.shape)])
    for tap in range(int((stop.ceil().long() - first).max())):
        pixel = first + tap
        overlap = torch.minimum(stop, pixel + 1.0) - torch.maximum(start, pixel.double())
        fraction = (overlap.clamp(min=0) / length).to(images.dtype)
        part = images.index_select(dim, pixel.clamp(max=there - 1))
        total.addcmul_(part, fraction.reshape([-1 if d == dim else 1 for d in range(images.ndim)]))
    return total
