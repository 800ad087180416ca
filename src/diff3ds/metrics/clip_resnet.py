"""The image tower of CLIP's ResNets (Radford et al. 2021), RN50 and RN101, by OpenAI's names of its weights."""

from collections.abc import Mapping

import torch
from torch import nn

from diff3ds._shapes import Float, Tensor
from diff3ds.metrics.preprocess import CLIP_MEAN, CLIP_STD, normalized
from diff3ds.weights.assign import load_weights

# Blocks widen their channels by this much; the image halves five times up to the last; heads have so many channels.
EXPANSION, REDUCTION, HEAD = 4, 32, 64
PREFIX = "visual."


class ClipResnet(nn.Module):
    """Three convolutions, four stages of bottlenecks, and a pooling by attention.

    Attributes:
        size: height and width of the images, pixels.
    """

    def __init__(self, width: int, blocks: tuple[int, ...], grid: int, output: int) -> None:
        super().__init__()
        self.size = grid * REDUCTION
        half = width // 2
        self.conv1, self.bn1 = nn.Conv2d(3, half, 3, 2, 1, bias=False), nn.BatchNorm2d(half)
        self.conv2, self.bn2 = nn.Conv2d(half, half, 3, 1, 1, bias=False), nn.BatchNorm2d(half)
        self.conv3, self.bn3 = nn.Conv2d(half, width, 3, 1, 1, bias=False), nn.BatchNorm2d(width)
        before = width
        for stage, count in enumerate(blocks):
            planes = width << stage
            strides = [2 if stage else 1] + [1] * (count - 1)
            befores = [before] + [EXPANSION * planes] * (count - 1)
            layers = [_Bottleneck(b, planes, s) for b, s in zip(befores, strides, strict=True)]
            self.add_module(f"layer{stage + 1}", nn.Sequential(*layers))
            before = EXPANSION * planes
        self.stages = len(blocks)
        self.attnpool = _AttentionPool(grid, before, output)

    def forward(self, pixels: Float[Tensor, "B 3 S S"]) -> Float[Tensor, "B D"]:
        """Embeddings, of any length, of images in [0, 1].

        Raises:
            ValueError: images of another size.
        """
        if pixels.shape[2:] != (self.size, self.size):
            raise ValueError(f"images must have {self.size}x{self.size} pixels, got {tuple(pixels.shape[2:])}")
        x = normalized(pixels, CLIP_MEAN, CLIP_STD)
        for i in (1, 2, 3):
            x = torch.relu(getattr(self, f"bn{i}")(getattr(self, f"conv{i}")(x)))
        x = nn.functional.avg_pool2d(x, 2)
        for stage in range(self.stages):
            x = getattr(self, f"layer{stage + 1}")(x)
        pooled: Tensor = self.attnpool(x)
        return pooled


def clip_resnet(tensors: Mapping[str, Tensor], source: str) -> ClipResnet:
    """A tower of the shape that its weights have; those of CLIP's text tower are left out.

    Args:
        tensors: OpenAI's (`visual.conv1.weight`, ...), which OpenCLIP's conversions share.
        source: where they come from, for messages.

    Raises:
        ValueError: they are no such tower's; as `load_weights`.
    """
    first, positions, last = (
        tensors.get(PREFIX + name)
        for name in ("conv1.weight", "attnpool.positional_embedding", "attnpool.c_proj.weight")
    )
    if first is None or positions is None or last is None:
        raise ValueError(
            f"{source}: not CLIP's ResNet by OpenAI's names (visual.conv1.weight, visual.attnpool.c_proj.weight, ...); "
            "open_clip_model.safetensors of timm/resnet101_clip.openai is one"
        )
    counts = tuple(
        len({name.split(".")[2] for name in tensors if name.startswith(f"{PREFIX}layer{stage}.")})
        for stage in range(1, 5)
    )
    grid = round((len(positions) - 1) ** 0.5)
    tower = ClipResnet(2 * len(first), counts, grid, len(last))
    load_weights(tower, tensors, source, PREFIX)
    return tower


class _Bottleneck(nn.Module):
    """As ResNet's, but images are halved by means instead of strides."""

    def __init__(self, before: int, planes: int, stride: int) -> None:
        super().__init__()
        after = EXPANSION * planes
        self.conv1, self.bn1 = nn.Conv2d(before, planes, 1, bias=False), nn.BatchNorm2d(planes)
        self.conv2, self.bn2 = nn.Conv2d(planes, planes, 3, padding=1, bias=False), nn.BatchNorm2d(planes)
        self.conv3, self.bn3 = nn.Conv2d(planes, after, 1, bias=False), nn.BatchNorm2d(after)
        self.stride = stride
        self.downsample = None
        if stride > 1 or before != after:
            self.downsample = nn.Sequential(nn.Conv2d(before, after, 1, bias=False), nn.BatchNorm2d(after))

    def forward(self, x: Float[Tensor, "B C H W"]) -> Float[Tensor, "B D h w"]:
        y = torch.relu(self.bn1(self.conv1(x)))
        y = torch.relu(self.bn2(self.conv2(y)))
        y = self.bn3(self.conv3(nn.functional.avg_pool2d(y, self.stride)))
        kept = x if self.downsample is None else self.downsample(nn.functional.avg_pool2d(x, self.stride))
        return torch.relu(y + kept)


class _AttentionPool(nn.Module):
    """Attention of the mean over all pixels to itself and the pixels."""

    def __init__(self, grid: int, channels: int, output: int) -> None:
        super().__init__()
        self.positional_embedding = nn.Parameter(torch.zeros(grid**2 + 1, channels))
        self.q_proj, self.k_proj, self.v_proj = (nn.Linear(channels, channels) for _ in range(3))
        self.c_proj = nn.Linear(channels, output)
        self.heads = channels // HEAD

    def forward(self, x: Float[Tensor, "B C H W"]) -> Float[Tensor, "B D"]:
        tokens = x.flatten(2).mT
        tokens = torch.cat([tokens.mean(1, keepdim=True), tokens], 1) + self.positional_embedding
        query, key, value = (
            proj(t).unflatten(-1, (self.heads, -1)).transpose(1, 2)
            for proj, t in ((self.q_proj, tokens[:, :1]), (self.k_proj, tokens), (self.v_proj, tokens))
        )
        attended = nn.functional.scaled_dot_product_attention(query, key, value)
        pooled: Tensor = self.c_proj(attended.transpose(1, 2).flatten(2))[:, 0]
        return pooled
