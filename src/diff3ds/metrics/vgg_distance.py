"""The distance of VGG16's features in which 3Doodle and CLIPasso fit sketches; uncalibrated, hence not LPIPS."""

from collections.abc import Mapping
from typing import Literal

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.metrics.feature_stacks import feature_stack
from diff3ds.metrics.lpips import unit_features
from diff3ds.metrics.preprocess import IMAGENET_MEAN, IMAGENET_STD, normalized

Variant = Literal["3doodle", "standard"]

# The last convolution before each halving. 3Doodle takes them before the ReLU, but torchvision's ReLU writes over what
# it reads, so that all but the last, which no ReLU follows there, come after it; so they do here.
TAPS = (3, 8, 15, 22, 28)


class VggDistance:
    """Squared differences of VGG16's features of length 1: summed over channels, means over pixels, summed over taps.

    Args:
        features: torchvision's weights (`features.0.weight`, ...).
        variant: standard takes ImageNet's mean off and divides by its standard deviation; 3doodle, as its code, has the
            two exchanged.
        source: name of the weights for messages.

    Raises:
        ValueError: as `load_weights`.
    """

    def __init__(
        self,
        features: Mapping[str, Tensor],
        variant: Variant = "standard",
        source: str = "features",
        device: torch.device | str = "cpu",
    ) -> None:
        self.stack = feature_stack("vgg", features, source).to(device)
        self.variant = variant
        mean, std = IMAGENET_MEAN, IMAGENET_STD
        self.mean, self.std = (std, mean) if variant == "3doodle" else (mean, std)

    def __call__(self, pixels: Float[Tensor, "B 3 H W"], targets: Float[Tensor, "B 3 H W"]) -> Float[Tensor, " B"]:
        """Distances of images in [0, 1], pair by pair, with gradients: 0 for equal ones."""
        total = pixels.new_zeros(len(pixels))
        for a, b in zip(self._directions(pixels), self._directions(targets), strict=True):
            total = total + (a - b).square().sum(1).mean((1, 2))
        return total

    def _directions(self, pixels: Float[Tensor, "B 3 H W"]) -> list[Tensor]:
        return [unit_features(seen) for seen in self.stack(normalized(pixels, self.mean, self.std), TAPS)]
