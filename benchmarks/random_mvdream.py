"""MVDream with random weights, of its real size or tiny: what a step costs does not hang on what they are."""

from typing import Any, Literal

import torch

from diff3ds.guidance.networks.latent import FACTOR, Autoencoder
from diff3ds.guidance.networks.mvdream import MVDream
from diff3ds.guidance.schedule import NoiseSchedule

Scale = Literal["full", "tiny"]

# Tokens of a phrase.
LENGTH = 77
# The configurations of the published weights, as diffusers has them (Stable Diffusion 2.1 with a camera).
UNET = {
    "sample_size": 32,
    "in_channels": 4,
    "out_channels": 4,
    "block_out_channels": (320, 640, 1280, 1280),
    "layers_per_block": 2,
    "down_block_types": ("CrossAttnDownBlock2D",) * 3 + ("DownBlock2D",),
    "up_block_types": ("UpBlock2D",) + ("CrossAttnUpBlock2D",) * 3,
    "cross_attention_dim": 1024,
    "attention_head_dim": (5, 10, 20, 20),
    "use_linear_projection": True,
    "class_embed_type": "projection",
    "projection_class_embeddings_input_dim": 16,
}
VAE = {
    "block_out_channels": (128, 256, 512, 512),
    "down_block_types": ("DownEncoderBlock2D",) * 4,
    "up_block_types": ("UpDecoderBlock2D",) * 4,
    "layers_per_block": 2,
    "latent_channels": 4,
    "scaling_factor": 0.18215,
}
TINY_UNET = {
    "sample_size": 4,
    "block_out_channels": (32, 32, 64, 64),
    "layers_per_block": 1,
    "cross_attention_dim": 32,
    "attention_head_dim": (1, 1, 2, 2),
}
TINY_VAE = {"block_out_channels": (8, 8, 8, 8), "layers_per_block": 1, "norm_num_groups": 4}


def random_mvdream(scale: Scale, device: torch.device, dtype: torch.dtype) -> MVDream:
    """The prior with random weights and a random phrase, made on the device."""
    tiny = scale == "tiny"
    unet = _random("UNet2DConditionModel", UNET | TINY_UNET if tiny else UNET, device, dtype)
    vae = _random("AutoencoderKL", VAE | TINY_VAE if tiny else VAE, device, dtype)
    config = unet.config
    texts = torch.randn(3, LENGTH, config.cross_attention_dim, device=device, dtype=dtype)
    return MVDream(unet, Autoencoder(vae, FACTOR * config.sample_size), texts, NoiseSchedule.scaled_linear())


def _random(kind: str, config: dict[str, Any], device: torch.device, dtype: torch.dtype) -> Any:
    """A model of diffusers with the weights that its layers begin with: never in float32, nor on the CPU first."""
    import diffusers

    with torch.device("meta"):
        model = getattr(diffusers, kind).from_config(config)
    # Past diffusers' own, which warns of models that must stay in float32 in parts.
    model = torch.nn.Module.to(model, dtype).to_empty(device=device)
    for module in model.modules():
        if hasattr(module, "reset_parameters"):
            module.reset_parameters()
    return model
