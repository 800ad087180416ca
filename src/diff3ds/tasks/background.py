"""What lies behind the objects of coloured pictures: known from their alpha, given, or found at the borders."""

from dataclasses import replace

import torch

from diff3ds._shapes import Bool, Float, Tensor, UInt8
from diff3ds.tasks.posed import SAME, PosedPictures
from diff3ds.tasks.store import byte_array

NAMED = {"white": (1.0, 1.0, 1.0), "black": (0.0, 0.0, 0.0)}
# A colour that takes this share of the pixels along the borders is a background; photographs have none.
PLAIN = 0.95


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
        kept = (pictures.batch(views).pixels[..., :3] - color).abs().amax(-1, keepdim=True) > SAME
        pixels[views] = pictures.store.pixels[views] * kept
    return replace(pictures, store=replace(pictures.store, pixels=pixels)), color


def _has_alpha(pictures: PosedPictures) -> bool:
    return any(
        bool((pictures.store.pixels[views][..., 3] < 255)[pictures.store.known[views]].any())
        for views in pictures.store.chunks()
    )


def _border_color(pictures: PosedPictures) -> Float[Tensor, " 3"] | None:
    """The colour of nearly all known pixels along the borders of all pictures."""
    pixels, known = pictures.store.pixels[..., :3], pictures.store.known
    border = torch.cat([_sides(pixels[view])[_sides(known[view])] for view in range(len(pictures))]).float() / 255
    if not len(border):
        return None
    middle = border.median(0).values
    plain = (border - middle).abs().amax(-1) < SAME
    return middle if float(plain.float().mean()) > PLAIN else None


def _sides(image: UInt8[Tensor, "H W 3"] | Bool[Tensor, "H W"]) -> Tensor:
    return torch.cat([image[0], image[-1], image[1:-1, 0], image[1:-1, -1]])
