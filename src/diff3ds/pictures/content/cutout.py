"""Whether a picture is cut out: what counts as transparent, for `diff3ds views` and `diff3ds image` alike."""

import torch

from diff3ds._shapes import Float, Tensor

# Alpha that is clearly transparent: what has more is glass, a shadow, or the rest of an editor's work. Empirical.
CLEAR = 0.25
# Clear pixels make an area if all their neighbours are clear, and the picture is cut out if such pixels take this
# fraction of it: stray ones, slits, dithering and the round corners of a screenshot (.01 %) do not. Empirical.
AREA = 0.005


def is_cut_out(alpha: Float[Tensor, "H W"]) -> bool:
    """Whether alpha tells where something is: clear areas take a part of the picture.

    Alpha that is nowhere clear, or the same everywhere but not 0, tells nothing.
    """
    if float(alpha.min()) >= CLEAR or (float(alpha.min()) == float(alpha.max()) > 0):
        return False
    highest = torch.nn.functional.max_pool2d(alpha[None, None], 3, 1, 1)
    return float((highest < CLEAR).float().mean()) >= AREA


def is_inverted(alpha: Float[Tensor, "*B H W"]) -> bool:
    """Whether pictures are opaque all along their borders, but not inside: alpha tells the background, it seems."""
    edges = (alpha[..., 0, :], alpha[..., -1, :], alpha[..., 0], alpha[..., -1])
    return all(bool((edge == 1).all()) for edge in edges) and bool((alpha < CLEAR).any())


def premultiplied(image: Float[Tensor, "H W C"]) -> Float[Tensor, "H W 4"]:
    """RGB times alpha, and alpha, of a gray, RGB or straight RGBA picture.

    Where a picture is not cut out, its alpha is left out: pixels have their straight colours and alpha 1. Otherwise
    transparent pixels hold any colour, so that only the products have means.
    """
    pixels = torch.ones((*image.shape[:2], 4))
    pixels[..., :3] = image[..., :3]
    return pixels.mul_(image[..., 3:]) if image.shape[2] == 4 and is_cut_out(image[..., 3]) else pixels
