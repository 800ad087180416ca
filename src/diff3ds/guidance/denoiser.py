"""What every diffusion prior offers: encode, predict the noise, decode."""

from collections.abc import Sequence
from typing import Literal, Protocol, runtime_checkable

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.guidance.upload import uploaded

# What a prediction is conditioned on: the phrase or picture; nothing at all; or the negative phrase, which is nothing
# at all too where a prior has none. Cameras condition every branch alike.
Branch = Literal["conditional", "unconditional", "negative"]


@runtime_checkable
class Denoiser(Protocol):
    """A diffusion prior that looks at B images from B cameras.

    Attributes:
        schedule: the noise it was trained with.
        size: height and width of the images that it takes, pixels.
        group: so many consecutive images show one object and are denoised together; B is a multiple of it.
    """

    schedule: NoiseSchedule
    size: int
    group: int

    def encode(self, images: Float[Tensor, "B H W 3"], generator: torch.Generator) -> Float[Tensor, "B C h w"]:
        """Latents of images in [0, 1] of any size, float32, on the prior's device, with gradients to the images."""
        ...

    def predict(
        self,
        noisy: Float[Tensor, "B C h w"],
        timesteps: Int[Tensor, " B"],
        cameras: Cameras,
        branches: Sequence[Branch],
    ) -> Float[Tensor, "R B C h w"]:
        """The noise ε in noisy latents as each branch predicts it, float32, without gradients."""
        ...

    def decode(self, latents: Float[Tensor, "B C h w"]) -> Float[Tensor, "B H W 3"]:
        """Images in [0, 1], on the CPU, without gradients."""
        ...


def draw_timesteps(low: int, high: int, count: int, group: int, generator: torch.Generator) -> Int[Tensor, " B"]:
    """A timestep for each of `count` images, uniform in [low, high], the same for all images of a group."""
    drawn = torch.randint(low, high + 1, (count // group,), generator=generator)
    return drawn.repeat_interleave(group)


def gaussian(like: Tensor, generator: torch.Generator) -> Tensor:
    """Standard normal noise of a tensor's shape, float32, on its device.

    Drawn on the CPU: a seed means the same there and on a GPU.
    """
    return uploaded(torch.randn(like.shape, generator=generator), like.device)


def check_groups(count: int, group: int) -> None:
    """Raises ValueError if so many views cannot be denoised in groups of this size."""
    if count < 1 or count % group:
        raise ValueError(f"this prior sees {group} views of an object at once: give a multiple of {group}, got {count}")
