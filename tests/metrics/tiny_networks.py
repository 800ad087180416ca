"""Tiny random networks in the layouts of the published ones, for the tests of what judges images."""

import string
from pathlib import Path

import torch
from safetensors.torch import save_file

LPIPS_CHANNELS = {"alex": (64, 192, 384, 256, 256), "vgg": (64, 128, 256, 512, 512)}


def save_clip(folder: Path, patch: int = 8) -> Path:
    """A CLIP model with its tokenizer, which knows letters only."""
    from transformers import CLIPConfig, CLIPModel, CLIPTokenizer

    letters = [c for c in string.printable if c.isprintable() and not c.isspace()]
    names = [*letters, *(f"{c}</w>" for c in letters), "<|startoftext|>", "<|endoftext|>"]
    tokenizer = CLIPTokenizer(vocab={name: i for i, name in enumerate(names)}, merges=[], model_max_length=77)
    tokenizer.save_pretrained(folder)
    layers = {"intermediate_size": 37, "num_attention_heads": 4, "num_hidden_layers": 2}
    ends = {f"{end}_token_id": getattr(tokenizer, f"{end}_token_id") for end in ("bos", "eos", "pad")}
    text = {"vocab_size": len(names), "hidden_size": 32, **layers, **ends}
    vision = {"hidden_size": 32, "image_size": 32, "patch_size": patch, **layers}
    torch.manual_seed(patch)
    model = CLIPModel(CLIPConfig(text_config=text, vision_config=vision, projection_dim=16))
    # As drawn, everything looks much the same to it.
    with torch.no_grad():
        for name, parameter in model.named_parameters():
            if "projection" in name or "patch_embedding" in name or "token_embedding" in name:
                parameter.mul_(20)
    model.save_pretrained(folder)
    return folder


def save_blip(folder: Path) -> Path:
    """A BLIP model for retrieval with its tokenizer, which knows letters only."""
    from transformers import BertTokenizer, BlipConfig, BlipForImageTextRetrieval

    names = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", *string.ascii_lowercase]
    names += [f"##{c}" for c in string.ascii_lowercase]
    BertTokenizer(vocab={name: i for i, name in enumerate(names)}).save_pretrained(folder)
    layers = {"intermediate_size": 37, "num_attention_heads": 4, "num_hidden_layers": 2}
    text = {"vocab_size": len(names), "hidden_size": 32, "encoder_hidden_size": 32, **layers, "pad_token_id": 0}
    vision = {"hidden_size": 32, "image_size": 32, "patch_size": 8, **layers}
    torch.manual_seed(0)
    config = BlipConfig(text_config=text, vision_config=vision, projection_dim=16, image_text_hidden_size=16)
    model = BlipForImageTextRetrieval(config)
    with torch.no_grad():
        for name, parameter in model.named_parameters():
            if "_proj." in name or "embedding" in name:
                parameter.mul_(20)
    model.save_pretrained(folder)
    return folder


def features(backbone: str) -> dict[str, torch.Tensor]:
    """Random weights by torchvision's names and shapes, written down from its tables; a classifier's as well."""
    if backbone == "alex":
        shapes = {
            0: (64, 3, 11, 11),
            3: (192, 64, 5, 5),
            6: (384, 192, 3, 3),
            8: (256, 384, 3, 3),
            10: (256, 256, 3, 3),
        }
    else:
        numbers = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)
        channels = (3, 64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512)
        shapes = {n: (channels[i + 1], channels[i], 3, 3) for i, n in enumerate(numbers)}
    generator = torch.Generator().manual_seed(1)
    tensors = {"classifier.6.weight": torch.zeros(10, 20)}
    for number, shape in shapes.items():
        # He's initialisation keeps the size of the values through the layers.
        spread = (2 / (shape[1] * shape[2] * shape[3])) ** 0.5
        tensors[f"features.{number}.weight"] = spread * torch.randn(shape, generator=generator)
        tensors[f"features.{number}.bias"] = 0.1 * torch.randn(shape[0], generator=generator)
    return tensors


def heads(backbone: str) -> dict[str, torch.Tensor]:
    """Random weights of LPIPS's channels by the published names and shapes; they are never negative."""
    generator = torch.Generator().manual_seed(2)
    return {
        f"lin{i}.model.1.weight": torch.rand(1, n, 1, 1, generator=generator)
        for i, n in enumerate(LPIPS_CHANNELS[backbone])
    }


def resnet_shapes(width: int, blocks: tuple[int, ...], grid: int, output: int) -> dict[str, tuple[int, ...]]:
    """OpenAI's names and shapes of the image tower of a CLIP ResNet, written down from its state dict."""

    def norm(name: str, channels: int) -> dict[str, tuple[int, ...]]:
        names = ("weight", "bias", "running_mean", "running_var")
        return {f"{name}.{n}": (channels,) for n in names} | {f"{name}.num_batches_tracked": ()}

    half = width // 2
    shapes = {"conv1.weight": (half, 3, 3, 3), "conv2.weight": (half, half, 3, 3), "conv3.weight": (width, half, 3, 3)}
    shapes |= norm("bn1", half) | norm("bn2", half) | norm("bn3", width)
    before = width
    for stage, count in enumerate(blocks):
        planes = width * 2**stage
        for i in range(count):
            at = f"layer{stage + 1}.{i}"
            shapes[f"{at}.conv1.weight"] = (planes, before, 1, 1)
            shapes[f"{at}.conv2.weight"] = (planes, planes, 3, 3)
            shapes[f"{at}.conv3.weight"] = (4 * planes, planes, 1, 1)
            shapes |= norm(f"{at}.bn1", planes) | norm(f"{at}.bn2", planes) | norm(f"{at}.bn3", 4 * planes)
            if i == 0:
                shapes[f"{at}.downsample.0.weight"] = (4 * planes, before, 1, 1)
                shapes |= norm(f"{at}.downsample.1", 4 * planes)
            before = 4 * planes
    shapes["attnpool.positional_embedding"] = (grid**2 + 1, before)
    for part, rows in (("k_proj", before), ("q_proj", before), ("v_proj", before), ("c_proj", output)):
        shapes |= {f"attnpool.{part}.weight": (rows, before), f"attnpool.{part}.bias": (rows,)}
    return {f"visual.{name}": shape for name, shape in shapes.items()}


# A tower with everything that RN101's has: strides, stages of one block and of two, 4 heads.
TINY_RESNET = (8, (1, 2, 1, 1), 2, 12)


def resnet() -> dict[str, torch.Tensor]:
    """Random weights of a tiny tower, and something of a text tower."""
    generator = torch.Generator().manual_seed(3)
    tensors = {"text_projection": torch.zeros(4, 4), "logit_scale": torch.zeros(())}
    for name, shape in resnet_shapes(*TINY_RESNET).items():
        fan = max(1, torch.Size(shape[1:]).numel())
        values = torch.randn(shape, generator=generator) * (2 / fan) ** 0.5
        if name.endswith("num_batches_tracked"):
            values = torch.tensor(7)
        elif name.endswith(("running_var", "downsample.1.weight")) or (".bn" in name and name.endswith("weight")):
            values = 0.5 + torch.rand(shape, generator=generator)
        tensors[name] = values
    return tensors


def save(path: Path, tensors: dict[str, torch.Tensor]) -> Path:
    """The tensors as a safetensors file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_file(tensors, path)
    return path
