"""Tiny random checkpoints in the layouts of the real ones, saved by the libraries that read those."""

import json
import string
from pathlib import Path

import torch

from diff3ds.guidance.networks.mvdream import NEGATIVE

# Weights of attention are enlarged by this: as drawn they give all tokens nearly the same attention, and what is
# attended to makes no difference that a test could see. (At 12 times the networks are chaotic: the last bit shows.)
ATTENTION_GAIN = 4.0


def save_tokenizer(folder: Path, pad: str = "!"):
    """A tokenizer of single letters, and of the words of MVDream's negative phrase, which else would be too long.

    "!" is 0, and pads as that of Stable Diffusion 2 does.
    """
    from transformers import CLIPTokenizer

    letters = [c for c in string.printable if c.isprintable() and not c.isspace() and c != "!"]
    names = ["!", *letters, "!</w>", *(f"{c}</w>" for c in letters)]
    merges = []
    for word in NEGATIVE.replace(",", "").split():
        pieces = [*word[:-1], f"{word[-1]}</w>"]
        whole = pieces[0]
        for piece in pieces[1:]:
            merges.append((whole, piece))
            whole += piece
    merges = list(dict.fromkeys(merges))
    names += dict.fromkeys(a + b for a, b in merges)
    names += ["<|startoftext|>", "<|endoftext|>"]
    tokenizer = CLIPTokenizer(
        vocab={name: i for i, name in enumerate(names)}, merges=merges, pad_token=pad, model_max_length=77
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


# MVDream


def make_mvdream_unet(latent_size: int = 8, heads=(4, 8, 16, 16)):
    """A UNet with the four levels and all 690 weights of MVDream, named as in diffusers."""
    return make_unet(
        sample_size=latent_size,
        block_out_channels=(32, 64, 128, 128),
        layers_per_block=2,
        down_block_types=("CrossAttnDownBlock2D",) * 3 + ("DownBlock2D",),
        up_block_types=("UpBlock2D",) + ("CrossAttnUpBlock2D",) * 3,
        attention_head_dim=heads,
        class_embed_type="projection",
        projection_class_embeddings_input_dim=16,
    )


def save_mvdream(folder: Path, layout: str, seed: int = 0) -> Path:
    """A checkpoint of MVDream with "stock" names, or as published by "ashawkey" or "lzq49"; the same weights in all."""
    from safetensors.torch import save_file

    torch.manual_seed(seed)
    save_text_encoder(folder / "text_encoder", save_tokenizer(folder / "tokenizer"))
    make_vae().save_pretrained(folder / "vae")
    save_scheduler(folder / "scheduler")
    unet = make_mvdream_unet()
    unet.save_pretrained(folder / "unet")
    weights, file = unet.state_dict(), folder / "unet" / "diffusion_pytorch_model.safetensors"
    if layout == "ashawkey":
        save_file({ldm_unet_name(name): tensor.contiguous() for name, tensor in weights.items()}, file)
        (folder / "unet" / "config.json").write_text(json.dumps(ASHAWKEY_CONFIG))
    if layout == "lzq49":
        camera = {n.removeprefix("class_embedding."): t for n, t in weights.items() if n.startswith("class_embedding.")}
        (folder / "camera_proj").mkdir()
        save_file(camera, folder / "camera_proj" / "diffusion_pytorch_model.safetensors")
        (folder / "camera_proj" / "config.json").write_text(json.dumps({"_class_name": "CameraMatrixEmbedding"}))
        save_file({n: t for n, t in weights.items() if not n.startswith("class_embedding.")}, file)
        gone = {"class_embed_type": None, "projection_class_embeddings_input_dim": None}
        edit_json(folder / "unet" / "config.json", **gone)
    return folder


ASHAWKEY_CONFIG = {
    "_class_name": "MultiViewUNetModel",
    "_diffusers_version": "0.25.0",
    "image_size": 8,
    "in_channels": 4,
    "out_channels": 4,
    "model_channels": 32,
    "attention_resolutions": [4, 2, 1],
    "num_res_blocks": 2,
    "channel_mult": [1, 2, 4, 4],
    "num_head_channels": 8,
    "transformer_depth": 1,
    "context_dim": 32,
    "camera_dim": 16,
}


def make_single_mvdream():
    """The tensors of the original checkpoint in one file, its UNet and its autoencoder. Heads have 64 channels."""
    from diffusers import AutoencoderKL

    torch.manual_seed(0)
    unet = make_mvdream_unet(latent_size=32, heads=(1, 1, 2, 2))
    vae = AutoencoderKL(
        block_out_channels=(32, 32, 64, 64),
        down_block_types=("DownEncoderBlock2D",) * 4,
        up_block_types=("UpDecoderBlock2D",) * 4,
        layers_per_block=1,
        latent_channels=4,
    )
    tensors = {f"model.diffusion_model.{ldm_unet_name(n)}": t.contiguous() for n, t in unet.state_dict().items()}
    for name, tensor in vae.state_dict().items():
        matrix = ".attentions." in name and tensor.ndim == 2
        tensors[f"first_stage_model.{ldm_vae_name(name)}"] = tensor[:, :, None, None] if matrix else tensor
    # What else such a file holds.
    tensors["betas"] = torch.zeros(1000)
    tensors["cond_stage_model.model.ln_final.weight"] = torch.zeros(4)
    return unet, vae, tensors


def ldm_unet_name(name: str) -> str:
    """The original name of a weight that diffusers gives this one, by walking through the original's blocks."""
    head, _, rest = name.partition(".")
    if head in ("down_blocks", "up_blocks"):
        block, kind, layer, rest = rest.split(".", 3)
        block, layer = int(block), int(layer)
        if kind == "downsamplers":
            return f"input_blocks.{3 * block + 3}.0.op.{rest.removeprefix('conv.')}"
        if kind == "upsamplers":
            # The first block up has no attention, so its step up is the second part.
            return f"output_blocks.{3 * block + 2}.{1 if block == 0 else 2}.{rest}"
        place = (
            f"input_blocks.{3 * block + layer + 1}" if head == "down_blocks" else f"output_blocks.{3 * block + layer}"
        )
        return f"{place}.0.{_ldm_resnet(rest)}" if kind == "resnets" else f"{place}.1.{rest}"
    if head == "mid_block":
        kind, layer, rest = rest.split(".", 2)
        return (
            f"middle_block.1.{rest}" if kind == "attentions" else f"middle_block.{2 * int(layer)}.{_ldm_resnet(rest)}"
        )
    ends = {"conv_in": "input_blocks.0.0", "conv_norm_out": "out.0", "conv_out": "out.2"}
    if head in ends:
        return f"{ends[head]}.{rest}"
    layer, kind = rest.split(".")
    place = {"time_embedding": "time_embed", "class_embedding": "camera_embed"}[head]
    return f"{place}.{0 if layer == 'linear_1' else 2}.{kind}"


def _ldm_resnet(name: str) -> str:
    layer, kind = name.split(".")
    layers = {"norm1": "in_layers.0", "conv1": "in_layers.2", "norm2": "out_layers.0", "conv2": "out_layers.3"}
    layers |= {"time_emb_proj": "emb_layers.1", "conv_shortcut": "skip_connection"}
    return f"{layers[layer]}.{kind}"


def ldm_vae_name(name: str) -> str:
    """The original name of a weight of an autoencoder of four levels."""
    side, _, rest = name.partition(".")
    if side not in ("encoder", "decoder"):
        return name
    if rest.startswith(("down_blocks", "up_blocks")):
        head, block, kind, layer, rest = rest.split(".", 4)
        place = f"down.{block}" if head == "down_blocks" else f"up.{3 - int(block)}"
        if kind == "resnets":
            return f"{side}.{place}.block.{layer}.{rest.replace('conv_shortcut', 'nin_shortcut')}"
        return f"{side}.{place}.{kind.removesuffix('rs')}.{rest}"
    if rest.startswith("mid_block.resnets."):
        _, _, layer, rest = rest.split(".", 3)
        return f"{side}.mid.block_{int(layer) + 1}.{rest}"
    if rest.startswith("mid_block.attentions.0."):
        layer, kind = rest.removeprefix("mid_block.attentions.0.").rsplit(".", 1)
        parts = {"group_norm": "norm", "to_q": "q", "to_k": "k", "to_v": "v", "to_out.0": "proj_out"}
        return f"{side}.mid.attn_1.{parts[layer]}.{kind}"
    return f"{side}.{rest.replace('conv_norm_out', 'norm_out')}"
