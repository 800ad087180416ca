"""Every method's gradient, written out, for a prior whose three branches differ: none takes another's baseline."""

import itertools
from collections.abc import Sequence
from typing import get_args

import pytest
import torch

import diff3ds as ds
from diff3ds.guidance.denoiser import Branch
from diff3ds.guidance.methods import ScoreGradient, ScoreQuery, score
from diff3ds.guidance.recipe import Method
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.guidance.vsd import Particles

COUNT, GROUP, GUIDANCE, RESCALE, LOW = 4, 2, 5.0, 0.5, 20
SHAPE = (COUNT, 2, 3, 3)
GAINS: dict[Branch, float] = {"conditional": 0.7, "unconditional": 0.4, "negative": 0.2}
PATTERNS: dict[Branch, float] = {"conditional": 1.0, "unconditional": 2.0, "negative": 3.0}
# What vsd's own network says.
OWN = 0.9


def says(branch: Branch, noisy: torch.Tensor, timesteps: torch.Tensor) -> torch.Tensor:
    """A prediction that depends on the latents, the timestep and the branch."""
    pattern = torch.cos(PATTERNS[branch] * torch.arange(noisy[0].numel())).reshape(noisy[0].shape)
    return GAINS[branch] * noisy + pattern * (0.2 + timesteps[:, None, None, None] / 1000)


class Stub:
    """A `Denoiser` of latents alone."""

    schedule, size, group = NoiseSchedule.scaled_linear(), 24, GROUP

    def encode(self, images: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        raise NotImplementedError

    def predict(
        self, noisy: torch.Tensor, timesteps: torch.Tensor, cameras: ds.Cameras, branches: Sequence[Branch]
    ) -> torch.Tensor:
        return torch.stack([says(branch, noisy, timesteps) for branch in branches])

    def decode(self, latents: torch.Tensor) -> torch.Tensor:
        raise NotImplementedError


class StubParticles(Particles):
    """The second network of vsd, without one."""

    def __init__(self) -> None:
        self.learned = 0

    def predict(self, noisy: torch.Tensor, timesteps: torch.Tensor, cameras: ds.Cameras) -> torch.Tensor:
        return OWN * noisy

    def learn(self, latents: torch.Tensor, cameras: ds.Cameras, generator: torch.Generator) -> torch.Tensor:
        self.learned += 1
        return torch.zeros(())


LATENTS = torch.randn(SHAPE, generator=torch.Generator().manual_seed(1))


def judged(method: Method, timestep: int) -> ScoreGradient:
    timesteps = torch.full((COUNT,), timestep)
    cameras = ds.orbit([0.0, 90.0, 180.0, 270.0], 10.0, size=24)
    generator = torch.Generator().manual_seed(7)
    particles = StubParticles() if method == "vsd" else None
    return score(method, ScoreQuery(Stub(), LATENTS, timesteps, LOW, cameras, GUIDANCE, RESCALE, generator, particles))


class Written:
    """The formulas at one timestep, with the noise that the look draws."""

    def __init__(self, timestep: int) -> None:
        self.t = timestep
        self.generator = torch.Generator().manual_seed(7)

    def kept(self, t: int) -> float:
        return float(Stub.schedule.alpha_bars[t])

    def draw(self) -> torch.Tensor:
        return torch.randn(SHAPE, generator=self.generator)

    def noised(self, noise: torch.Tensor, t: int) -> torch.Tensor:
        return self.kept(t) ** 0.5 * LATENTS + (1 - self.kept(t)) ** 0.5 * noise

    def e(self, branch: Branch, noisy: torch.Tensor, t: int) -> torch.Tensor:
        return says(branch, noisy, torch.full((COUNT,), t))

    def guided(self, noisy: torch.Tensor, t: int, weight: float = GUIDANCE, baseline: Branch = "negative"):
        unguided = self.e(baseline, noisy, t)
        return unguided + weight * (self.e("conditional", noisy, t) - unguided)

    def clean(self, e: torch.Tensor, noisy: torch.Tensor, t: int) -> torch.Tensor:
        return (noisy - (1 - self.kept(t)) ** 0.5 * e) / self.kept(t) ** 0.5

    def sds(self):
        noise = self.draw()
        noisy = self.noised(noise, self.t)
        e = self.guided(noisy, self.t)
        return e - noise, self.clean(e, noisy, self.t)

    def reconstruction(self):
        noisy = self.noised(self.draw(), self.t)
        target = self.clean(self.guided(noisy, self.t), noisy, self.t)
        plain = self.clean(self.e("conditional", noisy, self.t), noisy, self.t)
        for first in range(0, COUNT, GROUP):
            views = slice(first, first + GROUP)
            ratio = plain[views].std() / target[views].std()
            target[views] *= RESCALE * ratio + 1 - RESCALE
        return LATENTS - target, target

    def csd(self):
        noisy = self.noised(self.draw(), self.t)
        conditional = self.e("conditional", noisy, self.t)
        return conditional - self.e("unconditional", noisy, self.t), self.clean(conditional, noisy, self.t)

    def nfsd(self):
        noisy = self.noised(self.draw(), self.t)
        conditional, nothing, negative = (self.e(b, noisy, self.t) for b in get_args(Branch))
        domain = nothing if self.t < 200 else nothing - negative
        e = self.guided(noisy, self.t, baseline="unconditional")
        return domain + GUIDANCE * (conditional - nothing), self.clean(e, noisy, self.t)

    def asd(self):
        noise = self.draw()
        back = torch.rand(COUNT // GROUP, generator=self.generator).repeat_interleave(GROUP)
        later = [self.t + round(0.1 * (self.t - LOW) * float(share)) for share in back]
        reference = torch.cat([self.e("conditional", self.noised(noise, t), t)[i : i + 1] for i, t in enumerate(later)])
        noisy = self.noised(noise, self.t)
        e = self.guided(noisy, self.t)
        return e - reference, self.clean(e, noisy, self.t)

    def ddim(self, noisy: torch.Tensor, e: torch.Tensor, now: int, then: int, deviation: float = 0.0):
        kept = (1 - self.kept(then) - deviation**2) ** 0.5
        return self.kept(then) ** 0.5 * self.clean(e, noisy, now) + kept * e

    def ism(self):
        """From 0 to 80 below the timestep, in one step where that is no more than 200, and on to the timestep."""
        before = self.t - 80
        noisy = self.noised(self.draw(), 0)
        noisy = self.ddim(noisy, self.e("unconditional", noisy, 0), 0, before)
        e = self.e("unconditional", noisy, before)
        noisy = self.ddim(noisy, e, before, self.t)
        guided = self.guided(noisy, self.t)
        return guided - e, self.clean(guided, noisy, self.t)

    def sdi(self):
        """From 0 to the timestep in steps of at most 100, guided by -6.5."""
        count = -(-self.t // 100)
        grid = [self.t * i // count for i in range(count + 1)]
        noisy = LATENTS
        for now, then in itertools.pairwise(grid):
            a, b = self.kept(now), self.kept(then)
            deviation = 0.3 * ((1 - a) / (1 - b) * (1 - b / a)) ** 0.5
            noisy = self.ddim(noisy, self.guided(noisy, now, -6.5), now, then, deviation) + deviation * self.draw()
        target = self.clean(self.guided(noisy, self.t), noisy, self.t)
        return LATENTS - target, target

    def vsd(self):
        noisy = self.noised(self.draw(), self.t)
        e = self.guided(noisy, self.t)
        return e - OWN * noisy, self.clean(e, noisy, self.t)


@pytest.mark.parametrize("timestep", [150, 270])
@pytest.mark.parametrize("method", get_args(Method))
def test_every_method_is_its_formula_with_its_own_baseline(method, timestep):
    found = judged(method, timestep)
    gradient, clean = getattr(Written(timestep), method)()
    scale = float(gradient.abs().max())
    # Some hundred operations in float32.
    assert float((found.gradient - gradient).abs().max()) < 1e-4 * scale
    assert float((found.clean - clean).abs().max()) < 1e-4 * float(clean.abs().max())
    assert found.weighted is (method not in ("reconstruction", "sdi"))
