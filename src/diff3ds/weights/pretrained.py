"""Models of the transformers library from a local folder: checked, complete, and safetensors only."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import read_json
from diff3ds._shapes import Tensor

# Tokens that every phrase has: its start and its end.
ENDS = 2
INSTALL = "pip install 'diff3ds[diffusion]'"


def load_pretrained(folder: Path, kind: str, name: str, device: torch.device | str) -> tuple[Any, Any]:
    """A model, which takes no gradients for its weights, and its tokenizer.

    Args:
        folder: with config.json, model.safetensors and the tokenizer's files, as on the hub.
        kind: the model_type that config.json must have.
        name: the model's class in transformers.

    Raises:
        ImportError: transformers is not installed.
        FileNotFoundError: the folder or a file is missing.
        ValueError: another kind of model, or weights that are missing.
    """
    _check_files(folder, kind)
    try:
        import transformers
    except ImportError as error:
        raise ImportError(f"{name} needs the library transformers: {INSTALL}") from error
    try:
        model, found = getattr(transformers, name).from_pretrained(
            folder, use_safetensors=True, local_files_only=True, output_loading_info=True
        )
        tokenizer = transformers.AutoTokenizer.from_pretrained(folder, local_files_only=True)
    except RuntimeError as error:
        raise ValueError(f"{folder}: the weights are not those of its config.json ({error})") from error
    # transformers would fill what is missing with random numbers.
    lost = sorted(found["missing_keys"])
    if lost:
        raise ValueError(f"{folder}: {len(lost)} weights are missing, the first is {lost[0]}")
    return model.to(device).eval().requires_grad_(False), tokenizer


def _check_files(folder: Path, kind: str) -> None:
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; one with a {kind} model is needed here")
    if not (folder / "config.json").is_file():
        raise FileNotFoundError(f"{folder}: no config.json in this folder: is it a {kind} model as on the hub?")
    config = read_json(folder / "config.json")
    found = config.get("model_type") if isinstance(config, dict) else None
    if found != kind:
        raise ValueError(f"{folder}: a {kind} model is needed here, but config.json says model_type {found!r}")
    if not any(folder.glob("model*.safetensors")):
        raise FileNotFoundError(
            f"{folder}: no model.safetensors in this folder; pickles (.bin) are not read. On the hub the revision "
            "refs/pr/... by SFconvertbot often has one"
        )
    if not any((folder / name).is_file() for name in ("tokenizer.json", "vocab.json", "vocab.txt")):
        raise FileNotFoundError(f"{folder}: no tokenizer.json, vocab.json or vocab.txt: the tokenizer is missing")


def token_ids(tokenize: Callable[..., Any], phrase: str, most: int, device: torch.device | str) -> dict[str, Tensor]:
    """The tokens of a phrase with their attention mask; those beyond the model's room are cut off.

    Args:
        tokenize: a tokenizer, or what is called like one.
        most: tokens, both ends included.

    Raises:
        ValueError: an empty phrase.
    """
    tokens = tokenize(phrase, truncation=True, max_length=most, return_tensors="pt")
    if tokens["input_ids"].numel() <= ENDS:
        raise ValueError("the phrase is empty")
    return {name: tokens[name].to(device) for name in ("input_ids", "attention_mask")}
