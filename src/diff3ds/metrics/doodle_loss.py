"""What 3Doodle (Choi et al., ACM TOG 2024) minimises: how far apart CLIP and VGG16 see two images."""

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.metrics.augment import random_warps, warped
from diff3ds.metrics.clip_resnet import ClipResnet
from diff3ds.metrics.preprocess import channels_first, square
from diff3ds.metrics.vgg_distance import VggDistance

# Height and width at which VGG16 sees images.
VGG_SIZE = 224


class DoodleLoss:
    """1 - cosine of CLIP's embeddings and the distance of VGG16's features: means over images and random warps of them.

    Args:
        tower: CLIP's, RN101 in 3Doodle.
        clip_weight: 75 in 3Doodle.
        vgg_weight: 1 in 3Doodle.
        warps: of each image, the same for both of a pair; 4 in 3Doodle.
    """

    def __init__(
        self, tower: ClipResnet, vgg: VggDistance, clip_weight: float = 75.0, vgg_weight: float = 1.0, warps: int = 4
    ) -> None:
        self.tower, self.vgg = tower, vgg
        self.clip_weight, self.vgg_weight, self.warps = clip_weight, vgg_weight, warps
        self.device = tower.conv1.weight.device

    def __call__(
        self, drawn: Float[Tensor, "B H W 3"], wanted: Float[Tensor, "B H W 3"], generator: torch.Generator
    ) -> Float[Tensor, ""]:
        """The loss of drawn images in [0, 1] against those wanted, with gradients to the former; 0 for equal ones."""
        loss = drawn.new_zeros(())
        # Both draw, so that a weight of 0 changes nothing for the other.
        for_clip, for_vgg = (random_warps(self.warps * len(drawn), generator) for _ in ("clip", "vgg"))
        if self.clip_weight:
            loss = loss + self.clip_weight * (1 - self._cosine(drawn, wanted, for_clip))
        if self.vgg_weight:
            loss = loss + self.vgg_weight * self._distance(drawn, wanted, for_vgg)
        return loss

    def plain(
        self, drawn: Float[Tensor, "B H W 3"], wanted: Float[Tensor, "B H W 3"]
    ) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
        """Mean cosine and mean distance of the images themselves."""
        none = torch.zeros(0, 3, 3)
        return self._cosine(drawn, wanted, none), self._distance(drawn, wanted, none)

    def _cosine(
        self, drawn: Float[Tensor, "B H W 3"], wanted: Float[Tensor, "B H W 3"], warps: Float[Tensor, "A 3 3"]
    ) -> Float[Tensor, ""]:
        a, b = drawn.to(self.device), wanted.detach().to(self.device)
        embedded, known = (self.tower(_looks(x, square(x, self.tower.size), warps)) for x in (a, b))
        return torch.nn.functional.cosine_similarity(embedded, known).mean().to(drawn.device)

    def _distance(
        self, drawn: Float[Tensor, "B H W 3"], wanted: Float[Tensor, "B H W 3"], warps: Float[Tensor, "A 3 3"]
    ) -> Float[Tensor, ""]:
        a, b = drawn.to(self.device), wanted.detach().to(self.device)
        return self.vgg(_looks(a, _stretched(a), warps), _looks(b, _stretched(b), warps)).mean().to(drawn.device)


def _looks(
    images: Float[Tensor, "B H W 3"], plain: Float[Tensor, "B 3 S S"], warps: Float[Tensor, "A 3 3"]
) -> Float[Tensor, "C 3 S S"]:
    """Prepared images, and then their warps."""
    repeated = channels_first(images).repeat(len(warps) // len(images), 1, 1, 1)
    return torch.cat([plain, warped(repeated, warps, plain.shape[-1])])


def _stretched(images: Float[Tensor, "B H W 3"]) -> Float[Tensor, "B 3 S S"]:
    """Images at VGG16's size, bilinear without antialiasing as in 3Doodle."""
    return torch.nn.functional.interpolate(channels_first(images), (VGG_SIZE, VGG_SIZE), mode="bilinear")
