"""Masks of posed pictures: what they leave out of every loss and score, or where the object is."""

from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.formats.orientation import load_of_size
from diff3ds.formats.png import load_image, size_of
from diff3ds.pictures.picture_options import Masks
from diff3ds.pictures.reading.resample import area_means
from diff3ds.transforms import View, is_copy_of_size

# Masks in JPEG files are not quite black: what has at most this fraction of the brightest is. Empirical.
BLACK = 0.05
# instant-ngp's name of a mask beside the picture, white where the picture is left out.
DYNAMIC = "dynamic_mask_{}.png"


def mask_of(image: Float[Tensor, "H W C"]) -> Float[Tensor, "H W"]:
    """A picture as a mask in [0, 1]. One of two values, 0 and another, is black and white, even if that is 1 of 255."""
    gray = image[..., :3].mean(-1)
    gray = gray * image[..., 3] if image.shape[2] == 4 else gray
    high = float(gray.max())
    return (gray > 0).float() if high > 0 and bool(((gray == 0) | (gray == high)).all()) else gray


def dynamic_mask(view: View) -> Path | None:
    """instant-ngp's mask of a view's photograph, if there is one."""
    picture = view.photograph or view.picture
    path = picture.parent / DYNAMIC.format(picture.stem)
    return path if path.is_file() else None


def has_left_out(view: View, masks: Masks) -> bool:
    """Whether masks may leave pixels of this view out."""
    return bool(view.mask and masks == "ignore") or dynamic_mask(view) is not None


def counted(view: View, masks: Masks) -> Float[Tensor, "H W"] | None:
    """1 where the picture counts, 0 where masks leave it out; None if no mask does.

    Raises:
        ValueError: a mask that is no picture, or of another size.
        OSError: the file cannot be read.
    """
    kept = None
    if view.mask and masks == "ignore":
        kept = _bright(_load(view.mask, view))
    dynamic = dynamic_mask(view)
    if dynamic is not None:
        still = 1 - _bright(_load(dynamic, view))
        kept = still if kept is None else kept * still
    return kept


def object_fraction(view: View, masks: Masks) -> Float[Tensor, "H W"] | None:
    """Share of each pixel that is object, by the view's mask; None if no mask says so.

    Raises:
        ValueError, OSError: as `counted`.
    """
    return _load(view.mask, view) if view.mask and masks == "object" else None


def _load(mask: Path, view: View) -> Float[Tensor, "H W"]:
    there = size_of(mask)
    if max(there) <= max(view.size) or not is_copy_of_size(there, view.size):
        return mask_of(load_of_size(mask, view.size, "its picture has"))
    # Of a photograph of which the picture, perhaps an edge map, is a smaller copy.
    return area_means(mask_of(load_image(mask))[None, ..., None], view.size)[0, ..., 0]


def _bright(mask: Float[Tensor, "H W"]) -> Float[Tensor, "H W"]:
    """1 where a mask is not black."""
    return (mask > BLACK * mask.max()).to(torch.float32)
