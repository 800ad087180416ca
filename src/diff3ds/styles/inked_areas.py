"""Inked areas of a page as pixels, painted over each other: what each covers of a pixel is its exact area there."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Index, Int, Tensor
from diff3ds.page.drawn_paths import DrawnPath
from diff3ds.page.sheet.ink_boxes import Box
from diff3ds.render.areas import NONZERO, PLAIN, STROKE, Layers, covered_pixels
from diff3ds.styles.style import Outline

# Areas are found of so many at once: each takes as much memory as its rows are long.
AT_ONCE = 16


class Area(NamedTuple):
    """An area of one colour.

    Attributes:
        outlines: round it, closed; or with a width lines to stroke, open. Pixels of the page.
        color: RGB in [0, 1].
        opacity: in [0, 1].
        multiplied: whether its colour is multiplied with what lies below.
        taken: outlines round what is left out of it.
        cut: the box that it is cut at, pixels of the page; None for none.
        width: of lines, with round ends, pixels; None fills.
    """

    outlines: Sequence[Outline]
    color: Sequence[float]
    opacity: float
    multiplied: bool = False
    taken: Sequence[Outline] = ()
    cut: Box | None = None
    width: float | None = None

    @staticmethod
    def of(path: DrawnPath) -> "Area":
        """Of lines of one cubic each."""
        return Area([curve[None] for curve in path.curves], path.color, path.opacity, width=path.width)


def painted_pixels(
    areas: Sequence[Area], size: tuple[int, int], ground: Sequence[float] | None, scale: float = 1.0
) -> Float[Tensor, "H W C"]:
    """The picture of a page, RGB, or where there is no ground straight RGBA.

    Args:
        areas: from the lowest to the uppermost.
        size: (height, width) of the picture, pixels.
        ground: RGB in [0, 1], or None.
        scale: pixels of the picture to one of the page.
    """
    height, width = size
    # Colours times alpha, and alpha.
    canvas = np.zeros((height * width, 4), np.float32)
    if ground is not None:
        canvas[:] = (*ground, 1.0)
    rest = np.zeros(height * width, np.float32)
    for first in range(0, len(areas), AT_ONCE):
        some = areas[first : first + AT_ONCE]
        covered = iter(_covered(some, size, scale))
        for area in some:
            pixels, share = next(covered)
            if area.taken:
                without, less = next(covered)
                rest[pixels] = share
                rest[without] -= less
                share = rest[pixels].clip(0)
                rest[pixels] = rest[without] = 0
            if area.cut is not None:
                x0, y0, x1, y1 = (scale * side for side in area.cut)
                y, x = np.divmod(pixels, width)
                shown = (x + 0.5 > x0) & (y + 0.5 > y0) & (x + 0.5 < x1) & (y + 0.5 < y1)
                pixels, share = pixels[shown], share[shown]
            _paint(canvas, pixels, share, area)
    image = canvas.reshape(height, width, 4)
    if ground is not None:
        return torch.from_numpy(image[..., :3])
    return torch.from_numpy(np.concatenate([image[..., :3] / image[..., 3:].clip(1e-6), image[..., 3:]], -1))


def _paint(canvas: NDArray[np.float32], pixels: Int[Index, " n"], share: Float[Array, " n"], area: Area) -> None:
    """Paints an area as SVG and CSS have it."""
    own = (area.opacity * share)[:, None]
    below = canvas[pixels]
    color = np.array([*area.color, 1.0], np.float32)
    if area.multiplied:
        canvas[pixels] = own * color * (1 - below[:, 3:]) + below * (1 - own * (1 - color))
        return
    canvas[pixels] = own * color + below * (1 - own)


def _covered(
    areas: Sequence[Area], size: tuple[int, int], scale: float
) -> list[tuple[Int[Index, " n"], Float[Array, " n"]]]:
    """The pixels of areas and how much of each is covered; after an area those of what is taken out of it."""
    shapes: list[tuple[Sequence[Outline], float | None]] = []
    for area in areas:
        shapes.append((area.outlines, area.width))
        if area.taken:
            shapes.append((area.taken, None))
    outlines = [(outline, width) for shape, width in shapes for outline in shape]
    points = [outline.reshape(-1, 2) for outline, _ in outlines]
    inner = [_inner(outline, width) for outline, width in outlines]
    counts, segments = (np.array([len(each) for each in some], int) for some in (points, inner))
    closed = np.array([width is None for _, width in outlines], int)
    contours = np.stack([counts.cumsum() - counts, counts, segments.cumsum() - segments, segments, closed], 1)
    each = np.array([len(shape) for shape, _ in shapes])
    rules = np.array([NONZERO if width is None else STROKE for _, width in shapes])
    rows = np.stack([each.cumsum() - each, each, rules, 0 * each, 0 * each], 1)
    half_widths = np.repeat([(width or 0.0) / 2 for _, width in outlines], counts)
    layers = Layers(
        torch.tensor(np.concatenate([np.zeros((0, 2)), *points]), dtype=torch.float32),
        torch.tensor(half_widths, dtype=torch.float32),
        torch.tensor(list(itertools.chain(*inner)), dtype=torch.int32),
        torch.tensor(contours, dtype=torch.int32),
        torch.tensor(rows, dtype=torch.int32),
        transforms=torch.tensor([[[scale, 0, 0], [0, scale, 0]]], dtype=torch.float32),
        # A paint that nobody looks at.
        paints=torch.tensor([[PLAIN, 0, 1, 0]], dtype=torch.int32),
        axes=torch.zeros(1, 4),
        offsets=torch.zeros(1),
        colors=torch.zeros(1, 4),
    )
    return covered_pixels(layers, size[1], size[0])


def _inner(outline: Outline, width: float | None) -> list[int]:
    """Control points between the ends of each part: of cubics, between which lines go, or of lines alone."""
    return [0] * len(outline) if outline.ndim == 2 else [2, 0] * len(outline) if width is None else [2]
