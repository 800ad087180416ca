"""LPIPS: a perceptual distance of images, calibrated on human judgement (Zhang et al., CVPR 2018), version 0.1."""

from collections.abc import Mapping

import torch
from torch import nn

from diff3ds._shapes import Float, Tensor
from diff3ds.metrics.feature_stacks import LEAST_SIZE, Backbone, feature_stack
from diff3ds.metrics.preprocess import channels_first, normalized
from diff3ds.weights.assign import load_weights

# Layers whose outputs are compared, each the last ReLU before the image is halved (for AlexNet, every ReLU), and their
# channels.
TAPS = {"alex": (1, 4, 7, 9, 11), "vgg": (3, 8, 15, 22, 29)}
CHANNELS = {"alex": (64, 192, 384, 256, 256), "vgg": (64, 128, 256, 512, 512)}
# The published scaling of images in [-1, 1], ImageNet's statistics as the authors rounded them.
SHIFT, SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)
# What keeps the length of features without any from dividing by zero; the authors' constant.
TINY = 1e-10


class _Heads(nn.Module):
    """The published weights of the channels, by their names there: lin0.model.1.weight and so on."""

    def __init__(self, backbone: Backbone) -> None:
        super().__init__()
        for i, channels in enumerate(CHANNELS[backbone]):
            # The first layer of each was dropout, which does nothing outside of training.
            linear = nn.ModuleDict({"model": nn.Sequential(nn.Identity(), nn.Conv2d(channels, 1, 1, bias=False))})
            self.add_module(f"lin{i}", linear)

    def weights(self) -> list[Tensor]:
        """One number a channel, for each tap."""
        return [value.flatten() for value in self.state_dict().values()]


class Lpips:
    """LPIPS with one backbone.

    Args:
        backbone: alex, which most publications report, or vgg.
        features: torchvision's weights of AlexNet or VGG16 (`features.0.weight`, ...).
        heads: the published weights of the channels (`lin0.model.1.weight`, ...).
        sources: names of the two for messages.

    Raises:
        ValueError: as `load_weights`.
    """

    def __init__(
        self,
        backbone: Backbone,
        features: Mapping[str, Tensor],
        heads: Mapping[str, Tensor],
        sources: tuple[str, str] = ("features", "heads"),
        device: torch.device | str = "cpu",
    ) -> None:
        self.backbone: Backbone = backbone
        self.stack = feature_stack(backbone, features, sources[0]).to(device)
        layers = _Heads(backbone)
        load_weights(layers, heads, sources[1])
        self.heads = [weights.to(device) for weights in layers.weights()]

    def __call__(self, images: Float[Tensor, "B H W 3"], targets: Float[Tensor, "B H W 3"]) -> Float[Tensor, " B"]:
        """Distances of images in [0, 1], pair by pair, with gradients: 0 for equal ones.

        Raises:
            ValueError: images of different shapes, or too small to have features.
        """
        require_pairs(images, targets, LEAST_SIZE[self.backbone])
        total = images.new_zeros(len(images), device=self.heads[0].device)
        for a, b, weights in zip(self._directions(images), self._directions(targets), self.heads, strict=True):
            total = total + ((a - b).square() * weights.to(a.dtype)[:, None, None]).sum(1).mean((1, 2))
        return total

    def _directions(self, images: Float[Tensor, "B H W 3"]) -> list[Tensor]:
        """Features of every tap, of length 1 in every pixel."""
        pixels = channels_first(images).to(self.heads[0].device)
        seen = self.stack(normalized(2 * pixels - 1, SHIFT, SCALE), TAPS[self.backbone])
        return [unit_features(features) for features in seen]


def require_pairs(images: Float[Tensor, "B H W 3"], targets: Float[Tensor, "B h w 3"], least: int) -> None:
    """Raises ValueError for images of different shapes, or with fewer pixels than these along a side."""
    if images.shape != targets.shape:
        raise ValueError(f"both images must have one shape, got {tuple(images.shape)} and {tuple(targets.shape)}")
    if min(images.shape[1:3]) < least:
        raise ValueError(f"images must have at least {least}x{least} pixels, got {tuple(images.shape[1:3])}")


def unit_features(features: Float[Tensor, "B C H W"]) -> Float[Tensor, "B C H W"]:
    """Features of length 1 in every pixel, or 0 where there are none.

    The length's derivative at 0 is taken as 0, where the square root's would be infinite.
    """
    squares = features.square().sum(1, keepdim=True)
    some = squares > 0
    length = torch.where(some, squares, 1.0).sqrt()
    return torch.where(some, features / (length + TINY), 0.0)
