"""Structural similarity of images (Wang, Bovik, Sheikh and Simoncelli, IEEE Trans. Image Processing 13(4), 2004)."""

import math

import torch

from diff3ds._shapes import Bool, Float, Tensor

# The paper's constants, for values in [0, 1]: a Gaussian window of 11 pixels, and what keeps the quotients finite.
WINDOW, SIGMA = 11, 1.5
C1, C2 = 0.01**2, 0.03**2


def ssim(
    color: Float[Tensor, "V H W 3"], target: Float[Tensor, "V H W 3"], known: Bool[Tensor, "V H W"] | None = None
) -> float:
    """Mean structural similarity of images in [0, 1]: 1 for equal ones.

    The mean over all windows that lie in the image, over channels and views, as is usual for coloured images.

    Args:
        color: images.
        target: what they should be.
        known: pixels that count; default all. A window counts if all of its pixels do; views without one are left out.

    Returns:
        NaN if no view has a window that counts.

    Raises:
        ValueError: images smaller than the window.
    """
    if min(color.shape[1:3]) < WINDOW:
        raise ValueError(f"images must have at least {WINDOW}x{WINDOW} pixels, got {tuple(color.shape[1:3])}")
    whole = [None] * len(color) if known is None else list(_whole_windows(known))
    values = []
    for drawn, wanted, mask in zip(color.clamp(0, 1).double(), target.double(), whole, strict=True):
        similarity = _similarity(drawn.movedim(-1, 0), wanted.movedim(-1, 0)).mean(0)
        kept = similarity.flatten() if mask is None else similarity[mask]
        if len(kept):
            values.append(float(kept.mean()))
    return sum(values) / len(values) if values else math.nan


def _similarity(a: Float[Tensor, "C H W"], b: Float[Tensor, "C H W"]) -> Float[Tensor, "C h w"]:
    """Equation 13 of the paper, of every window."""
    mean_a, mean_b = _means(a), _means(b)
    product, squares = mean_a * mean_b, mean_a.square() + mean_b.square()
    covariance = _means(a * b) - product
    variances = _means(a.square() + b.square()) - squares
    return (2 * product + C1) * (2 * covariance + C2) / ((squares + C1) * (variances + C2))


def _means(values: Float[Tensor, "C H W"]) -> Float[Tensor, "C h w"]:
    """Weighted means over all windows inside the image."""
    x = torch.arange(WINDOW, dtype=values.dtype, device=values.device) - WINDOW // 2
    kernel = torch.exp(-(x**2) / (2 * SIGMA**2))
    kernel = kernel / kernel.sum()
    rows = torch.nn.functional.conv2d(values[:, None], kernel.reshape(1, 1, -1, 1))
    return torch.nn.functional.conv2d(rows, kernel.reshape(1, 1, 1, -1))[:, 0]


def _whole_windows(known: Bool[Tensor, "V H W"]) -> Bool[Tensor, "V h w"]:
    unknown = (~known).float()[:, None]
    return torch.nn.functional.max_pool2d(unknown, WINDOW, 1)[:, 0] == 0
