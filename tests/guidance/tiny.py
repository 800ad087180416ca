"""Tiny random checkpoints in the layouts of the real ones, saved by the libraries that read those."""

import json
import string
from pathlib import Path

import torch

# Weights of attention are enlarged by this: as drawn they give all tokens nearly the same attention, and what is
# attended to makes no difference that a test could see. (At 12 times the networks are chaotic: the last bit shows.)
ATTENTION_GAIN = 4.0


def save_tokenizer(folder: Path, pad: str = "!"):
    """A tokenizer of single characters; "!" is 0, and pads as that of Stable Diffusion 2 does."""
    from transformers import CLIPTokenizer

    letters = [c for c in string.printable if c.isprintable() and not c.isspace() and c != "!"]
    names = ["!", *letters, "!</w>", *(f"{c}</w>" for c in letters), "<|startoftext|>", "<|endoftext|>"]
    tokenizer = CLIPTokenizer(
        vocab={name: i for i, name in enumerate(names)}, merges=[], pad_token=pad, model_max_length=77
    )
    tokenizer.save_pretrained(folder)
    return tokenizer


def save_text_encoder(folder: Path, tokenizer, width: int = 32):
    """A text encoder of two layers."""
    from transformers import CLIPTextConfig, CLIPTextModel

    config = CLIPTextConfig(
        vocab_size=len(tokenizer),
        hidden_size=width,
        intermediate_size=37,
        num_attention_heads=4,
        num_hidden_layers=2,
        hidden_act="gelu",
        projection_dim=32,
        bos_token_id=tokenizer.bos_token_id,
        eos_token_id=tokenizer.eos_token_id,
        pad_token_id=tokenizer.pad_token_id,
    )
    CLIPTextModel(config).save_pretrained(folder)


def make_vae():
    """An autoencoder with the factor 8 of the real ones."""
    from diffusers import AutoencoderKL

    return AutoencoderKL(
        block_out_channels=(8, 8, 8, 8),
        down_block_types=("DownEncoderBlock2D",) * 4,
        up_block_types=("UpDecoderBlock2D",) * 4,
        layers_per_block=1,
        latent_channels=4,
        norm_num_groups=4,
        sample_size=64,
        scaling_factor=0.18215,
    )


def make_unet(**changes):
    """A UNet of Stable Diffusion's kind with two levels; its latents have a side of 8."""
    from diffusers import UNet2DConditionModel

    settings = {
        "sample_size": 8,
        "in_channels": 4,
        "out_channels": 4,
        "block_out_channels": (32, 64),
        "layers_per_block": 1,
        "down_block_types": ("CrossAttnDownBlock2D", "DownBlock2D"),
        "up_block_types": ("UpBlock2D", "CrossAttnUpBlock2D"),
        "cross_attention_dim": 32,
        "attention_head_dim": (2, 4),
        "use_linear_projection": True,
    }
    unet = UNet2DConditionModel(**(settings | changes))
    sharpen(unet)
    return unet


def sharpen(unet) -> None:
    """Attention that depends on what is attended to."""
    with torch.no_grad():
        for name, parameter in unet.named_parameters():
            if name.endswith(("to_q.weight", "to_k.weight")):
                parameter.mul_(ATTENTION_GAIN)


def save_scheduler(folder: Path, prediction: str = "epsilon") -> None:
    """The configuration of a scheduler as Stable Diffusion 2.1's repositories have it."""
    from diffusers import DDIMScheduler, PNDMScheduler

    common = {"beta_start": 0.00085, "beta_end": 0.012, "beta_schedule": "scaled_linear", "steps_offset": 1}
    if prediction == "epsilon":
        PNDMScheduler(**common, prediction_type=prediction, skip_prk_steps=True).save_pretrained(folder)
    else:
        DDIMScheduler(**common, prediction_type=prediction, clip_sample=False).save_pretrained(folder)


def save_stable_diffusion(folder: Path, prediction: str = "epsilon", pad: str = "!") -> Path:
    """A checkpoint in the layout of Stable Diffusion 2.1; the same seed gives the same weights for both predictions."""
    torch.manual_seed(0)
    save_text_encoder(folder / "text_encoder", save_tokenizer(folder / "tokenizer", pad))
    make_vae().save_pretrained(folder / "vae")
    make_unet().save_pretrained(folder / "unet")
    save_scheduler(folder / "scheduler", prediction)
    return folder


def edit_json(path: Path, **changes) -> None:
    """Changes entries of a JSON file; None removes one."""
    content = json.loads(path.read_text()) | changes
    path.write_text(json.dumps({key: value for key, value in content.items() if value is not None}))
