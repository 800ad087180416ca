"""Images as pre-trained networks expect them: resized, cropped and normalised, with gradients."""

import torch

from diff3ds._shapes import Float, Tensor

# Statistics of CLIP's training images (Radford et al. 2021), which BLIP uses as well, and of ImageNet's.
CLIP_MEAN, CLIP_STD = (0.48145466, 0.4578275, 0.40821073), (0.26862954, 0.26130258, 0.27577711)
IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


def square(images: Float[Tensor, "B H W 3"], size: int) -> Float[Tensor, "B 3 S S"]:
    """Images reduced or enlarged to `size` pixels along the shorter edge, and the square in their middle.

    Bicubic with antialiasing, clamped to [0, 1] after each of the two passes, as CLIP's own preprocessing by Pillow
    and torchvision apart from its rounding to bytes. Where the middle lies between two pixels, the crop starts at the
    even one, as torchvision's does.

    Raises:
        ValueError: there are no images, or they have no pixels.
    """
    pixels = channels_first(images)
    height, width = pixels.shape[2:]
    short = min(height, width)
    new = (size * height // short, size * width // short)
    # Rows first, then columns. Where edges overshoot there is no gradient: pictures have no such values.
    for shape in ((height, new[1]), new):
        if pixels.shape[2:] != shape:
            pixels = torch.nn.functional.interpolate(pixels, shape, mode="bicubic", antialias=True).clamp(0, 1)
    # Python rounds halves to even.
    top, left = (round((length - size) / 2) for length in new)
    return pixels[:, :, top : top + size, left : left + size]


def channels_first(images: Float[Tensor, "B H W 3"]) -> Float[Tensor, "B 3 H W"]:
    """Images with their channels where networks want them.

    Raises:
        ValueError: there are no images, or they have no pixels.
    """
    if images.ndim != 4 or images.shape[3] != 3 or not images.numel():
        raise ValueError(f"images must have the shape (B, H, W, 3), got {tuple(images.shape)}")
    return images.movedim(-1, 1)


def normalized(
    pixels: Float[Tensor, "B 3 H W"], mean: tuple[float, float, float], std: tuple[float, float, float]
) -> Float[Tensor, "B 3 H W"]:
    """Pixels without their mean, in units of their standard deviation."""
    shift, scale = (pixels.new_tensor(values).reshape(1, 3, 1, 1) for values in (mean, std))
    return (pixels - shift) / scale
