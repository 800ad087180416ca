"""What the small prior is trained on: renderings of a library's members, drawn from a seed one by one."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from torch.utils.data import Dataset

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, orbit
from diff3ds.guidance.built_in.small import GROUP, angles, ink
from diff3ds.guidance.orbits import Orbits
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.phrase import Request, parse
from diff3ds.library.vocabulary import STRETCHES
from diff3ds.render import render, set_num_threads
from diff3ds.sketch import Sketch
from diff3ds.tasks.exact_prior.exemplars import WIDTH, arranged, requested
from diff3ds.tasks.exact_prior.sketch_folder import SketchFolder

SIZE = 64
# Of the members, so many are plain, and so many are stretched ("tall"). Empirical.
PLAIN, STRETCHED = 0.35, 0.15
# One in so many combinations of two attributes or more is left out, to see whether the network can combine.
HELD_OUT = 4
# Half of the reference views are jittered, as by a hand: control points by up to this standard deviation (world units).
# Empirical.
JITTER = 0.03
# Sketches of a folder, as fixed as they are, by this.
OWN_JITTER = 0.01
# Of the library, in pictures of the training.
SHOWN = ("a chair", "a chair with armrests", "a mug", "a house", "a car", "a tall lamp", "a bicycle", "a tree")
# What the network of the next training can be asked for; one that was trained before has its own list.
KINDS = tuple(CATEGORIES)
AXES = ("stretch x", "stretch y", "stretch z")


@cache
def words(kinds: tuple[str, ...] = KINDS) -> tuple[str, ...]:
    """Every one of the kinds, every attribute of each, and the stretches along the axes."""
    known = [CATEGORIES[kind] for kind in kinds]
    return (*(name for c in known for name in (c.name, *(attribute(c.name, a.name) for a in c.attributes))), *AXES)


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


def draw_request(generator: torch.Generator, names: Sequence[str] = KINDS) -> Request:
    """Draws what one of the training's members is to be, of kinds with these names."""

    def one_of(count: int) -> int:
        return int(torch.randint(count, (), generator=generator))

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


@runtime_checkable
class Subjects(Protocol):
    """Things that a network is trained on."""

    @property
    def words(self) -> tuple[str, ...]:
        """All that can be said of them."""
        ...

    @property
    def shown(self) -> list[dict[str, float]]:
        """Picks some of the examples, to see what a network has learned so far."""
        ...

    def draw(self, generator: torch.Generator) -> tuple[Sketch, dict[str, float]]:
        """One of them, in the unit ball, and what is said of it."""
        ...


@dataclass(frozen=True)
class BuiltIn:
    """The library of the package.

    Attributes:
        kinds: names of its categories that are drawn.
    """

    kinds: tuple[str, ...] = KINDS

    @property
    def words(self) -> tuple[str, ...]:
        """Every kind, every attribute of each, and the stretches."""
        return words(self.kinds)

    @property
    def shown(self) -> list[dict[str, float]]:
        """The same in every training."""
        return [said(parse(phrase)) for phrase in SHOWN]

    def draw(self, generator: torch.Generator) -> tuple[Sketch, dict[str, float]]:
        """A member of any of the kinds, with any attributes that are not held out."""
        request = draw_request(generator, self.kinds)
        return requested(request, generator), said(request)


@dataclass(frozen=True, eq=False)
class OwnSketches:
    """A folder of the user's: its members vary as a whole, because nothing is known of their parts.

    Attributes:
        folder: as it was read.
    """

    folder: SketchFolder

    @property
    def words(self) -> tuple[str, ...]:
        """Every noun, the words of its names, and the stretches."""
        known = (w for n in self.folder.names for w in (n.noun, *(attribute(n.noun, word) for word in n.words)))
        return (*dict.fromkeys(known), *AXES)

    @property
    def shown(self) -> list[dict[str, float]]:
        """The first few."""
        names = dict.fromkeys((name.noun, name.words) for name in self.folder.names)
        return [said(Request(*name)) for name in [*names][: len(SHOWN)]]

    def draw(self, generator: torch.Generator) -> tuple[Sketch, dict[str, float]]:
        """A member, its control points jittered a little, stretched along the axes by up to a third."""
        member = self.folder.members[int(torch.randint(len(self.folder.members), (), generator=generator))]
        x, y, z = (1.35 ** (2 * torch.rand(3, generator=generator) - 1)).tolist()
        request = Request(member.name.noun, member.name.words, 1, None, (x, y, z))
        return arranged(shaken(member.sketch, OWN_JITTER, generator), request), said(request)


@dataclass(frozen=True, eq=False)
class Examples(Dataset[dict[str, Tensor]]):
    """Members as four cameras see them, and as a fifth one does. Example i depends on the seed and i alone.

    Attributes:
        seed: of all.
        count: how many there are.
        subjects: what is drawn.
        size: of the images, pixels.
    """

    seed: int
    count: int
    subjects: Subjects = field(default_factory=BuiltIn)
    size: int = SIZE

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> dict[str, Tensor]:
        """One member: views (V, H, W) and reference (1, H, W) as ink; cameras (V, 3) and (1, 3); words (K)."""
        (mixed,) = np.random.SeedSequence([self.seed, index]).generate_state(1)
        generator = torch.Generator().manual_seed(int(mixed))
        sketch, values = self.subjects.draw(generator)
        views = Orbits(GROUP, GROUP, self.size)(0, generator)
        turn, up, away, shake = torch.rand(4, generator=generator).tolist()
        camera = orbit(360 * turn - 180, 30 * up, 1.8 + 0.2 * away, size=self.size)
        return {
            "views": inked(sketch, views),
            "cameras": angles(views),
            "reference": inked(shaken(sketch, JITTER * max(0.0, 2 * shake - 1), generator), camera),
            "reference_camera": angles(camera),
            "words": torch.tensor([values.get(word, 0.0) for word in self.subjects.words]),
        }


def shaken(sketch: Sketch, amount: float, generator: torch.Generator) -> Sketch:
    """A sketch whose control points are moved at random, by such a standard deviation (world units)."""
    moved = amount * torch.randn(sketch.points.shape, generator=generator)
    points = sketch.points + moved
    return replace(sketch, points=points if sketch.chains is None else sketch.chains.joined(points))


def single_thread(worker: int) -> None:
    """Keeps a worker process to one thread: the machine's cores belong to the network."""
    torch.set_num_threads(1)
    set_num_threads(1)


@cache
def typical_ink(subjects: Subjects, seed: int = 0, count: int = 256) -> tuple[float, float]:
    """Mean and standard deviation of the ink in training images."""
    held = torch.stack([Examples(seed, count, subjects)[i]["views"] for i in range(count)])
    return float(held.mean()), float(held.std())
