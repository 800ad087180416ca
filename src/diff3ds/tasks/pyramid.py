"""Coarse to fine: the target images at several sizes, and which of them a step of the fit looks at."""

import math
from dataclasses import dataclass

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.tasks.posed import downsampled

# Sizes of the levels, and the blur in pixels of renderings and targets there. Small images carry the gradient far, in
# world units, and cost little; only the last level is sharp. Empirical.
SCALES = (1 / 8, 1 / 4, 1 / 2, 1.0)
BLURS = (0.7, 0.7, 0.7, 0.0)
# The filter is cut where the renderer cuts its own.
BLUR_REACH = 3.5
# Images smaller than this show nothing.
LEAST_SIDE = 8


@dataclass(frozen=True, eq=False)
class Level:
    """Targets of all V views at one size; C channels, and the blur in pixels that they carry."""

    cameras: Cameras
    images: Float[Tensor, "V h w C"]
    blur: float


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Levels, coarse to fine, each for an equal share of the steps, and the random views of every step.

    Which views a step sees depends on the seed and the step alone, so that a resumed run sees the same.
    """

    levels: tuple[Level, ...]
    steps: int
    batch: int
    seed: int

    def level(self, step: int) -> Level:
        """The level of a step."""
        return self.levels[min(step * len(self.levels) // self.steps, len(self.levels) - 1)]

    def views(self, step: int) -> Int[Tensor, " B"]:
        """Indices of the views of a step: every view comes once before any comes again."""
        count = len(self.levels[0].cameras)
        batches = max(1, count // self.batch)
        epoch, turn = divmod(step, batches)
        # Neighbouring seeds give unrelated permutations; the factor keeps the seeds of two runs apart.
        order = torch.randperm(count, generator=torch.Generator().manual_seed(self.seed * 1_000_003 + epoch))
        return order[turn * self.batch : (turn + 1) * self.batch]

    def cameras(self, step: int, generator: torch.Generator) -> Cameras:
        """The cameras of a step, for `fit`."""
        return self.level(step).cameras[self.views(step)]

    def targets(self, step: int) -> Float[Tensor, "B h w C"]:
        """The images that the renderings of a step should show."""
        return self.level(step).images[self.views(step)]

    def blur(self, step: int) -> float:
        """The blur of a step, for `fit`."""
        return self.level(step).blur


def build_pyramid(cameras: Cameras, images: Float[Tensor, "V H W C"], steps: int, batch: int, seed: int) -> Pyramid:
    """A pyramid of the target images."""
    levels = []
    channels = images.permute(3, 0, 1, 2)
    for scale, blur in zip(SCALES, BLURS, strict=True):
        size = (max(LEAST_SIDE, round(cameras.size[0] * scale)), max(LEAST_SIDE, round(cameras.size[1] * scale)))
        small = torch.stack([_blurred(downsampled(channel, size), blur) for channel in channels], -1)
        levels.append(Level(cameras.resize(size), small, blur))
    return Pyramid(tuple(levels), steps, batch, seed)


def _blurred(images: Float[Tensor, "V H W"], blur: float) -> Float[Tensor, "V H W"]:
    """A normal filter of this standard deviation in pixels; the edge pixels go on beyond the image."""
    if blur == 0:
        return images
    reach = math.ceil(BLUR_REACH * blur)
    kernel = torch.exp(-0.5 * (torch.arange(-reach, reach + 1) / blur) ** 2)
    kernel = kernel / kernel.sum()
    padded = torch.nn.functional.pad(images[:, None], (reach,) * 4, mode="replicate")
    across = torch.nn.functional.conv2d(padded, kernel[None, None, None, :])
    return torch.nn.functional.conv2d(across, kernel[None, None, :, None])[:, 0]
