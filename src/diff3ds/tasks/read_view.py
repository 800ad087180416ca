"""One view of a transforms.json read: decoded, masked, lens distortion taken out, reduced."""

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.formats.orientation import load_of_size
from diff3ds.formats.png import load_reduced
from diff3ds.tasks.cutout import premultiplied
from diff3ds.tasks.masks import Masks, counted, has_left_out, object_share
from diff3ds.tasks.resample import area_means, undistorted
from diff3ds.transforms import View

# JPEG files are decoded at no less than this many times the size wanted: the mean of at least 2 x 2 pixels hides what
# their reduced decoding does differently.
DECODED = 2
# Rows whose undistortion is computed at a time.
STRIP = 128
# A reduced pixel is known where all that it covers is; the rest is rounding.
KNOWN = 0.999


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
    # Masks are decoded in full, so the picture is as well.
    masked = view.mask is not None or has_left_out(view, masks)
    image, full, times = load_reduced(view.picture, None if masked else (DECODED * size[0], DECODED * size[1]))
    if full != view.size:
        image, full, times = load_of_size(view.picture, view.size, "the cameras say"), view.size, 1
    pixels = premultiplied(image)
    share = object_share(view, masks)
    if share is not None:
        pixels *= share[..., None]
    kept = counted(view, masks)
    extent = (full[0] / times, full[1] / times)
    if not any(view.distortion):
        means = area_means(pixels[None], size, extent)[0]
        if kept is None:
            return means, torch.ones(size, dtype=torch.bool)
        known = area_means(kept[None, ..., None], size, extent)[0, ..., 0] > KNOWN
        return means * known[..., None], known
    if kept is not None:
        pixels = torch.cat([pixels, kept[..., None]], -1)
    scaled = view.intrinsics / view.intrinsics.new_tensor([times, times, 1.0])[:, None]
    strips = []
    for top in range(0, len(pixels), STRIP):
        strip, seen = undistorted(pixels, scaled, view.distortion, range(top, min(top + STRIP, len(pixels))))
        inside = strip if kept is not None else torch.cat([strip, torch.ones_like(strip[..., :1])], -1)
        strips.append(inside * seen[..., None])
    means = area_means(torch.cat(strips)[None], size, extent)[0]
    known = means[..., 4] > KNOWN
    return means[..., :4] * known[..., None], known
