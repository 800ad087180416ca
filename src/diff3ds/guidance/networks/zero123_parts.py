"""The parts of Zero-1-to-3 in either of its forms: folders in the layout of diffusers, or the original single file."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.guidance.networks.latent import Prediction, read_schedule
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.weights import convert, single_file
from diff3ds.weights.convert_clip import tower_config, tower_to_transformers
from diff3ds.weights.locate import Checkpoint
from diff3ds.weights.read import header, load_part, load_tensors, read_tensors, require_trust

# Channels of a latent; the UNet takes those of the picture as well.
LATENT = 4
# Numbers that say where a camera is.
POSE = 4
# The linear layer that joins the picture's embedding and the pose: its folder, and its name in different ports.
PROJECTION = "clip_camera_projection|cc_projection"
PREFIXES = ("proj", "projection", "cc_projection")
# What the weights of the single file do not say: latents of a side, and heads of the UNet's attention.
LATENT_SIZE, HEADS = 32, 8


@dataclass(frozen=True, eq=False)
class Projection:
    """The linear layer from the picture's embedding and a pose to a token.

    Attributes:
        weight, bias: float32.
    """

    weight: Float[Tensor, "D I"]
    bias: Float[Tensor, " D"]

    def tokens(self, embedding: Float[Tensor, " E"], poses: Float[Tensor, "B 4"]) -> Float[Tensor, "B 1 D"]:
        """One token a pose."""
        joined = torch.cat([embedding.expand(len(poses), -1), poses], 1)
        return torch.nn.functional.linear(joined, self.weight, self.bias)[:, None]


@dataclass(frozen=True, eq=False)
class Parts:
    """What is known of a checkpoint before its networks are loaded, and how to load them, each by itself, on the CPU.

    Attributes:
        schedule, prediction: of the UNet.
        projection: the linear layer.
        config: of the UNet.
        shapes: of the UNet's weights.
        embedding: numbers that the image encoder makes of a picture.
        encoder: loads the image encoder, in float32.
        unet, vae: load the network in a dtype.
    """

    schedule: NoiseSchedule
    prediction: Prediction
    projection: Projection
    config: dict[str, Any]
    shapes: tuple[tuple[int, ...], ...]
    embedding: int
    encoder: Callable[[], Any]
    unet: Callable[[torch.dtype], Any]
    vae: Callable[[torch.dtype], Any]


def read_parts(checkpoint: Checkpoint) -> Parts:
    """The parts of a checkpoint, which fit each other.

    Raises:
        ValueError: weights of another model, parts of different models, a pickle that is not trusted.
    """
    parts = _single(checkpoint) if checkpoint.path.is_file() else _folder(checkpoint)
    _check(checkpoint, parts)
    return parts


def _folder(checkpoint: Checkpoint) -> Parts:
    import diffusers
    import transformers

    schedule, prediction = read_schedule(checkpoint)
    return Parts(
        schedule,
        prediction,
        read_projection(checkpoint),
        checkpoint.config("unet"),
        tuple(header(checkpoint.file("unet")).values()),
        checkpoint.config("image_encoder").get("projection_dim", 0),
        lambda: load_part(transformers.CLIPVisionModelWithProjection, checkpoint, "image_encoder", torch.float32),
        lambda dtype: load_part(diffusers.UNet2DConditionModel, checkpoint, "unet", dtype),
        lambda dtype: load_part(diffusers.AutoencoderKL, checkpoint, "vae", dtype),
    )


def _single(checkpoint: Checkpoint) -> Parts:
    path = checkpoint.path
    require_trust(path, checkpoint.trust_pickle)
    tensors = read_tensors(path, checkpoint.trust_pickle)
    if f"{single_file.PROJECTION}weight" not in tensors or f"{single_file.PROJECTION}bias" not in tensors:
        raise ValueError(f"{path}: not a checkpoint of Zero-1-to-3: there is no {single_file.PROJECTION}weight or bias")
    weight, bias = (tensors[f"{single_file.PROJECTION}{name}"].float() for name in ("weight", "bias"))
    unet, tower = single_file.unet_weights(tensors, str(path)), single_file.part(tensors, single_file.PICTURE)
    try:
        config, seen = convert.unet_config(unet), tower_config(tower)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    config |= {"attention_head_dim": HEADS, "sample_size": LATENT_SIZE}
    return Parts(
        NoiseSchedule.scaled_linear(),
        "epsilon",
        Projection(weight, bias),
        config,
        tuple(tuple(tensor.shape) for tensor in unet.values()),
        seen["projection_dim"],
        lambda: _encoder(seen, tower, f"{path}: image encoder"),
        lambda dtype: single_file.build("UNet2DConditionModel", config, unet, dtype, f"{path}: UNet"),
        lambda dtype: single_file.build_vae(tensors, dtype, str(path)),
    )


def _encoder(config: dict[str, Any], tensors: dict[str, Tensor], what: str) -> Any:
    import transformers

    # Not on the meta device: it has numbers that are no weights, which would stay there.
    model = transformers.CLIPVisionModelWithProjection(transformers.CLIPVisionConfig(**config))
    load_tensors(model, tower_to_transformers(tensors), torch.float32, what)
    return model


def read_projection(checkpoint: Checkpoint) -> Projection:
    """The linear layer of a folder, whatever the port calls it.

    Raises:
        ValueError: the file holds anything else.
    """
    path = checkpoint.file(PROJECTION)
    tensors = read_tensors(path, checkpoint.trust_pickle)
    for prefix in PREFIXES:
        weight, bias = tensors.get(f"{prefix}.weight"), tensors.get(f"{prefix}.bias")
        if weight is None or bias is None or len(tensors) != 2:
            continue
        if weight.ndim == 2 and bias.shape == weight.shape[:1]:
            return Projection(weight.float(), bias.float())
    shapes = {name: tuple(tensor.shape) for name, tensor in list(tensors.items())[:POSE]}
    raise ValueError(f"{path}: expected the weight and bias of one linear layer, {' or '.join(PREFIXES)}, got {shapes}")


def _check(checkpoint: Checkpoint, parts: Parts) -> None:
    channels, width, size = (parts.config.get(name) for name in ("in_channels", "cross_attention_dim", "sample_size"))
    if channels != 2 * LATENT:
        raise ValueError(
            f"{checkpoint.path}: a UNet of Zero-1-to-3 takes {2 * LATENT} channels (noise and picture), this one "
            f"{channels}: other weights than those of a prior for pictures"
        )
    if width != len(parts.projection.bias):
        raise ValueError(
            f"{checkpoint.path}: the projection gives tokens of {len(parts.projection.bias)} numbers, the UNet takes "
            f"{width}: parts of different models"
        )
    given, taken = parts.embedding, parts.projection.weight.shape[1]
    if given != taken - POSE:
        raise ValueError(
            f"{checkpoint.path}: the projection takes {taken} numbers, but the image encoder gives {given}, and a pose "
            f"has {POSE}: parts of different models"
        )
    if not isinstance(size, int) or size < 1:
        raise ValueError(f"{checkpoint.path}: sample_size of the UNet must be the side of its latents, got {size}")
