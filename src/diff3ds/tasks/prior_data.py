"""What the small prior is trained on: renderings of the library's members, drawn from a seed one by one."""

import hashlib
import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import torch
from torch.utils.data import Dataset

import diff3ds
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, orbit
from diff3ds.guidance.orbits import Orbits
from diff3ds.guidance.small import GROUP, angles, ink
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.phrase import STRETCHES, Request
from diff3ds.render import render
from diff3ds.sketch import Sketch
from diff3ds.tasks.exemplars import WIDTH, requested

SIZE = 64
# Of the members, so many are plain, and so many are stretched ("tall"). Empirical.
PLAIN, STRETCHED = 0.35, 0.15
# One in so many combinations of two attributes or more is left out, to see whether the network can combine.
HELD_OUT = 4
# Reference views are jittered, each control point by up to this (world units), as a hand would. Empirical.
JITTER = 0.03
AXES = ("stretch x", "stretch y", "stretch z")


@cache
def words() -> tuple[str, ...]:
    """Every category, every attribute of each, and the stretches along the axes."""
    kinds = [name for c in CATEGORIES.values() for name in (c.name, *(attribute(c.name, a.name) for a in c.attributes))]
    return (*kinds, *AXES)


def attribute(category: str, name: str) -> str:
    """The word for an attribute: those of different categories that have the same name differ."""
    return f"{category}: {name}"


def said(request: Request) -> dict[str, float]:
    """The words of a request: 1 each; of a stretch its logarithm.

    Raises:
        ValueError: it asks for more than one thing.
    """
    if request.count != 1:
        raise ValueError(f"the small prior draws one thing, not {request.count}: leave --prior out, or take exemplar")
    named = {request.category: 1.0, **{attribute(request.category, name): 1.0 for name in request.attributes}}
    return named | {axis: math.log(factor) for axis, factor in zip(AXES, request.stretch, strict=True) if factor != 1}


@cache
def combinations(category: str, held_out: bool) -> tuple[tuple[str, ...], ...]:
    """Sets of attributes that are trained on, or those that are left out.

    Which are left out depends on their names alone: it is the same in every run.
    """

    def left_out(names: tuple[str, ...]) -> bool:
        digest = hashlib.sha256("/".join((category, *names)).encode()).digest()
        return len(names) > 1 and digest[0] % HELD_OUT == 0

    return tuple(names for names in CATEGORIES[category].combinations() if left_out(names) == held_out)


def draw_request(generator: torch.Generator) -> Request:
    """What one of the training's members is."""

    def one_of(count: int) -> int:
        return int(torch.randint(count, (), generator=generator))

    names = tuple(CATEGORIES)
    category = names[one_of(len(names))]
    plain, stretched = torch.rand(2, generator=generator).tolist()
    kinds = combinations(category, False)
    attributes = () if plain < PLAIN else kinds[one_of(len(kinds))]
    factors = list(STRETCHES.values())
    stretch = factors[one_of(len(factors))] if stretched < STRETCHED else (1.0, 1.0, 1.0)
    return Request(category, attributes, 1, None, stretch)


def inked(sketch: Sketch, cameras: Cameras) -> Float[Tensor, "V H W"]:
    """The ink that cameras see of a sketch with the strokes of the built-in priors."""
    with torch.no_grad():
        seen = render(replace(sketch, width=torch.full_like(sketch.width, WIDTH)), cameras).color
    return ink(seen)[:, 0]


@dataclass(frozen=True)
class Examples(Dataset[dict[str, Tensor]]):
    """Members as four cameras see them, and as a fifth one does. Example i depends on the seed and i alone.

    Attributes:
        seed: of all.
        count: how many there are.
        size: of the images, pixels.
    """

    seed: int
    count: int
    size: int = SIZE

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> dict[str, Tensor]:
        """One member: views (V, H, W) and reference (1, H, W) as ink; cameras (V, 3) and (1, 3); words (K)."""
        (mixed,) = np.random.SeedSequence([self.seed, index]).generate_state(1)
        generator = torch.Generator().manual_seed(int(mixed))
        request = draw_request(generator)
        sketch = requested(request, generator)
        views = Orbits(GROUP, GROUP, self.size)(0, generator)
        turn, up, away, shake = torch.rand(4, generator=generator).tolist()
        camera = orbit(360 * turn - 180, 30 * up, 1.8 + 0.2 * away, size=self.size)
        values = said(request)
        return {
            "views": inked(sketch, views),
            "cameras": angles(views),
            "reference": inked(_shaken(sketch, JITTER * max(0.0, 2 * shake - 1), generator), camera),
            "reference_camera": angles(camera),
            "words": torch.tensor([values.get(word, 0.0) for word in words()]),
        }


def _shaken(sketch: Sketch, amount: float, generator: torch.Generator) -> Sketch:
    moved = amount * torch.randn(sketch.points.shape, generator=generator)
    return replace(sketch, points=sketch.points + moved)


def single_thread(worker: int) -> None:
    """What a worker process does first: the machine's cores belong to the network."""
    torch.set_num_threads(1)
    diff3ds.set_num_threads(1)


@cache
def typical_ink(seed: int = 0, count: int = 256) -> tuple[float, float]:
    """Mean and standard deviation of the ink in training images."""
    held = torch.stack([Examples(seed, count)[i]["views"] for i in range(count)])
    return float(held.mean()), float(held.std())
