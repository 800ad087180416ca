"""Stable Diffusion 2.1 as a prior: it sees each view by itself, and is told from where by words."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance import formulas
from diff3ds.guidance.denoiser import Branch
from diff3ds.guidance.device_choice import pick_device, pick_dtype
from diff3ds.guidance.networks import prompts
from diff3ds.guidance.networks.latent import (
    FACTOR,
    Autoencoder,
    LatentDenoiser,
    Prediction,
    check_memory,
    load_autoencoder,
    predict_noise,
    read_schedule,
)
from diff3ds.guidance.poses import spherical
from diff3ds.guidance.recipe import USUAL, Precision, Work
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.guidance.upload import uploaded
from diff3ds.weights.locate import find
from diff3ds.weights.read import header, load_part
from diff3ds.weights.weight_options import Source

# Directions that perpendicular negatives turn away from.
AWAY = 2


class StableDiffusion(LatentDenoiser):
    """A `Denoiser` made of Stable Diffusion's UNet and autoencoder.

    The conditional branch is the phrase with "front view", "side view", "back view" or "overhead view", whichever the
    camera has; the front is on +x.

    Attributes:
        schedule, size, group: as in `Denoiser`; group is 1.
        unet: the network.
    """

    group = 1

    def __init__(
        self,
        unet: Any,
        autoencoder: Autoencoder,
        texts: Float[Tensor, "6 L D"],
        schedule: NoiseSchedule,
        prediction: Prediction,
        perp_neg: bool = False,
    ) -> None:
        """Takes the parts; `load_stable_diffusion` has them from a checkpoint.

        Args:
            unet: a diffusers.UNet2DConditionModel.
            texts: encodings of the phrase from each of `prompts.DIRECTIONS`, the empty phrase, and the negative one.
            perp_neg: turns the conditional branch away from the directions that the camera does not have, which keeps
                faces from the back of a head; for twice the time.
        """
        super().__init__(autoencoder)
        self.schedule = schedule
        self.perp_neg = perp_neg
        self.unet = unet.eval().requires_grad_(False)
        self._texts = texts.to(unet.device)
        self._prediction = prediction

    def predict(
        self,
        noisy: Float[Tensor, "B 4 h w"],
        timesteps: Int[Tensor, " B"],
        cameras: Cameras,
        branches: Sequence[Branch],
    ) -> Float[Tensor, "R B 4 h w"]:
        """The noise as each branch predicts it; see `Denoiser`.

        Perpendicular negatives count from where guidance starts: the unconditional branch if it is asked for beside
        the conditional one (csd, nfsd), else the negative one.
        """
        azimuth, elevation, _ = spherical(cameras)
        seen, empty, negative = self._texts[:-2], self._texts[-2], self._texts[-1]
        count = (len(noisy), -1, -1)
        contexts = {"unconditional": empty.expand(count), "negative": negative.expand(count)}
        contexts["conditional"] = seen[uploaded(prompts.directions(azimuth, elevation), seen.device)]
        asked: dict[str, None] = dict.fromkeys(branches)
        if self.perp_neg and "conditional" in asked:
            plan = prompts.turned(azimuth, elevation)
            contexts["conditional"] = torch.einsum("bv,vld->bld", uploaded(plan.positive, seen.device).to(seen), seen)
            away_from = uploaded(plan.negative, seen.device)
            contexts |= {f"away {i}": seen[away_from[i]] for i in range(AWAY)}
            start = "unconditional" if "unconditional" in asked else "negative"
            asked |= dict.fromkeys((start, *(f"away {i}" for i in range(AWAY))))
        wanted = [contexts[name] for name in asked]
        found = predict_noise(self.unet, noisy, timesteps, wanted, self.schedule, self._prediction)
        epsilon = dict(zip(asked, found, strict=True))
        if self.perp_neg and "conditional" in asked:
            away = torch.stack([epsilon[f"away {i}"] for i in range(AWAY)])
            weights = uploaded(plan.weights, noisy.device).to(noisy)
            epsilon["conditional"] = formulas.perp_neg(epsilon["conditional"], epsilon[start], away, weights)
        return torch.stack([epsilon[branch] for branch in branches])


def load_stable_diffusion(
    phrase: str,
    negative: str = "",
    source: Source | None = None,
    *,
    prior: str = "stable-diffusion",
    perp_neg: bool = False,
    device: str = "auto",
    precision: Precision = "auto",
    work: Work = USUAL,
) -> StableDiffusion:
    """Stable Diffusion 2.1 for a phrase.

    Args:
        negative: what not to draw; the baseline of guidance.
        source: of the weights, 2.1 or 2.1-base; None looks for those known by `prior`.
        prior: "stable-diffusion" (512 pixels) or "stable-diffusion-768".
        perp_neg: as in `StableDiffusion`.
        device: as in `pick_device`.
        precision: of the UNet, as in `pick_dtype`.
        work: of a step, for the memory that it takes.

    Raises:
        ImportError: the extra is not installed.
        FileNotFoundError: weights are missing; it says which, and how to get them.
        ValueError: an empty or too long phrase, weights of another model, too little memory.
    """
    import diffusers

    phrases = [*prompts.seen_from(prompts.check_phrase(phrase)), "", negative]
    checkpoint, place = find(prior, source), pick_device(device)
    if not checkpoint.path.is_dir():
        raise ValueError(f"{checkpoint.path}: Stable Diffusion is read from a folder in the layout of diffusers")
    schedule, prediction = read_schedule(checkpoint)
    config = checkpoint.config("unet")
    check_unet(config, str(checkpoint.path))
    size = FACTOR * int(config["sample_size"])
    dtype = pick_dtype(precision, place, bool(config.get("upcast_attention")))
    if perp_neg:
        work = replace(work, conditions=work.conditions + AWAY)
    check_memory(header(checkpoint.file("unet")).values(), size, work, dtype, place)
    texts = prompts.encode_phrases(checkpoint, phrases, int(config["cross_attention_dim"]))
    unet = load_part(diffusers.UNet2DConditionModel, checkpoint, "unet", dtype).to(place)
    autoencoder = load_autoencoder(checkpoint, size, dtype, place, work)
    return StableDiffusion(unet, autoencoder, texts, schedule, prediction, perp_neg)


def check_unet(config: dict[str, Any], where: str) -> None:
    """Raises ValueError if a UNet's configuration is not that of a stock text-to-image model of 4 latent channels."""
    kind = config.get("_class_name")
    if kind != "UNet2DConditionModel" or "camera_dim" in config or config.get("class_embed_type"):
        raise ValueError(f"{where}: its UNet is a {kind} with a camera, not that of Stable Diffusion; is it MVDream?")
    if config.get("in_channels") != 4 or not isinstance(config.get("cross_attention_dim"), int):
        raise ValueError(
            f"{where}: expected a UNet with 4 channels and one width of text, got {config.get('in_channels')} channels "
            f"and {config.get('cross_attention_dim')}; inpainting, depth and picture models are none"
        )
