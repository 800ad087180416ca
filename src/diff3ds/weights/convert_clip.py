"""From OpenAI's names of CLIP's image tower (Radford et al. 2021) to those of transformers, and its configuration."""

import math
import re
from typing import Any

from diff3ds._shapes import Tensor

# Channels of an attention head in all of OpenAI's towers.
HEAD_CHANNELS = 64

NAMES = {
    "class_embedding": "vision_model.embeddings.class_embedding",
    "positional_embedding": "vision_model.embeddings.position_embedding.weight",
    "conv1.weight": "vision_model.embeddings.patch_embedding.weight",
    # transformers spells it so.
    "ln_pre.weight": "vision_model.pre_layrnorm.weight",
    "ln_pre.bias": "vision_model.pre_layrnorm.bias",
    "ln_post.weight": "vision_model.post_layernorm.weight",
    "ln_post.bias": "vision_model.post_layernorm.bias",
    "proj": "visual_projection.weight",
}
LAYERS = {
    "ln_1": "layer_norm1",
    "ln_2": "layer_norm2",
    "attn.out_proj": "self_attn.out_proj",
    "mlp.c_fc": "mlp.fc1",
    "mlp.c_proj": "mlp.fc2",
}
BLOCK = re.compile(r"transformer\.resblocks\.(\d+)\.(.+)[._](weight|bias)")


def tower_to_transformers(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """An image tower's weights under the names of transformers; a name without a rule stays as it is."""
    found: dict[str, Tensor] = {}
    for name, tensor in tensors.items():
        block = BLOCK.fullmatch(name)
        if not block:
            # A matrix that is multiplied from the right there.
            found[NAMES.get(name, name)] = tensor.mT.contiguous() if name == "proj" else tensor
            continue
        layer, place, kind = f"vision_model.encoder.layers.{block[1]}", block[2], block[3]
        if place == "attn.in_proj":
            for which, rows in zip("qkv", tensor.chunk(3), strict=True):
                found[f"{layer}.self_attn.{which}_proj.{kind}"] = rows
        else:
            found[f"{layer}.{LAYERS.get(place, place)}.{kind}"] = tensor
    return found


def tower_config(tensors: dict[str, Tensor]) -> dict[str, Any]:
    """What the shapes of an image tower's weights, named as by OpenAI, say of its configuration.

    Raises:
        ValueError: these are not such weights.
    """
    needed = ("conv1.weight", "positional_embedding", "proj", "transformer.resblocks.0.mlp.c_fc.weight")
    absent = [name for name in needed if name not in tensors]
    if absent:
        raise ValueError(f"not CLIP's image tower by OpenAI's names: there is no {', '.join(absent)}")
    width, _, _, patch = tensors["conv1.weight"].shape
    blocks = {found[1] for found in map(BLOCK.fullmatch, tensors) if found}
    return {
        "hidden_size": width,
        "intermediate_size": len(tensors["transformer.resblocks.0.mlp.c_fc.weight"]),
        "projection_dim": tensors["proj"].shape[1],
        "num_hidden_layers": len(blocks),
        "num_attention_heads": max(1, width // HEAD_CHANNELS),
        "patch_size": patch,
        # One position is that of the class.
        "image_size": patch * math.isqrt(len(tensors["positional_embedding"]) - 1),
        "hidden_act": "quick_gelu",
    }
