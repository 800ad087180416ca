"""The convolutions of AlexNet (Krizhevsky 2014) and VGG16 (Simonyan and Zisserman 2015), and what they see on the way.

Layers are numbered as in torchvision's `features`, whose weights these stacks load: `features.0.weight` and so on.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Literal

from torch import nn

from diff3ds._shapes import Float, Tensor
from diff3ds.weights.assign import load_weights

Backbone = Literal["alex", "vgg"]

# VGG16 has so many convolutions of 3 x 3 before each halving, with so many channels.
VGG16 = ((2, 64), (2, 128), (3, 256), (3, 512), (3, 512))
# AlexNet in one column: the channels before and after each convolution, its kernel, stride and padding, and whether
# the image is halved before it.
ALEXNET = ((3, 64, 11, 4, 2, False), (64, 192, 5, 1, 2, True), (192, 384, 3, 1, 1, True), (384, 256, 3, 1, 1, False),
           (256, 256, 3, 1, 1, False))  # fmt: skip
# The least image whose last features have a pixel.
LEAST_SIZE = {"alex": 31, "vgg": 16}


class FeatureStack(nn.Module):
    """Convolutions one after the other."""

    def __init__(self, layers: Sequence[nn.Module]) -> None:
        super().__init__()
        self.features = nn.Sequential(*layers)

    def forward(self, pixels: Float[Tensor, "B 3 H W"], taps: Sequence[int]) -> list[Tensor]:
        """What comes out of these layers, by number, in rising order."""
        seen = []
        for first, last in pairwise((-1, *taps)):
            pixels = self.features[first + 1 : last + 1](pixels)
            seen.append(pixels)
        return seen


def untrained_stack(backbone: Backbone) -> FeatureStack:
    """The stack with random weights."""
    return FeatureStack(_alexnet() if backbone == "alex" else _vgg16())


def feature_stack(backbone: Backbone, tensors: Mapping[str, Tensor], source: str) -> FeatureStack:
    """The stack with torchvision's weights; those of its classifier are left out.

    Raises:
        ValueError: as `load_weights`.
    """
    stack = untrained_stack(backbone)
    load_weights(stack, {k: v for k, v in tensors.items() if k.startswith("features.")}, source)
    return stack


def _alexnet() -> list[nn.Module]:
    layers: list[nn.Module] = []
    for before, after, kernel, stride, padding, halved in ALEXNET:
        layers += [nn.MaxPool2d(3, 2)] if halved else []
        layers += [nn.Conv2d(before, after, kernel, stride, padding), nn.ReLU()]
    return layers


def _vgg16() -> list[nn.Module]:
    layers: list[nn.Module] = []
    before = 3
    for count, after in VGG16:
        for _ in range(count):
            layers += [nn.Conv2d(before, after, 3, padding=1), nn.ReLU()]
            before = after
        layers.append(nn.MaxPool2d(2))
    return layers
