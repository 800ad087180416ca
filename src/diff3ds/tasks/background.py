"""What lies behind the objects of coloured pictures: known from their alpha, given, or found at the borders."""

from dataclasses import replace

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.tasks.posed import SAME, PosedPictures
from diff3ds.tasks.store import Batch, byte_array

NAMED = {"white": (1.0, 1.0, 1.0), "black": (0.0, 0.0, 0.0)}
# A colour that takes this share of the pixels along the borders is a background; photographs have none.
PLAIN = 0.95
# Noise is told from content by means over this many pixels: they lessen noise of .1 to .014, and leave .14 of a black
# line of one pixel.
WINDOW = 7


def parse_background(text: str) -> Float[Tensor, " 3"]:
    """The colour that `white`, `black` or `R,G,B` (each from 0 to 1) names.

    Raises:
        ValueError: the text names no colour.
    """
    try:
        values = NAMED[text] if text in NAMED else tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 3 or not all(0 <= value <= 1 for value in values):
        raise ValueError(f"background must be white, black or R,G,B with numbers from 0 to 1, got {text!r}")
    return torch.tensor(values)


def with_alpha(pictures: PosedPictures, color: Float[Tensor, " 3"] | None) -> tuple[PosedPictures, Tensor | None]:
    """Coloured pictures whose alpha tells the object, and the colour that lies behind it, None where alpha tells.

    Pictures with an alpha of their own stay as they are. Others get alpha 0 in pixels that have the colour of the
    background: the one given, else the one that the borders of all pictures have. Without either they stay opaque.

    Args:
        color: of the background, if it is known.
    """
    if _has_alpha(pictures):
        return pictures, color
    color = _border_color(pictures) if color is None else color
    if color is None:
        return pictures, None
    pixels = byte_array(tuple(pictures.store.pixels.shape), pictures.store.scratch)
    for views in pictures.store.chunks():
        batch = pictures.batch(views)
        kept = torch.stack([_differs(image, color) for image in (batch.pixels[..., :3], _smooth(batch))]).all(0)
        pixels[views] = pictures.store.pixels[views] * kept[..., None]
    return replace(pictures, store=replace(pictures.store, pixels=pixels)), color


def _has_alpha(pictures: PosedPictures) -> bool:
    return any(
        bool((pictures.store.pixels[views][..., 3] < 255)[pictures.store.known[views]].any())
        for views in pictures.store.chunks()
    )


def _border_color(pictures: PosedPictures) -> Float[Tensor, " 3"] | None:
    """The colour of nearly all known pixels along the borders of all pictures."""
    borders = []
    for views in pictures.store.chunks():
        batch = pictures.batch(views)
        borders.append(_sides(_smooth(batch))[_sides(batch.known)])
    border = torch.cat(borders)
    if not len(border):
        return None
    color = border.median(0).values
    return None if float(_differs(border, color).float().mean()) > 1 - PLAIN else color


def _differs(image: Float[Tensor, "*S 3"], color: Float[Tensor, " 3"]) -> Bool[Tensor, "*S"]:
    return (image - color).abs().amax(-1) > SAME


def _smooth(batch: Batch) -> Float[Tensor, "B H W 3"]:
    """Means over the known pixels of windows around each pixel."""
    known = batch.known[..., None].float()
    sums = torch.cat([batch.pixels[..., :3] * known, known], -1).movedim(-1, 1)
    means = torch.nn.functional.avg_pool2d(sums, WINDOW, 1, WINDOW // 2).movedim(1, -1)
    return means[..., :3] / means[..., 3:].clamp(min=1e-6)


def _sides(images: Float[Tensor, "B H W 3"] | Bool[Tensor, "B H W"]) -> Tensor:
    """The pixels along the borders, (B, 2 H + 2 W - 4, ...)."""
    return torch.cat([images[:, 0], images[:, -1], images[:, 1:-1, 0], images[:, 1:-1, -1]], 1)
