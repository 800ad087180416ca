"""From the names of latent-diffusion checkpoints to those of diffusers, and from weights to a model's configuration.

A UNet of two layers a block: `input_blocks` count the first convolution, then two layers and a step down for each
block; `output_blocks` three layers for each.
"""

import re
from typing import Any

from diff3ds._shapes import Tensor

LAYERS = 2

UNET_ENDS = {
    "time_embed.0": "time_embedding.linear_1",
    "time_embed.2": "time_embedding.linear_2",
    "camera_embed.0": "class_embedding.linear_1",
    "camera_embed.2": "class_embedding.linear_2",
    "input_blocks.0.0": "conv_in",
    "middle_block.1": "mid_block.attentions.0",
    "out.0": "conv_norm_out",
    "out.2": "conv_out",
}
UNET_RESNET = {
    "in_layers.0": "norm1",
    "in_layers.2": "conv1",
    "emb_layers.1": "time_emb_proj",
    "out_layers.0": "norm2",
    "out_layers.3": "conv2",
    "skip_connection": "conv_shortcut",
}
UNET_BLOCK = re.compile(r"(input|output)_blocks\.(\d+)\.(\d+)\.(.+)")

VAE_NAMES = (
    (re.compile(r"^encoder\.down\.(\d+)\.block\."), r"encoder.down_blocks.\1.resnets."),
    (re.compile(r"^encoder\.down\.(\d+)\.downsample\."), r"encoder.down_blocks.\1.downsamplers.0."),
    (re.compile(r"\.up\.(\d+)\.block\."), r".up_blocks.\1.resnets."),
    (re.compile(r"\.up\.(\d+)\.upsample\."), r".up_blocks.\1.upsamplers.0."),
    (re.compile(r"\.mid\.block_1\."), ".mid_block.resnets.0."),
    (re.compile(r"\.mid\.block_2\."), ".mid_block.resnets.1."),
    (re.compile(r"\.mid\.attn_1\.norm\."), ".mid_block.attentions.0.group_norm."),
    (re.compile(r"\.mid\.attn_1\.([qkv])\."), r".mid_block.attentions.0.to_\1."),
    (re.compile(r"\.mid\.attn_1\.proj_out\."), ".mid_block.attentions.0.to_out.0."),
    (re.compile(r"coder\.norm_out\."), "coder.conv_norm_out."),
    (re.compile(r"\.nin_shortcut\."), ".conv_shortcut."),
)


def unet_name(name: str) -> str:
    """The name in diffusers of a weight of a UNet; a name without a rule stays as it is."""
    for old, new in UNET_ENDS.items():
        if name.startswith(f"{old}."):
            return new + name.removeprefix(old)
    if name.startswith(("middle_block.0.", "middle_block.2.")):
        place, rest = name.removeprefix("middle_block.").split(".", 1)
        return f"mid_block.resnets.{int(place) // 2}.{_in_resnet(rest)}"
    found = UNET_BLOCK.fullmatch(name)
    if not found:
        return name
    side, number, part, rest = found[1], int(found[2]), int(found[3]), found[4]
    if side == "input":
        block, layer = divmod(number - 1, LAYERS + 1)
        if rest.startswith("op."):
            return f"down_blocks.{block}.downsamplers.0.conv.{rest.removeprefix('op.')}"
    else:
        block, layer = divmod(number, LAYERS + 1)
        # The step up is the second part of a block without attention, the third of one with.
        if rest.startswith("conv."):
            return f"up_blocks.{block}.upsamplers.0.{rest}"
    kind, rest = ("resnets", _in_resnet(rest)) if part == 0 else ("attentions", rest)
    return f"{'down' if side == 'input' else 'up'}_blocks.{block}.{kind}.{layer}.{rest}"


def _in_resnet(name: str) -> str:
    for old, new in UNET_RESNET.items():
        if name.startswith(f"{old}."):
            return new + name.removeprefix(old)
    return name


def vae_name(name: str, levels: int) -> str:
    """The name in diffusers of a weight of an autoencoder, which counts the decoder's levels from the other end."""
    for pattern, new in VAE_NAMES:
        name = pattern.sub(new, name)
    return re.sub(r"\.up_blocks\.(\d+)\.", lambda found: f".up_blocks.{levels - 1 - int(found[1])}.", name)


def to_diffusers(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """A UNet's weights under the names of diffusers, whichever of the two they have."""
    if not any(name.startswith("input_blocks.") for name in tensors):
        return tensors
    return {unet_name(name): tensor for name, tensor in tensors.items()}


def vae_to_diffusers(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """An autoencoder's weights under the names of diffusers."""
    levels = _count(tensors, r"decoder\.up\.(\d+)\.")
    named = {vae_name(name, levels): tensor for name, tensor in tensors.items()}
    # Attention by convolutions of one pixel there, by matrices here.
    return {n: t[:, :, 0, 0] if ".attentions." in n and t.ndim == 4 else t for n, t in named.items()}


def unet_config(tensors: dict[str, Tensor]) -> dict[str, Any]:
    """What the shapes of a UNet's weights say of its configuration: all but the number of heads.

    Raises:
        ValueError: these are not such weights.
    """
    absent = [name for name in ("conv_in.weight", "conv_out.weight") if name not in tensors]
    if absent:
        raise ValueError(f"not the weights of a UNet: there is no {', '.join(absent)}")
    blocks = range(_count(tensors, r"down_blocks\.(\d+)\."))
    attends = [any(name.startswith(f"down_blocks.{b}.attentions.") for name in tensors) for b in blocks]
    keys = [tensor for name, tensor in tensors.items() if name.endswith("attn2.to_k.weight")]
    if not blocks or not keys:
        raise ValueError("not the weights of a UNet that takes texts or pictures")
    cameras = tensors.get("class_embedding.linear_1.weight")
    classes: dict[str, Any] = (
        {}
        if cameras is None
        else {
            "class_embed_type": "projection",
            "projection_class_embeddings_input_dim": cameras.shape[1],
        }
    )
    return classes | {
        "in_channels": tensors["conv_in.weight"].shape[1],
        "out_channels": tensors["conv_out.weight"].shape[0],
        "block_out_channels": [_rows(tensors, f"down_blocks.{b}.resnets.0.conv1.weight") for b in blocks],
        "layers_per_block": _count(tensors, r"down_blocks\.0\.resnets\.(\d+)\."),
        "down_block_types": ["CrossAttnDownBlock2D" if a else "DownBlock2D" for a in attends],
        "up_block_types": ["CrossAttnUpBlock2D" if a else "UpBlock2D" for a in reversed(attends)],
        "cross_attention_dim": keys[0].shape[1],
        "use_linear_projection": any(n.endswith("proj_in.weight") and t.ndim == 2 for n, t in tensors.items()),
    }


def vae_config(tensors: dict[str, Tensor]) -> dict[str, Any]:
    """What the shapes of an autoencoder's weights, named as in diffusers, say of its configuration.

    Raises:
        ValueError: these are not such weights.
    """
    blocks = range(_count(tensors, r"encoder\.down_blocks\.(\d+)\."))
    if not blocks or "decoder.conv_in.weight" not in tensors:
        raise ValueError("not the weights of an autoencoder")
    return {
        "block_out_channels": [_rows(tensors, f"encoder.down_blocks.{b}.resnets.0.conv1.weight") for b in blocks],
        "down_block_types": ["DownEncoderBlock2D"] * len(blocks),
        "up_block_types": ["UpDecoderBlock2D"] * len(blocks),
        "layers_per_block": _count(tensors, r"encoder\.down_blocks\.0\.resnets\.(\d+)\."),
        "latent_channels": tensors["decoder.conv_in.weight"].shape[1],
    }


def _count(tensors: dict[str, Tensor], pattern: str) -> int:
    """One more than the highest number in names that match."""
    numbers = (re.match(pattern, name) for name in tensors)
    return 1 + max((int(found[1]) for found in numbers if found), default=-1)


def _rows(tensors: dict[str, Tensor], name: str) -> int:
    if name not in tensors:
        raise ValueError(f"not the weights of this model: there is no {name}")
    return tensors[name].shape[0]
