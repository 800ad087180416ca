"""Coarse to fine: the target images at several sizes, and which of them a step of the fit looks at."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.pictures.reading.resample import area_means, blurred
from diff3ds.pictures.store import Batch, Store, all_known, as_bytes, byte_array, is_all_known
from diff3ds.render import Analytic

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
    """Levels, coarse to fine, each for an equal fraction of the steps, and the random views of every step.

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
        """The pictures that the renderings of a step should show."""
        return self.level(step).store.batch(self.views(step))

    def antialiasing(self, step: int) -> Analytic:
        """That of a step, for `fit`."""
        return Analytic(self.level(step).blur)


def build_pyramid(cameras: Cameras, store: Store, steps: int, batch: int, seed: int) -> Pyramid:
    """A pyramid of the target images; its largest level is the store itself."""
    levels = []
    for scale, blur in zip(SCALES[:-1], BLURS[:-1], strict=True):
        height, width = (max(LEAST_SIDE, round(side * scale)) for side in cameras.size)
        size = (height, width)
        levels.append(Level(cameras.resize(size), _empty(store, size), blur))
    levels.append(Level(cameras, store, BLURS[-1]))
    for views in store.chunks():
        _fill(levels, views)
    return Pyramid(tuple(levels), steps, batch, seed)


def _fill(levels: list[Level], views: Int[Tensor, " B"]) -> None:
    """Makes the coarse levels of some views, each from the next finer one before its blur."""
    batch = levels[-1].store.batch(views)
    pixels, fraction = batch.pixels, batch.known[..., None].float()
    for level in reversed(levels[:-1]):
        pixels = area_means(pixels, level.cameras.size)
        means = blurred(pixels, level.blur)
        if not is_all_known(level.store.known):
            # Means over what is known: as at the borders of images, it goes on where nothing is known.
            fraction = area_means(fraction, level.cameras.size)
            known = fraction > KNOWN
            means = means / blurred(fraction, level.blur).clamp(min=1e-6) * known
            level.store.known[views] = known[..., 0]
        level.store.pixels[views] = as_bytes(means)


def _empty(store: Store, size: tuple[int, int]) -> Store:
    """Room for the store's pictures in another size."""
    count, channels = len(store), store.pixels.shape[3]
    whole = is_all_known(store.known)
    known = all_known(count, size) if whole else byte_array((count, *size), store.scratch).view(torch.bool)
    return Store(byte_array((count, *size, channels), store.scratch), known, store.scratch)
