"""The second network of variational score distillation: what the renderings look like to a prior (Wang et al. 2023).

It is the prior itself with low-rank additions to its attention, which learn to denoise the renderings of each step. It
sees the camera as the prior does: MVDream as a vector, Stable Diffusion in the words of the phrase. (The paper gives
it a camera embedding of its own.)
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance.denoiser import Denoiser, draw_timesteps, gaussian
from diff3ds.weights.locate import require_extra

# Rank of the additions, and step size of their Adam (threestudio's, and the paper's).
RANK, RATE = 4, 1e-4
ADDED_TO = ["to_q", "to_k", "to_v", "to_out.0"]


class Particles:
    """A prior's network, trained on the renderings: without its additions it is the prior as before.

    It is trained in float32, whatever the network computes in.

    Attributes:
        learned: steps of training so far.
    """

    def __init__(self, prior: Denoiser, seed: int = 0) -> None:
        """Adds to the prior's network what does nothing yet.

        Raises:
            ImportError: peft is not installed.
            ValueError: the prior has no network, or perpendicular negatives, which are no prediction of one network.
        """
        require_extra(("peft",))
        from peft import LoraConfig

        unet: Any = getattr(prior, "unet", None)
        if unet is None:
            raise ValueError("variational score distillation needs a prior with a network to train")
        if getattr(prior, "perp_neg", False):
            raise ValueError("variational score distillation does not go with perpendicular negatives")
        self.learned = 0
        self._prior, self._unet = prior, unet
        unet.add_adapter(LoraConfig(r=RANK, lora_alpha=RANK, init_lora_weights=True, target_modules=ADDED_TO))
        # The prior's own passes keep nothing; only training computes twice.
        unet.enable_gradient_checkpointing()
        generator = torch.Generator().manual_seed(seed)
        self._weights: dict[str, torch.nn.Parameter] = {}
        for name, parameter in unet.named_parameters():
            if parameter.requires_grad:
                parameter.data = parameter.data.float()
                if ".lora_A." in name:
                    # As peft draws it, but from the seed.
                    bound = 1 / math.sqrt(parameter.shape[1])
                    drawn = torch.rand(parameter.shape, generator=generator) * 2 - 1
                    parameter.data.copy_(bound * drawn)
                self._weights[name] = parameter
        self._optimizer = torch.optim.Adam(self._weights.values(), RATE)
        unet.disable_adapters()

    def predict(
        self, noisy: Float[Tensor, "B C h w"], timesteps: Int[Tensor, " B"], cameras: Cameras
    ) -> Float[Tensor, "B C h w"]:
        """The noise in noisy latents as the trained network predicts it."""
        with self._added():
            return self._prior.predict(noisy, timesteps, cameras, ("conditional",))[0]

    @contextmanager
    def _added(self) -> Iterator[None]:
        self._unet.enable_adapters()
        try:
            yield
        finally:
            self._unet.disable_adapters()

    def learn(
        self, latents: Float[Tensor, "B C h w"], cameras: Cameras, generator: torch.Generator
    ) -> Float[Tensor, ""]:
        """One step of training on latents of renderings, at any noise; returns its loss a number in them."""
        prior = self._prior
        timesteps = draw_timesteps(0, len(prior.schedule) - 1, len(latents), prior.group, generator)
        noise = gaussian(latents, generator)
        noisy = prior.schedule.add_noise(latents.detach(), noise, timesteps)
        # The way back computes once more what is not kept, so the additions must be there until its end.
        with torch.enable_grad(), self._added():
            (epsilon,) = prior.predict(noisy, timesteps, cameras, ("conditional",))
            # A sum: a mean's gradients would vanish in 16 bits. Adam does not mind the scale.
            loss: Tensor = (epsilon - noise).square().sum()
            torch.autograd.backward(loss)
        self._optimizer.step()
        self.learned += 1
        self._optimizer.zero_grad()
        return loss.detach() / noise.numel()

    def state(self) -> dict[str, Tensor]:
        """All that training has changed, by name, for a checkpoint; where it is, so that nothing waits for a copy."""
        kept = {name: parameter.detach().clone() for name, parameter in self._weights.items()}
        for name, parameter in self._weights.items():
            for moment, value in self._optimizer.state[parameter].items():
                kept[f"{name}/{moment}"] = value.detach().clone()
        return kept

    def restore(self, state: dict[str, Tensor]) -> None:
        """Goes on from what `state` gave.

        Raises:
            ValueError: that of another network.
        """
        names = {name.split("/")[0] for name in state}
        if names != self._weights.keys():
            raise ValueError("the state of another network: its additions have other names")
        for name, parameter in self._weights.items():
            parameter.data.copy_(state[name])
            moments = {key.split("/")[1]: value for key, value in state.items() if key.startswith(f"{name}/")}
            # Adam counts its steps on the CPU.
            self._optimizer.state[parameter] = {
                key: value.clone() if key == "step" else value.to(parameter, copy=True)
                for key, value in moments.items()
            }
            # There are no moments before the first step.
            self.learned = int(moments.get("step", 0))
