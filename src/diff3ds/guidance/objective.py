"""Score distillation as an objective of `fit`: a prior looks at the renderings of every step."""

from typing import Protocol, runtime_checkable

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance import formulas
from diff3ds.guidance.denoiser import Denoiser, check_groups, draw_timesteps
from diff3ds.guidance.methods import ScoreQuery, score
from diff3ds.guidance.recipe import Recipe
from diff3ds.guidance.vsd import Particles


@runtime_checkable
class Pictures(Protocol):
    """What is seen of a rendering: its colours (B, H, W, 3)."""

    @property
    def color(self) -> Tensor:
        """Colours over the background, in [0, 1]."""
        ...


class ScoreDistillation:
    """An objective for `fit`: the loss whose gradient is the score gradient of a prior at the renderings.

    All that is random in a step is drawn from the seed and the step's index, so that a resumed run goes on as one that
    never stopped. `latest` keeps the clean latents that the prior last saw, for pictures of the progress. `particles`
    is the network that vsd trains, None for other methods: the one thing that a resumed run must restore.
    """

    def __init__(self, denoiser: Denoiser, recipe: Recipe, steps: int, seed: int = 0) -> None:
        self.denoiser = denoiser
        self.recipe = recipe
        self.steps = steps
        self.seed = seed
        self.latest: Float[Tensor, "B C H W"] | None = None
        self.particles = Particles(denoiser, seed) if recipe.method == "vsd" else None

    def __call__(self, rendering: Pictures, cameras: Cameras, step: int) -> Float[Tensor, ""]:
        """The loss of a step's rendering.

        Raises:
            ValueError: the number of views is no multiple of the prior's group; vsd in a run that was resumed without
                the network that it trains.
        """
        check_groups(len(cameras), self.denoiser.group)
        if self.particles is not None and self.particles.learned != step:
            had = f"has learned for {self.particles.learned} steps, this is step {step}"
            raise ValueError(f"the network that vsd trains {had}: such a run cannot be resumed without it")
        generator = step_generator(self.seed, step)
        latents = self.denoiser.encode(rendering.color, generator)
        low, high = self.recipe.annealing.bounds(step, self.steps)
        timesteps = draw_timesteps(low, high, len(cameras), self.denoiser.group, generator)
        guidance, rescale = self.recipe.guidance, self.recipe.rescale
        query = ScoreQuery(
            self.denoiser,
            latents.detach(),
            timesteps,
            self.recipe.annealing.lowest,
            cameras,
            guidance,
            rescale,
            generator,
            self.particles,
        )
        with torch.no_grad():
            found = score(self.recipe.method, query)
            gradient = found.gradient
            if found.weighted:
                gradient = formulas.weighted(query.alpha_bar(timesteps), self.recipe.weighting) * gradient
        self.latest = found.clean
        return formulas.loss_of(latents, gradient, self.recipe.clip).to(rendering.color.device)


def step_generator(seed: int, step: int) -> torch.Generator:
    """The generator of a step. torch keeps 32 bits of a seed, so both numbers are mixed into as many."""
    (mixed,) = np.random.SeedSequence([seed, step]).generate_state(1)
    return torch.Generator().manual_seed(int(mixed))
