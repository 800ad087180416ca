"""The network of the small prior: convolutions for lines, and between them a transformer over patches of all views."""

import math

import torch
from torch import nn

from diff3ds._shapes import Float, Tensor
from diff3ds.guidance.built_in.small_shape import Shape


class Attention(nn.Module):
    """Between all tokens of an object: views see each other. Queries and keys are normalised, which keeps it stable."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.into = nn.Linear(width, 3 * width, bias=False)
        self.out = nn.Linear(width, width, bias=False)
        self.scale = nn.Parameter(torch.full((heads, 1, 1), math.log(10.0)))

    def forward(self, tokens: Float[Tensor, "S N D"]) -> Float[Tensor, "S N D"]:
        """Gives each token what it takes from the others."""
        q, k, v = self.into(tokens).unflatten(-1, (3, self.heads, -1)).permute(2, 0, 3, 1, 4)
        q, k = (nn.functional.normalize(x.float(), dim=-1).to(v.dtype) for x in (q, k))
        # Written out: on CPUs, products in bfloat16 are twice as fast as torch's fused attention.
        found = (q * self.scale.exp().to(q.dtype) @ k.mT).softmax(-1).to(v.dtype) @ v
        taken: Tensor = self.out(found.transpose(1, 2).flatten(2))
        return taken


class Block(nn.Module):
    """Attention and a perceptron, scaled, shifted and gated by what is known of the view (Peebles and Xie 2023)."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        d = shape.width
        self.attention = Attention(d, shape.heads)
        self.perceptron = nn.Sequential(nn.Linear(d, 4 * d), nn.GELU("tanh"), nn.Linear(4 * d, d))
        # What all blocks share comes from outside (Chen et al. 2024, PixArt); this is the block's own part.
        self.offset = nn.Parameter(torch.zeros(6, d))
        self.norm = nn.LayerNorm(d, elementwise_affine=False)

    def forward(self, tokens: Float[Tensor, "S N D"], known: Float[Tensor, "S N 6 D"]) -> Float[Tensor, "S N D"]:
        """The tokens after this block."""
        shift, scale, gate, shift2, scale2, gate2 = (known + self.offset).unbind(-2)
        tokens = tokens + gate * self.attention(self.norm(tokens) * (1 + scale) + shift)
        learned: Tensor = self.perceptron(self.norm(tokens) * (1 + scale2) + shift2)
        return tokens + gate2 * learned


class SmallNetwork(nn.Module):
    """Predicts v in noisy views of an object, from what it is, the cameras, and perhaps one clean view of it."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.shape = shape
        d, cells = shape.width, (shape.size // shape.patch) ** 2
        held = shape.channels * shape.patch**2
        self.stem = _convolutions(1, shape.channels, shape.channels)
        self.patches = nn.Linear(held, d)
        self.reference = nn.Linear(held, d)
        self.place = nn.Parameter(0.02 * torch.randn(cells, d))
        self.words = nn.Linear(shape.words, d, bias=False)
        self.time = _embedding(_WAVES, d)
        self.camera = _embedding(_ANGLES, d)
        self.known = nn.Linear(d, 6 * d)
        self.blocks = nn.ModuleList(Block(shape) for _ in range(shape.depth))
        self.norm = nn.LayerNorm(d, elementwise_affine=False)
        self.last = nn.Linear(d, 2 * d)
        self.out = nn.Linear(d, held)
        # A patch alone does not know how its lines go on in the next one: convolutions over the whole picture do.
        self.join = _convolutions(2 * shape.channels, shape.channels, shape.channels)
        self.head = nn.Conv2d(shape.channels, 1, 3, padding=1)
        # Each block starts as the identity, and the network as zero.
        for layer in (self.known, self.last, self.head):
            for parameter in layer.parameters():
                nn.init.zeros_(parameter)

    def forward(
        self,
        noisy: Float[Tensor, "S V H W"],
        time: Float[Tensor, " S"],
        cameras: Float[Tensor, "S V 3"],
        words: Float[Tensor, "S K"],
        reference: Float[Tensor, "S 1 H W"] | None = None,
        reference_camera: Float[Tensor, "S 1 3"] | None = None,
    ) -> Float[Tensor, "S V H W"]:
        """The v = √ᾱ ε - √(1 - ᾱ) z of S objects seen by V cameras, float32.

        Args:
            noisy: ink, standardised.
            time: timestep as a fraction of all.
            cameras: azimuth and elevation in radians, distance.
            words: 1 for what the object is and has, 0 else; all 0 says nothing.
            reference: a clean view of the object, in the same units.
            reference_camera: from where.
        """
        what = self.words(words)[:, None]
        known = [self.camera(_angles(cameras)) + self.time(_waves(time))[:, None] + what]
        lines = self.stem(noisy.flatten(0, 1)[:, None])
        tokens = [self.patches(self._cut(lines)).unflatten(0, noisy.shape[:2]) + self.place]
        if reference is not None and reference_camera is not None:
            # It has no noise: as at the timestep 0.
            still = self.time(_waves(torch.zeros_like(time)))[:, None]
            known.append(self.camera(_angles(reference_camera)) + still + what)
            tokens.append(self.reference(self._cut(self.stem(reference)))[:, None] + self.place)
        views = torch.cat(known, 1)
        cells = len(self.place)
        held = (torch.cat(tokens, 1) + views[:, :, None]).flatten(1, 2)
        activated = nn.functional.silu(views)
        shared = self.known(activated).unflatten(-1, (6, -1)).repeat_interleave(cells, 1)
        for block in self.blocks:
            held = block(held, shared)
        seen = noisy.shape[1] * cells
        shift, scale = self.last(activated).repeat_interleave(cells, 1)[:, :seen].chunk(2, -1)
        found = self._joined(self.out(self.norm(held[:, :seen]) * (1 + scale) + shift).unflatten(1, (-1, cells)))
        v: Tensor = self.head(self.join(torch.cat([found, lines.to(found.dtype)], 1)))
        return v.float().reshape(noisy.shape)

    def _cut(self, features: Float[Tensor, "B C H W"]) -> Float[Tensor, "B n p"]:
        """Patches of features, row by row."""
        return nn.functional.unfold(features, self.shape.patch, stride=self.shape.patch).mT

    def _joined(self, patches: Float[Tensor, "S V n p"]) -> Float[Tensor, "B C H W"]:
        """Features of which these are the patches."""
        size, patch = self.shape.size, self.shape.patch
        return nn.functional.fold(patches.flatten(0, 1).mT, (size, size), patch, stride=patch)


# Numbers that describe a time and a camera: sines and cosines.
_WAVES, _ANGLES = 32, 4 * 2 + 3


def _waves(time: Float[Tensor, " S"]) -> Float[Tensor, "S k"]:
    """Sines and cosines of a fraction of all timesteps, from half a period to ninety."""
    rates = torch.pi * 2 ** (torch.arange(_WAVES // 2, device=time.device) / 2)
    angles = time[:, None] * rates
    return torch.cat([angles.sin(), angles.cos()], 1)


def _angles(cameras: Float[Tensor, "S V 3"]) -> Float[Tensor, "S V k"]:
    """Harmonics of the azimuth, the elevation's sine and cosine, and the distance, of order 1."""
    azimuth, elevation, distance = cameras.unbind(-1)
    harmonics = [f(k * azimuth) for k in (1, 2, 3, 4) for f in (torch.sin, torch.cos)]
    # Distances of this project's cameras lie around 1.9.
    return torch.stack([*harmonics, elevation.sin(), elevation.cos(), 5 * (distance - 1.9)], -1)


def _embedding(numbers: int, width: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(numbers, width), nn.SiLU(), nn.Linear(width, width))


def _convolutions(before: int, between: int, after: int) -> nn.Sequential:
    """Two layers that see 5 x 5 pixels."""
    first, second = nn.Conv2d(before, between, 3, padding=1), nn.Conv2d(between, after, 3, padding=1)
    return nn.Sequential(first, nn.GELU("tanh"), second, nn.GELU("tanh"))
