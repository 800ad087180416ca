"""How much noise a diffusion model adds at each timestep, and between which timesteps a run draws."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.guidance.upload import uploaded

# Timesteps of all models here.
TIMESTEPS = 1000


@dataclass(frozen=True, eq=False)
class NoiseSchedule:
    """ᾱ of every timestep: a noisy image is √ᾱ z + √(1 - ᾱ) ε (Ho et al. 2020, equation 4).

    Attributes:
        alpha_bars: float32, falling, in (0, 1).
    """

    alpha_bars: Float[Tensor, " T"]

    @classmethod
    def scaled_linear(cls, first: float = 0.00085, last: float = 0.012) -> "NoiseSchedule":
        """√β rises evenly: Stable Diffusion, MVDream and Zero-1-to-3. Their configurations call it "linear"."""
        betas = torch.linspace(first**0.5, last**0.5, TIMESTEPS) ** 2
        return cls(torch.cumprod(1 - betas, 0))

    def noisier(self, factor: float) -> "NoiseSchedule":
        """The same with the signal-to-noise ratio ᾱ / (1 - ᾱ) of every timestep times a factor below 1.

        Large areas of a picture show what they are through more noise than a latent's few numbers do (Hoogeboom et al.
        2023, simple diffusion, equation 3; Chen 2023).
        """
        kept = factor * self.alpha_bars
        return NoiseSchedule(kept / (kept + 1 - self.alpha_bars))

    def __len__(self) -> int:
        return len(self.alpha_bars)

    def alpha_bar(self, timesteps: Int[Tensor, " B"], like: Tensor) -> Float[Tensor, "B 1 1 1"]:
        """ᾱ at these timesteps, to be multiplied with images on the device of `like`, in float32.

        Timesteps are drawn on the CPU, where the schedule is: a look-up there makes no device wait.
        """
        return uploaded(self.alpha_bars[timesteps.cpu()], like.device)[:, None, None, None]

    def add_noise(
        self, latents: Float[Tensor, "B C H W"], noise: Float[Tensor, "B C H W"], timesteps: Int[Tensor, " B"]
    ) -> Float[Tensor, "B C H W"]:
        """√ᾱ z + √(1 - ᾱ) ε, in float32 whatever the model computes in."""
        kept = self.alpha_bar(timesteps, latents)
        return kept.sqrt() * latents.float() + (1 - kept).sqrt() * noise.float()


@dataclass(frozen=True)
class TimeAnnealing:
    """Timesteps that a step draws from: from high noise, which settles the shape, to low noise, which settles details.

    The paper: 0.85 at first; over 3,600 of 4,000 steps down to between 0.10 and 0.30; then constant.

    Attributes:
        low, high: share of all timesteps between which the first step draws.
        final_low, final_high: the same after the annealing.
        share: share of the steps that the annealing takes; 0 has the final bounds from the start.
    """

    low: float = 0.85
    high: float = 0.85
    final_low: float = 0.10
    final_high: float = 0.30
    share: float = 0.9

    def __post_init__(self) -> None:
        for low, high in ((self.low, self.high), (self.final_low, self.final_high)):
            if not 0 < low <= high < 1:
                raise ValueError(f"timesteps must be drawn between shares 0 < low <= high < 1, got {low} and {high}")
        if not 0 <= self.share <= 1:
            raise ValueError(f"share must lie in [0, 1], got {self.share}")

    @property
    def lowest(self) -> int:
        """The lowest timestep of the whole run."""
        return round(TIMESTEPS * min(self.low, self.final_low))

    def bounds(self, step: int, steps: int) -> tuple[int, int]:
        """Lowest and highest timestep of this step (counted from 0) of so many, both inclusive.

        Rounded, twice so that the error of the interpolation does not count: 0.10 comes as 0.0999..., of which
        truncation would make 99.
        """
        done = min(1.0, step / (self.share * steps)) if self.share else 1.0
        ends = ((self.low, self.final_low), (self.high, self.final_high))
        low, high = (round(round(TIMESTEPS * (first + (last - first) * done), 6)) for first, last in ends)
        return low, high
