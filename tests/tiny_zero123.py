"""Tiny random checkpoints of Zero-1-to-3 in the layouts of its ports to diffusers."""

import json
from pathlib import Path

import safetensors.torch
import torch
from tiny import ldm_unet_name, ldm_vae_name, make_unet, make_vae

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


# The original single file


def save_pair(root: Path, averaged: bool = True) -> tuple[Path, dict[str, torch.Tensor]]:
    """A folder in the layout of diffusers, and the same weights as the tensors of the original file.

    Args:
        averaged: the UNet's weights are the averaged ones, beside others that were not averaged.
    """
    from diffusers import AutoencoderKL
    from transformers import CLIPVisionConfig, CLIPVisionModelWithProjection

    torch.manual_seed(0)
    sizes = {"hidden_size": 128, "intermediate_size": 48, "projection_dim": WIDTH, "image_size": 32, "patch_size": 8}
    config = CLIPVisionConfig(**sizes, num_attention_heads=2, num_hidden_layers=2, hidden_act="quick_gelu")
    encoder = CLIPVisionModelWithProjection(config)
    widths = (32, 32, 64, 64)
    vae = AutoencoderKL(
        block_out_channels=widths,
        down_block_types=("DownEncoderBlock2D",) * 4,
        up_block_types=("UpDecoderBlock2D",) * 4,
        layers_per_block=1,
        latent_channels=4,
    )
    unet = make_unet(
        sample_size=32,
        in_channels=8,
        block_out_channels=widths,
        layers_per_block=2,
        down_block_types=("CrossAttnDownBlock2D",) * 3 + ("DownBlock2D",),
        up_block_types=("UpBlock2D",) + ("CrossAttnUpBlock2D",) * 3,
        cross_attention_dim=WIDTH,
        attention_head_dim=8,
        use_linear_projection=False,
    )
    weight, bias = 3 * torch.randn(WIDTH, WIDTH + POSE), 3 * torch.randn(WIDTH)
    folder = root / "folder"
    encoder.save_pretrained(folder / "image_encoder")
    vae.save_pretrained(folder / "vae")
    unet.save_pretrained(folder / "unet")
    save_projection(folder / "cc_projection", "cc_projection", weight, bias)
    save_ddim(folder / "scheduler")
    tensors = {"betas": torch.zeros(1000), "cc_projection.weight": weight, "cc_projection.bias": bias}
    for name, tensor in unet.state_dict().items():
        original = f"diffusion_model.{ldm_unet_name(name)}"
        tensors[f"model.{original}"] = torch.zeros_like(tensor) if averaged else tensor.contiguous()
        if averaged:
            tensors[f"model_ema.{original.replace('.', '')}"] = tensor.contiguous()
    if averaged:
        tensors |= {"model_ema.decay": torch.tensor(0.9999), "model_ema.num_updates": torch.tensor(7)}
    for name, tensor in vae.state_dict().items():
        matrix = ".attentions." in name and tensor.ndim == 2
        tensors[f"first_stage_model.{ldm_vae_name(name)}"] = tensor[:, :, None, None] if matrix else tensor
    tower = {f"cond_stage_model.model.visual.{n}": t for n, t in openai_tower(encoder).items()}
    # What is left of the text tower there.
    rest = {
        "cond_stage_model.model.ln_final.weight": torch.zeros(4),
        "cond_stage_model.model.logit_scale": torch.ones(()),
    }
    return folder, tensors | tower | rest


def openai_tower(encoder) -> dict[str, torch.Tensor]:
    """The weights of an image encoder of transformers as OpenAI's CLIP has them, block by block."""
    vision, found = encoder.vision_model, {"proj": encoder.visual_projection.weight.detach().T.contiguous()}
    found["class_embedding"] = vision.embeddings.class_embedding
    found["positional_embedding"] = vision.embeddings.position_embedding.weight
    found["conv1.weight"] = vision.embeddings.patch_embedding.weight
    parts = {"ln_pre": vision.pre_layrnorm, "ln_post": vision.post_layernorm}
    for i, layer in enumerate(vision.encoder.layers):
        place, attention = f"transformer.resblocks.{i}", layer.self_attn
        parts |= {f"{place}.ln_1": layer.layer_norm1, f"{place}.ln_2": layer.layer_norm2}
        parts |= {f"{place}.mlp.c_fc": layer.mlp.fc1, f"{place}.mlp.c_proj": layer.mlp.fc2}
        parts[f"{place}.attn.out_proj"] = attention.out_proj
        joined = (attention.q_proj, attention.k_proj, attention.v_proj)
        found[f"{place}.attn.in_proj_weight"] = torch.cat([part.weight for part in joined])
        found[f"{place}.attn.in_proj_bias"] = torch.cat([part.bias for part in joined])
    for name, module in parts.items():
        found |= {f"{name}.weight": module.weight, f"{name}.bias": module.bias}
    return {name: tensor.detach().contiguous() for name, tensor in found.items()}
