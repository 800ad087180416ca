"""How much noise a diffusion model adds at each timestep, and between which timesteps a run draws."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.guidance.recipe import TIMESTEPS
from diff3ds.guidance.upload import uploaded


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
