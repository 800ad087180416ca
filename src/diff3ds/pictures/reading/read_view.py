"""One view of a transforms.json read: decoded, masked, lens distortion taken out, reduced."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.formats.orientation import load_of_size
from diff3ds.pictures.content.cutout import premultiplied
from diff3ds.pictures.content.masks import counted, has_left_out, object_fraction
from diff3ds.pictures.picture_options import Masks
from diff3ds.pictures.reading.decoded_once import load_once
from diff3ds.pictures.reading.lens import straightened
from diff3ds.pictures.reading.resample import area_means
from diff3ds.transforms import View

# JPEG files are decoded at no less than this many times the size wanted: the mean of at least 2 x 2 pixels hides what
# their reduced decoding does differently.
DECODED = 2
# A reduced pixel is known where all that it covers is; the rest is rounding.
KNOWN = 0.999


@dataclass(frozen=True, eq=False)
class Decoded:
    """What the files of a view hold, for pictures of several sizes.

    Attributes:
        pixels: RGB times alpha, and alpha, of the picture, perhaps reduced.
        times: how many times smaller than the file it is.
        fraction: of each pixel that is object, by a mask, or None.
        kept: 1 where the picture counts, 0 where masks leave it out, or None.
    """

    pixels: Float[Tensor, "H W 4"]
    times: int
    fraction: Float[Tensor, "H W"] | None
    kept: Float[Tensor, "H W"] | None


def read_view(
    view: View, size: tuple[int, int], masks: Masks = "ignore"
) -> tuple[Float[Tensor, "h w 4"], Bool[Tensor, "h w"]]:
    """RGB times alpha, and alpha, of the picture in this size, as a camera without distortion sees it.

    Args:
        size: (height, width) wanted.
        masks: what black pixels of the view's mask mean.

    Returns:
        The pixels, 0 where they are not known, and where they are: everywhere without distortion and masks that leave
        pixels out.

    Raises:
        ValueError: a picture or mask that cannot be read, or not of the view's size.
        OSError: a file is missing.
    """
    return shown(decode(view, size, masks), view, size)


def decode(view: View, size: tuple[int, int], masks: Masks = "ignore") -> Decoded:
    """The files of a view, for pictures of at most this size; arguments and errors as for `read_view`."""
    image, full, times = load_once(view.picture, decoded_size(view, size, masks))
    if full != view.size:
        image, times = load_of_size(view.picture, view.size, "the cameras say"), 1
    return Decoded(premultiplied(image), times, object_fraction(view, masks), counted(view, masks))


def decoded_size(view: View, size: tuple[int, int], masks: Masks) -> tuple[int, int] | None:
    """What is decoded of a picture at least, for one of this size; None is all of it."""
    # Masks are decoded in full, so the picture is as well.
    masked = view.mask is not None or has_left_out(view, masks)
    return None if masked else (DECODED * size[0], DECODED * size[1])


def shown(
    picture: Decoded, view: View, size: tuple[int, int], cut: bool = True
) -> tuple[Float[Tensor, "h w 4"], Bool[Tensor, "h w"]]:
    """Cuts, undistorts and reduces these files to what a view shows, as `read_view` gives it.

    Args:
        cut: whether a mask cuts the object out.
    """
    pixels, kept = picture.pixels, picture.kept
    if picture.fraction is not None and cut:
        pixels = pixels * picture.fraction[..., None]
    extent = (view.size[0] / picture.times, view.size[1] / picture.times)
    if not view.distortion:
        means = area_means(pixels[None], size, extent)[0]
        if kept is None:
            return means, torch.ones(size, dtype=torch.bool)
        known = area_means(kept[None, ..., None], size, extent)[0, ..., 0] > KNOWN
        return means * known[..., None], known
    if kept is not None:
        pixels = torch.cat([pixels, kept[..., None]], -1)
    scale = view.intrinsics.new_tensor([picture.times, picture.times, 1.0])
    means, seen = straightened(pixels, view.intrinsics / scale[:, None], view.distortion, size, extent)
    known = (seen if kept is None else means[..., 4]) > KNOWN
    return means[..., :4] * known[..., None], known
