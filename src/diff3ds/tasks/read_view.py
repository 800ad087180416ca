"""One view of a transforms.json read: decoded, lens distortion taken out, reduced."""

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.formats.png import load_image, load_reduced
from diff3ds.tasks.resample import area_means, undistorted
from diff3ds.transforms import View

# JPEG files are decoded at no less than this many times the size wanted: the mean of at least 2 x 2 pixels hides what
# their reduced decoding does differently.
DECODED = 2
# Rows whose undistortion is computed at a time.
STRIP = 128
# A reduced pixel is known where all that it covers is; the rest is rounding.
KNOWN = 0.999


def read_view(view: View, size: tuple[int, int]) -> tuple[Float[Tensor, "h w 4"], Bool[Tensor, "h w"]]:
    """RGB times alpha, and alpha, of the picture in this size, as a camera without distortion sees it.

    Returns:
        The pixels, 0 where they are not known, and where they are: everywhere without distortion.

    Raises:
        ValueError: a picture or mask that cannot be read, or not of the view's size.
        OSError: a file is missing.
    """
    # The mask is decoded in full, so the picture is as well.
    least = None if view.mask else (DECODED * size[0], DECODED * size[1])
    image, full, times = load_reduced(view.picture, least)
    if full != view.size:
        raise ValueError(
            f"{view.picture}: {full[0]} x {full[1]} (height x width) pixels, but the cameras say "
            f"{view.size[0]} x {view.size[1]}"
        )
    pixels = _premultiplied(image, _mask(view))
    extent = (full[0] / times, full[1] / times)
    if not any(view.distortion):
        return area_means(pixels[None], size, extent)[0], torch.ones(size, dtype=torch.bool)
    scaled = view.intrinsics / view.intrinsics.new_tensor([times, times, 1.0])[:, None]
    strips = []
    for top in range(0, len(pixels), STRIP):
        strip, seen = undistorted(pixels, scaled, view.distortion, range(top, min(top + STRIP, len(pixels))))
        strips.append(torch.cat([strip, torch.ones_like(strip[..., :1])], -1) * seen[..., None])
    means = area_means(torch.cat(strips)[None], size, extent)[0]
    known = means[..., 4] > KNOWN
    return means[..., :4] * known[..., None], known


def _premultiplied(image: Float[Tensor, "H W C"], mask: Float[Tensor, "H W"] | None) -> Float[Tensor, "H W 4"]:
    """RGB times alpha, and alpha. Transparent pixels hold any colour, so that only these have means."""
    pixels = torch.ones((*image.shape[:2], 4))
    pixels[..., :3] = image[..., :3]
    for alpha in (image[..., 3] if image.shape[2] == 4 else None, mask):
        if alpha is not None:
            pixels *= alpha[..., None]
    return pixels


def _mask(view: View) -> Float[Tensor, "H W"] | None:
    if view.mask is None:
        return None
    mask = load_image(view.mask)
    if mask.shape[:2] != view.size:
        raise ValueError(
            f"{view.mask}: {mask.shape[0]} x {mask.shape[1]} (height x width) pixels, but its picture has "
            f"{view.size[0]} x {view.size[1]}"
        )
    gray = mask[..., :3].mean(-1)
    return gray * mask[..., 3] if mask.shape[2] == 4 else gray
