"""What lies behind the objects of coloured pictures: known from their alpha, given, or found at the borders."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.pictures.content.clean_plates import CleanPlates
from diff3ds.pictures.dataset import SAME, PosedPictures
from diff3ds.pictures.picture_options import parse_color, parse_color_or_path
from diff3ds.pictures.store import byte_array, opaque_views

# A colour that takes this fraction of the pixels along the borders is a background; photographs have none.
PLAIN = 0.95
# Pictures named in an error.
NAMES = 5
# Noise is told from content by means over this many pixels: they lessen noise of .1 to .014, and leave .14 of a black
# line of one pixel.
WINDOW = 7


def parse_background(text: str) -> Float[Tensor, " 3"]:
    """The colour that `parse_color` finds in a text, as a tensor; errors are its own."""
    return torch.tensor(parse_color(text))


def color_or_path(text: str) -> Float[Tensor, " 3"] | Path:
    """Reads a text as `parse_color_or_path` does, a colour as a tensor; errors are its own."""
    found = parse_color_or_path(text)
    return found if isinstance(found, Path) else torch.tensor(found)


def with_alpha(
    pictures: PosedPictures, background: Float[Tensor, " 3"] | CleanPlates | None
) -> tuple[PosedPictures, Tensor | CleanPlates | None]:
    """Coloured pictures whose alpha tells the object, and what lies behind it, None where alpha tells.

    Pictures with an alpha of their own stay as they are. Others get alpha 0 in pixels that show the background: the one
    given, else the colour that their borders have. Without either they stay opaque.

    Args:
        background: its colour, or pictures of it, if it is known.

    Raises:
        ValueError: some pictures have alpha, and of the others the background is not known.
    """
    opaque = opaque_views(pictures.store)
    if not opaque.any():
        return pictures, background
    background = _border_color(pictures, opaque) if background is None else background
    if background is None and opaque.all():
        return pictures, None
    if background is None:
        names = [pictures.names[view] for view in opaque.nonzero().flatten().tolist()]
        raise ValueError(
            f"{len(names)} of {len(opaque)} pictures have no transparent areas, as the others do, nor borders of one "
            f"colour: {', '.join(names[:NAMES])}{', ...' if len(names) > NAMES else ''}. Cut their object out, say "
            "what lies behind it with --background, or leave them out"
        )
    pixels = byte_array(tuple(pictures.store.pixels.shape), pictures.store.scratch)
    for views in pictures.store.chunks():
        batch = pictures.batch(views)
        difference = batch.pixels[..., :3] - behind(background, views)
        kept = _large(difference) & _large(_smooth(difference, batch.known)) | ~opaque[views, None, None]
        pixels[views] = pictures.store.pixels[views] * kept[..., None]
    return replace(pictures, store=replace(pictures.store, pixels=pixels)), background


def behind(
    background: Float[Tensor, " 3"] | CleanPlates, views: Sequence[int] | Int[Tensor, " B"]
) -> Float[Tensor, " 3"] | Float[Tensor, "B H W 3"]:
    """The picture or colour that lies behind the objects of these views."""
    return background.store.batch(views).pixels[..., :3] if isinstance(background, CleanPlates) else background


def described(background: Float[Tensor, " 3"] | CleanPlates | None) -> list[float] | str | None:
    """A background as JSON knows it: its colour, or a digest of its pictures."""
    if isinstance(background, CleanPlates):
        return f"pictures with SHA-256 {background.digest()}"
    return None if background is None else background.tolist()


def _border_color(pictures: PosedPictures, some: Bool[Tensor, " V"]) -> Float[Tensor, " 3"] | None:
    """The colour of nearly all known pixels along the borders of some pictures, if they have one."""
    borders, rims = [], []
    for views in pictures.store.chunks():
        batch = pictures.batch(views[some[views]])
        borders.append(_smooth_sides(batch.pixels[..., :3], batch.known)[_sides(batch.known)])
        # Masks, or lens distortion, may leave nothing of the borders: then what is known has a rim of its own.
        lost = not len(borders[-1])
        rims.append(_smooth(batch.pixels[..., :3], batch.known)[_rim(batch.known)] if lost else borders[-1][:0])
    border = torch.cat(borders)
    border = border if len(border) else torch.cat(rims)
    if not len(border):
        return None
    color = border.median(0).values
    return None if float(_large(border - color).float().mean()) > 1 - PLAIN else color


def _large(difference: Float[Tensor, "*S 3"]) -> Bool[Tensor, "*S"]:
    return difference.abs().amax(-1) > SAME


def _smooth(values: Float[Tensor, "B H W 3"], known: Bool[Tensor, "B H W"]) -> Float[Tensor, "B H W 3"]:
    """Means over the known pixels of windows around each pixel."""
    fraction = known[..., None].float()
    sums = torch.cat([values * fraction, fraction], -1).movedim(-1, 1)
    means = torch.nn.functional.avg_pool2d(sums, WINDOW, 1, WINDOW // 2).movedim(1, -1)
    return means[..., :3] / means[..., 3:].clamp(min=1e-6)


def _smooth_sides(values: Float[Tensor, "B H W 3"], known: Bool[Tensor, "B H W"]) -> Float[Tensor, "B M 3"]:
    """`_sides` of `_smooth`, from what lies near them."""
    near = WINDOW // 2 + 1
    top, left = _smooth(values[:, :near], known[:, :near]), _smooth(values[:, :, :near], known[:, :, :near])
    bottom, right = _smooth(values[:, -near:], known[:, -near:]), _smooth(values[:, :, -near:], known[:, :, -near:])
    return torch.cat([top[:, 0], bottom[:, -1], left[:, 1:-1, 0], right[:, 1:-1, -1]], 1)


def _rim(known: Bool[Tensor, "B H W"]) -> Bool[Tensor, "B H W"]:
    """The first and the last known pixels of each row and column."""
    rim = torch.zeros_like(known)
    for dim in (1, 2):
        rim |= (known.cumsum(dim) == 1) | (known.flip(dim).cumsum(dim) == 1).flip(dim)
    return rim & known


def _sides(images: Float[Tensor, "B H W 3"] | Bool[Tensor, "B H W"]) -> Tensor:
    """The pixels along the borders, (B, 2 H + 2 W - 4, ...)."""
    return torch.cat([images[:, 0], images[:, -1], images[:, 1:-1, 0], images[:, 1:-1, -1]], 1)
