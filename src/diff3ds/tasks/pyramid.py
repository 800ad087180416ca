"""Coarse to fine: the target images at several sizes, and which of them a step of the fit looks at."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.tasks.resample import area_means, blurred
from diff3ds.tasks.store import Batch, Store, all_known, as_bytes, byte_array, is_all_known

# Sizes of the levels, and the blur in pixels of renderings and targets there. Small images carry the gradient far, in
# world units, and cost little; only the last level is sharp. Empirical.
SCALES = (1 / 8, 1 / 4, 1 / 2, 1.0)
BLURS = (0.7, 0.7, 0.7, 0.0)
# Images smaller than this show nothing.
LEAST_SIDE = 8
# A pixel of a level is known where all that it covers is; the rest is rounding.
KNOWN = 0.999


@dataclass(frozen=True, eq=False)
class Level:
    """Targets of all V views at one size, and the blur in pixels that they carry."""

    cameras: Cameras
    store: Store
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

    def targets(self, step: int) -> Batch:
        """What the renderings of a step should show."""
        return self.level(step).store.batch(self.views(step))

    def blur(self, step: int) -> float:
        """The blur of a step, for `fit`."""
        return self.level(step).blur


def build_pyramid(cameras: Cameras, store: Store, steps: int, batch: int, seed: int) -> Pyramid:
    """A pyramid of the target images; its largest level is the store itself."""
    levels = []
    for scale, blur in zip(SCALES, BLURS, strict=True):
        height, width = (max(LEAST_SIDE, round(side * scale)) for side in cameras.size)
        small = (height, width)
        level = store if small == cameras.size and blur == 0 else _level(store, small, blur)
        levels.append(Level(cameras.resize(small), level, blur))
    return Pyramid(tuple(levels), steps, batch, seed)


def _level(store: Store, size: tuple[int, int], blur: float) -> Store:
    count, channels = len(store), store.pixels.shape[3]
    pixels = byte_array((count, *size, channels), store.scratch)
    whole = is_all_known(store.known)
    known = all_known(count, size) if whole else byte_array((count, *size), store.scratch).view(torch.bool)
    for views in store.chunks():
        batch = store.batch(views)
        if whole:
            small = blurred(area_means(batch.pixels, size), blur)
        else:
            small, known[views] = _known_means(batch, size, blur)
        pixels[views] = as_bytes(small)
    return Store(pixels, known, store.scratch)


def _known_means(
    batch: Batch, size: tuple[int, int], blur: float
) -> tuple[Float[Tensor, "B h w C"], Bool[Tensor, "B h w"]]:
    """Means of the known pixels only: as at the borders of images, what is known goes on where nothing is."""
    share = area_means(batch.known[..., None].float(), size)
    weight = blurred(share, blur)
    means = blurred(area_means(batch.pixels * batch.known[..., None], size), blur) / weight.clamp(min=1e-6)
    known = share[..., 0] > KNOWN
    return means * known[..., None], known
