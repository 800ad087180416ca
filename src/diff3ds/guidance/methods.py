"""The ways of score distillation: which predictions a prior is asked for, and what gradient they make."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance import formulas
from diff3ds.guidance.denoiser import Branch, Denoiser, gaussian
from diff3ds.guidance.recipe import Method
from diff3ds.guidance.upload import uploaded
from diff3ds.guidance.vsd import Particles

# Below this timestep the images of a prior's training are in reach of the noisy one (Katzir et al. 2024).
LATE = 200
# Asynchronous score distillation looks back by up to this fraction of the time since the lowest timestep (Ma et al.
# 2024).
LOOK_BACK = 0.1
# Interval score matching: timesteps between the two predictions, and at most between those of the inversion
# (Liang et al. 2024, and their code).
INTERVAL, INVERSION = 80, 200
# Score distillation via inversion: guidance of the inversion, its noise, and timesteps between its predictions
# (Lukoianov et al. 2024; their -7.5 counts from the conditional prediction).
INVERTED_GUIDANCE, INVERTED_NOISE, INVERTED_STEP = -6.5, 0.3, 100


@dataclass(frozen=True, eq=False)
class ScoreQuery:
    """The question to a prior, how these latents of renderings should change.

    Attributes:
        denoiser: the prior.
        latents: of the renderings, detached.
        timesteps: one an image.
        low: lowest timestep that the run draws.
        cameras: of the renderings.
        guidance: weight λ of classifier-free guidance.
        rescale: fraction of `formulas.rescaled`, for reconstruction.
        generator: of all noise.
        particles: what the renderings look like to the prior; for vsd, which trains it.
    """

    denoiser: Denoiser
    latents: Float[Tensor, "B C H W"]
    timesteps: Int[Tensor, " B"]
    low: int
    cameras: Cameras
    guidance: float
    rescale: float
    generator: torch.Generator
    particles: Particles | None = None

    def noise(self) -> Float[Tensor, "B C H W"]:
        """Fresh noise for the latents."""
        return gaussian(self.latents, self.generator)

    def alpha_bar(self, timesteps: Int[Tensor, " B"]) -> Float[Tensor, "B 1 1 1"]:
        """ᾱ at these timesteps."""
        return self.denoiser.schedule.alpha_bar(timesteps, self.latents)

    def predict(
        self, noisy: Float[Tensor, "B C H W"], timesteps: Int[Tensor, " B"], *branches: Branch
    ) -> Float[Tensor, "R B C H W"]:
        """Predictions of the noise by these branches."""
        return self.denoiser.predict(noisy, timesteps, self.cameras, branches)

    def guided(
        self, noisy: Float[Tensor, "B C H W"], timesteps: Int[Tensor, " B"], guidance: float | None = None
    ) -> Float[Tensor, "B C H W"]:
        """The prediction with classifier-free guidance; the negative phrase is its baseline."""
        conditional, baseline = self.predict(noisy, timesteps, "conditional", "negative")
        return formulas.guided(conditional, baseline, self.guidance if guidance is None else guidance)


@dataclass(frozen=True, eq=False)
class ScoreGradient:
    """The answer of a prior to a query.

    Attributes:
        gradient: with respect to the latents, before any weighting.
        clean: latents without noise that the prior sees in them, for pictures of the progress.
        weighted: the gradient is to be multiplied with w(t); a target in latent space has its own weight.
    """

    gradient: Float[Tensor, "B C H W"]
    clean: Float[Tensor, "B C H W"]
    weighted: bool = True


def score(method: Method, query: ScoreQuery) -> ScoreGradient:
    """Asks a prior for the gradient at the latents, by this method of score distillation."""
    methods: dict[Method, Callable[[ScoreQuery], ScoreGradient]] = {
        "sds": sds,
        "reconstruction": reconstruction,
        "csd": csd,
        "nfsd": nfsd,
        "asd": asd,
        "ism": ism,
        "sdi": sdi,
        "vsd": vsd,
    }
    return methods[method](query)


def sds(query: ScoreQuery) -> ScoreGradient:
    """Score distillation sampling (Poole et al. 2023): the guided prediction less the noise that was added."""
    noise = query.noise()
    noisy = query.denoiser.schedule.add_noise(query.latents, noise, query.timesteps)
    epsilon = query.guided(noisy, query.timesteps)
    return ScoreGradient(epsilon - noise, formulas.clean_from_epsilon(epsilon, noisy, query.alpha_bar(query.timesteps)))


def reconstruction(query: ScoreQuery) -> ScoreGradient:
    """Pulls towards the guided latents with their contrast restored (Shi et al. 2024, MVDream, section 3.4)."""
    noise = query.noise()
    noisy = query.denoiser.schedule.add_noise(query.latents, noise, query.timesteps)
    conditional, baseline = query.predict(noisy, query.timesteps, "conditional", "negative")
    kept = query.alpha_bar(query.timesteps)
    epsilon = formulas.guided(conditional, baseline, query.guidance)
    clean, plain = (formulas.clean_from_epsilon(e, noisy, kept) for e in (epsilon, conditional))
    if query.rescale:
        clean = formulas.rescaled(clean, plain, query.rescale, query.denoiser.group)
    return ScoreGradient(query.latents - clean, clean, weighted=False)


def csd(query: ScoreQuery) -> ScoreGradient:
    """Classifier score distillation (Yu et al. 2024): only what the phrase adds."""
    noisy = query.denoiser.schedule.add_noise(query.latents, query.noise(), query.timesteps)
    conditional, unconditional = query.predict(noisy, query.timesteps, "conditional", "unconditional")
    gradient = formulas.classifier_score(conditional, unconditional)
    return ScoreGradient(gradient, formulas.clean_from_epsilon(conditional, noisy, query.alpha_bar(query.timesteps)))


def nfsd(query: ScoreQuery) -> ScoreGradient:
    """Noise-free score distillation (Katzir et al. 2024): the noise that was added does not enter the gradient."""
    noisy = query.denoiser.schedule.add_noise(query.latents, query.noise(), query.timesteps)
    predictions = query.predict(noisy, query.timesteps, "conditional", "unconditional", "negative")
    late = uploaded((query.timesteps < LATE).to(noisy.dtype), noisy.device)
    gradient = formulas.noise_free(predictions[0], predictions[1], predictions[2], query.guidance, late)
    epsilon = formulas.guided(predictions[0], predictions[1], query.guidance)
    return ScoreGradient(gradient, formulas.clean_from_epsilon(epsilon, noisy, query.alpha_bar(query.timesteps)))


def asd(query: ScoreQuery) -> ScoreGradient:
    """Asynchronous score distillation (Ma et al. 2024): less the conditional prediction at a little more noise."""
    noise = query.noise()
    back = torch.rand(len(query.timesteps) // query.denoiser.group, generator=query.generator)
    shift = LOOK_BACK * (query.timesteps - query.low) * back.repeat_interleave(query.denoiser.group)
    later = (query.timesteps + shift.round().long()).clamp(max=len(query.denoiser.schedule) - 1)
    now, then = (query.denoiser.schedule.add_noise(query.latents, noise, t) for t in (query.timesteps, later))
    epsilon = query.guided(now, query.timesteps)
    (reference,) = query.predict(then, later, "conditional")
    return ScoreGradient(
        epsilon - reference, formulas.clean_from_epsilon(epsilon, now, query.alpha_bar(query.timesteps))
    )


def ism(query: ScoreQuery) -> ScoreGradient:
    """Interval score matching (Liang et al. 2024): noise from inverting the latents, not from drawing it.

    Inverts in even steps without guidance; their code has steps of 200 from a fixed grid.
    """
    before = (query.timesteps - INTERVAL).clamp(min=0)
    noisy = query.denoiser.schedule.add_noise(query.latents, query.noise(), torch.zeros_like(before))
    count = max(1, math.ceil(int(before.max()) / INVERSION))
    grid = [before * i // count for i in range(count + 1)]
    epsilon = torch.zeros_like(noisy)
    for now, then in zip(grid, [*grid[1:], query.timesteps], strict=True):
        (epsilon,) = query.predict(noisy, now, "unconditional")
        noisy = formulas.ddim_step(noisy, epsilon, query.alpha_bar(now), query.alpha_bar(then))
    guided = query.guided(noisy, query.timesteps)
    return ScoreGradient(guided - epsilon, formulas.clean_from_epsilon(guided, noisy, query.alpha_bar(query.timesteps)))


def sdi(query: ScoreQuery) -> ScoreGradient:
    """Score distillation via inversion (Lukoianov et al. 2024): towards what the prior makes of inverted latents."""
    count = max(1, math.ceil(int(query.timesteps.max()) / INVERTED_STEP))
    grid = [query.timesteps * i // count for i in range(count + 1)]
    noisy = query.latents
    for now, then in itertools.pairwise(grid):
        epsilon = query.guided(noisy, now, INVERTED_GUIDANCE)
        start, end = query.alpha_bar(now), query.alpha_bar(then)
        # Song et al. 2021, equation 16, for a step from less to more noise.
        deviation = INVERTED_NOISE * ((1 - start) / (1 - end) * (1 - end / start)).clamp(min=0).sqrt()
        noisy = formulas.ddim_step(noisy, epsilon, start, end, deviation) + deviation * query.noise()
    epsilon = query.guided(noisy, query.timesteps)
    clean = formulas.clean_from_epsilon(epsilon, noisy, query.alpha_bar(query.timesteps))
    return ScoreGradient(query.latents - clean, clean, weighted=False)


def vsd(query: ScoreQuery) -> ScoreGradient:
    """Variational score distillation (Wang et al. 2023): less what a network trained on the renderings predicts.

    Raises:
        ValueError: there is no such network.
    """
    if query.particles is None:
        raise ValueError("vsd needs particles, a network that is trained on the renderings")
    noisy = query.denoiser.schedule.add_noise(query.latents, query.noise(), query.timesteps)
    epsilon = query.guided(noisy, query.timesteps)
    own = query.particles.predict(noisy, query.timesteps, query.cameras)
    query.particles.learn(query.latents, query.cameras, query.generator)
    return ScoreGradient(epsilon - own, formulas.clean_from_epsilon(epsilon, noisy, query.alpha_bar(query.timesteps)))
