"""A distance of pictures in the features of HED's VGG16, which finds edges; uncalibrated, hence not LPIPS.

LPIPS has weights of its own for the channels of another VGG16: they fit no channel of this one.
"""

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.detectors.hed import Hed
from diff3ds.metrics.lpips import require_pairs, unit_features

# Below that the last of the five blocks, which halve the picture four times, sees one pixel and little else.
LEAST = 16


class HedDistance:
    """Squared differences of features of length 1: summed over channels, means over pixels, summed over five blocks.

    It is 0 for equal pictures and at most 10: features are not negative, so that of length 1 they lie at most sqrt(2)
    apart.

    Args:
        hed: the network with its weights.
    """

    def __init__(self, hed: Hed, device: torch.device | str = "cpu") -> None:
        self.hed, self.device = hed.to(device), device

    def __call__(self, images: Float[Tensor, "B H W 3"], targets: Float[Tensor, "B H W 3"]) -> Float[Tensor, " B"]:
        """Distances of images in [0, 1], pair by pair, with gradients.

        Raises:
            ValueError: images of different shapes, or too small to have features.
        """
        require_pairs(images, targets, LEAST)
        total = images.new_zeros(len(images), device=self.device)
        pairs = (self.hed.features(some.to(self.device)) for some in (images, targets))
        for a, b in zip(*pairs, strict=True):
            total = total + (unit_features(a) - unit_features(b)).square().sum(1).mean((1, 2))
        return total
