"""Tiny random checkpoints of Zero-1-to-3 in the layouts of its ports to diffusers."""

import json
from pathlib import Path

import safetensors.torch
import torch
from guidance.tiny import make_unet, make_vae

WIDTH = 24
POSE = 4


def save_image_encoder(folder: Path) -> None:
    from transformers import CLIPVisionConfig, CLIPVisionModelWithProjection

    config = CLIPVisionConfig(
        hidden_size=32,
        intermediate_size=37,
        projection_dim=WIDTH,
        num_attention_heads=4,
        num_hidden_layers=2,
        image_size=32,
        patch_size=8,
    )
    CLIPVisionModelWithProjection(config).save_pretrained(folder)


def save_projection(folder: Path, name: str, weight, bias) -> None:
    folder.mkdir()
    (folder / "config.json").write_text(json.dumps({"embedding_dim": WIDTH, "additional_embeddings": POSE}))
    tensors = {f"{name}.weight": weight, f"{name}.bias": bias}
    safetensors.torch.save_file(tensors, folder / "diffusion_pytorch_model.safetensors")


def save_ddim(folder: Path, prediction: str = "epsilon") -> None:
    """The scheduler of all ports."""
    from diffusers import DDIMScheduler

    DDIMScheduler(
        beta_start=0.00085,
        beta_end=0.012,
        beta_schedule="scaled_linear",
        clip_sample=False,
        set_alpha_to_one=False,
        steps_offset=1,
        prediction_type=prediction,
    ).save_pretrained(folder)


def save_zero123(
    folder: Path,
    projection: str = "clip_camera_projection",
    name: str = "proj",
    prediction: str = "epsilon",
    variant: str | None = None,
) -> Path:
    """The same weights in any layout; latents have a side of 8."""
    torch.manual_seed(0)
    save_image_encoder(folder / "image_encoder")
    make_vae().save_pretrained(folder / "vae", variant=variant)
    unet = make_unet(in_channels=8, cross_attention_dim=WIDTH, attention_head_dim=8, use_linear_projection=False)
    unet.save_pretrained(folder / "unet", variant=variant)
    # Tokens that matter: as drawn for a linear layer they would be small beside those of the picture's features.
    weight, bias = 3 * torch.randn(WIDTH, WIDTH + POSE), 3 * torch.randn(WIDTH)
    save_projection(folder / projection, name, weight, bias)
    save_ddim(folder / "scheduler", prediction)
    return folder
