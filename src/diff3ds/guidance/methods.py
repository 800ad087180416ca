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
# Asynchronous score distillation looks back by up to this share of the time since the lowest timestep (Ma et al. 2024).
LOOK_BACK = 0.1
# Interval score matching: timesteps between the two predictions, and at most between those of the inversion
# (Liang et al. 2024, and their code).
INTERVAL, INVERSION = 80, 200
# Score distillation via inversion: guidance of the inversion, its noise, and timesteps between its predictions
# (Lukoianov et al. 2024; their -7.5 counts from the conditional prediction).
INVERTED_GUIDANCE, INVERTED_NOISE, INVERTED_STEP = -6.5, 0.3, 100


@dataclass(frozen=True, eq=False)
class Look:
    """One look of a prior at renderings.

    Attributes:
        denoiser: the prior.
        latents: of the renderings, detached.
        timesteps: one an image.
        low: lowest timestep that the run draws.
        cameras: of the renderings.
        guidance: weight λ of classifier-free guidance.
        rescale: share of `formulas.rescaled`, for reconstruction.
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
class Verdict:
    """What a prior says about renderings.

    Attributes:
        gradient: with respect to the latents, before any weighting.
        clean: latents without noise that the prior sees in them, for pictures of the progress.
        weighted: the gradient is to be multiplied with w(t); a target in latent space has its own weight.
    """

    gradient: Float[Tensor, "B C H W"]
    clean: Float[Tensor, "B C H W"]
    weighted: bool = True


def judge(method: Method, look: Look) -> Verdict:
    """The verdict of a prior, by this method."""
    methods: dict[Method, Callable[[Look], Verdict]] = {
        "sds": sds,
        "reconstruction": reconstruction,
        "csd": csd,
        "nfsd": nfsd,
        "asd": asd,
        "ism": ism,
        "sdi": sdi,
        "vsd": vsd,
    }
    return methods[method](look)


def sds(look: Look) -> Verdict:
    """Score distillation sampling (Poole et al. 2023): the guided prediction less the noise that was added."""
    noise = look.noise()
    noisy = look.denoiser.schedule.add_noise(look.latents, noise, look.timesteps)
    epsilon = look.guided(noisy, look.timesteps)
    return Verdict(epsilon - noise, formulas.clean_from_epsilon(epsilon, noisy, look.alpha_bar(look.timesteps)))


def reconstruction(look: Look) -> Verdict:
    """Towards the guided latents with their contrast restored (Shi et al. 2024, MVDream, section 3.4)."""
    noise = look.noise()
    noisy = look.denoiser.schedule.add_noise(look.latents, noise, look.timesteps)
    conditional, baseline = look.predict(noisy, look.timesteps, "conditional", "negative")
    kept = look.alpha_bar(look.timesteps)
    epsilon = formulas.guided(conditional, baseline, look.guidance)
    clean, plain = (formulas.clean_from_epsilon(e, noisy, kept) for e in (epsilon, conditional))
    if look.rescale:
        clean = formulas.rescaled(clean, plain, look.rescale, look.denoiser.group)
    return Verdict(look.latents - clean, clean, weighted=False)


def csd(look: Look) -> Verdict:
    """Classifier score distillation (Yu et al. 2024): only what the phrase adds."""
    noisy = look.denoiser.schedule.add_noise(look.latents, look.noise(), look.timesteps)
    conditional, unconditional = look.predict(noisy, look.timesteps, "conditional", "unconditional")
    gradient = formulas.classifier_score(conditional, unconditional)
    return Verdict(gradient, formulas.clean_from_epsilon(conditional, noisy, look.alpha_bar(look.timesteps)))


def nfsd(look: Look) -> Verdict:
    """Noise-free score distillation (Katzir et al. 2024): the noise that was added does not enter the gradient."""
    noisy = look.denoiser.schedule.add_noise(look.latents, look.noise(), look.timesteps)
    predictions = look.predict(noisy, look.timesteps, "conditional", "unconditional", "negative")
    late = uploaded((look.timesteps < LATE).to(noisy.dtype), noisy.device)
    gradient = formulas.noise_free(predictions[0], predictions[1], predictions[2], look.guidance, late)
    epsilon = formulas.guided(predictions[0], predictions[1], look.guidance)
    return Verdict(gradient, formulas.clean_from_epsilon(epsilon, noisy, look.alpha_bar(look.timesteps)))


def asd(look: Look) -> Verdict:
    """Asynchronous score distillation (Ma et al. 2024): less the conditional prediction at a little more noise."""
    noise = look.noise()
    back = torch.rand(len(look.timesteps) // look.denoiser.group, generator=look.generator)
    shift = LOOK_BACK * (look.timesteps - look.low) * back.repeat_interleave(look.denoiser.group)
    later = (look.timesteps + shift.round().long()).clamp(max=len(look.denoiser.schedule) - 1)
    now, then = (look.denoiser.schedule.add_noise(look.latents, noise, t) for t in (look.timesteps, later))
    epsilon = look.guided(now, look.timesteps)
    (reference,) = look.predict(then, later, "conditional")
    return Verdict(epsilon - reference, formulas.clean_from_epsilon(epsilon, now, look.alpha_bar(look.timesteps)))


def ism(look: Look) -> Verdict:
    """Interval score matching (Liang et al. 2024): noise from inverting the latents, not from drawing it.

    Inverts in even steps without guidance; their code has steps of 200 from a fixed grid.
    """
    before = (look.timesteps - INTERVAL).clamp(min=0)
    noisy = look.denoiser.schedule.add_noise(look.latents, look.noise(), torch.zeros_like(before))
    count = max(1, math.ceil(int(before.max()) / INVERSION))
    grid = [before * i // count for i in range(count + 1)]
    epsilon = torch.zeros_like(noisy)
    for now, then in zip(grid, [*grid[1:], look.timesteps], strict=True):
        (epsilon,) = look.predict(noisy, now, "unconditional")
        noisy = formulas.ddim_step(noisy, epsilon, look.alpha_bar(now), look.alpha_bar(then))
    guided = look.guided(noisy, look.timesteps)
    return Verdict(guided - epsilon, formulas.clean_from_epsilon(guided, noisy, look.alpha_bar(look.timesteps)))


def sdi(look: Look) -> Verdict:
    """Score distillation via inversion (Lukoianov et al. 2024): towards what the prior makes of inverted latents."""
    count = max(1, math.ceil(int(look.timesteps.max()) / INVERTED_STEP))
    grid = [look.timesteps * i // count for i in range(count + 1)]
    noisy = look.latents
    for now, then in itertools.pairwise(grid):
        epsilon = look.guided(noisy, now, INVERTED_GUIDANCE)
        start, end = look.alpha_bar(now), look.alpha_bar(then)
        # Song et al. 2021, equation 16, for a step from less to more noise.
        deviation = INVERTED_NOISE * ((1 - start) / (1 - end) * (1 - end / start)).clamp(min=0).sqrt()
        noisy = formulas.ddim_step(noisy, epsilon, start, end, deviation) + deviation * look.noise()
    epsilon = look.guided(noisy, look.timesteps)
    clean = formulas.clean_from_epsilon(epsilon, noisy, look.alpha_bar(look.timesteps))
    return Verdict(look.latents - clean, clean, weighted=False)


def vsd(look: Look) -> Verdict:
    """Variational score distillation (Wang et al. 2023): less what a network trained on the renderings predicts.

    Raises:
        ValueError: there is no such network.
    """
    if look.particles is None:
        raise ValueError("vsd needs particles, a network that is trained on the renderings")
    noisy = look.denoiser.schedule.add_noise(look.latents, look.noise(), look.timesteps)
    epsilon = look.guided(noisy, look.timesteps)
    own = look.particles.predict(noisy, look.timesteps, look.cameras)
    look.particles.learn(look.latents, look.cameras, look.generator)
    return Verdict(epsilon - own, formulas.clean_from_epsilon(epsilon, noisy, look.alpha_bar(look.timesteps)))
