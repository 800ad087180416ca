"""Original checkpoints of latent diffusion: one file with all parts, told apart by the beginnings of their names."""

from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Tensor
from diff3ds.weights import convert
from diff3ds.weights.read import complain, header, load_tensors, read_tensors

UNET, AVERAGED, VAE, PICTURE, PROJECTION = (
    "model.diffusion_model.",
    "model_ema.diffusion_model",
    "first_stage_model.",
    "cond_stage_model.model.visual.",
    "cc_projection.",
)


def part(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The weights whose names begin so, without that beginning."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}


def unet_weights(tensors: dict[str, Tensor], what: str) -> dict[str, Tensor]:
    """A UNet's weights under the names of diffusers: the averaged ones where there are any, as the authors sample with.

    Averaged weights have the names of the others without their dots.

    Args:
        what: the file, for messages.

    Raises:
        ValueError: some weights are averaged and others are not.
    """
    weights, averages = part(tensors, UNET), part(tensors, AVERAGED)
    if averages:
        short = {name: name.replace(".", "") for name in weights}
        complain(f"{what}: averaged UNet", short.values() - averages.keys(), averages.keys() - short.values())
        weights = {name: averages[averaged] for name, averaged in short.items()}
    return convert.to_diffusers(weights)


def names_in(path: Path, trust_pickle: bool) -> set[str]:
    """Names of all weights in a file.

    Raises:
        ValueError: as `read_tensors`.
    """
    return set(header(path) if path.suffix == ".safetensors" else read_tensors(path, trust_pickle))


def build(kind: str, config: dict[str, Any], tensors: dict[str, Tensor], dtype: torch.dtype, what: str) -> Any:
    """A model of diffusers with exactly these weights.

    Raises:
        ValueError: as `load_tensors`.
    """
    import diffusers

    with torch.device("meta"):
        model = getattr(diffusers, kind).from_config(config)
    load_tensors(model, tensors, dtype, what)
    return model


def build_vae(tensors: dict[str, Tensor], dtype: torch.dtype, what: str) -> Any:
    """The autoencoder of a file.

    Raises:
        ValueError: as `build`.
    """
    # The beginning of its losses in training, which some files keep.
    own = {name: tensor for name, tensor in part(tensors, VAE).items() if not name.startswith("loss.")}
    weights = convert.vae_to_diffusers(own)
    return build("AutoencoderKL", convert.vae_config(weights), weights, dtype, f"{what}: VAE")
