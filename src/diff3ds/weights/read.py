"""Loading weights whole or not at all: every tensor of the file into its place, none missing, none left over.

Only safetensors are read; the one exception is a single file that the user trusts by name (`Source.trust_pickle`).
"""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from pickle import UnpicklingError
from typing import Any
from zipfile import is_zipfile

import torch
import torch.serialization

from diff3ds._shapes import Tensor
from diff3ds.weights.locate import Checkpoint

# As many names of keys are shown in an error.
SHOWN = 5
# How torch names what it does not unpickle.
UNKNOWN = re.compile(r"Unsupported (?:global: GLOBAL|class) (\S+)")


class ModelCheckpoint:
    """Stands for a class of PyTorch Lightning by which its checkpoints name the state of the training beside weights.

    Nothing of Lightning is imported or run; what a file gives to it is dropped.
    """

    def __new__(cls, *given: object) -> "ModelCheckpoint":
        """One that keeps nothing."""
        return super().__new__(cls)

    def __setstate__(self, state: object) -> None:
        """Keeps nothing."""


# By this name it is looked for in a file.
ModelCheckpoint.__module__ = "pytorch_lightning.callbacks.model_checkpoint"


def load_part(kind: type[Any], checkpoint: Checkpoint, part: str, dtype: torch.dtype) -> Any:
    """A model of diffusers or transformers with the weights of a part, frozen and in evaluation mode, on the CPU.

    Args:
        kind: its class, such as diffusers.AutoencoderKL.

    Raises:
        ValueError: weights that the model does not know, lacks or has in another shape; it names them.
    """
    name = checkpoint.file(part).name
    variant = name.split(".")[1] if name.count(".") > 1 else None
    # diffusers' old and transformers' new spelling: the other one warns.
    spelling = "torch_dtype" if kind.__module__.startswith("diffusers") else "dtype"
    settings = {spelling: dtype, "variant": variant, "use_safetensors": True, "local_files_only": True}
    where = checkpoint.path / checkpoint.part(part)
    try:
        # Wrong shapes are let pass to be named here, like the rest.
        with _quiet():
            model, info = kind.from_pretrained(
                str(where), output_loading_info=True, ignore_mismatched_sizes=True, **settings
            )
    except (RuntimeError, ValueError) as error:
        raise ValueError(f"{where}: these weights do not fit {kind.__name__}: {error}") from error
    complain(str(where), info["missing_keys"], info["unexpected_keys"])
    for key in ("mismatched_keys", "error_msgs"):
        if info.get(key):
            raise ValueError(f"{where}: these weights do not fit {kind.__name__}: {list(info[key])[:SHOWN]}")
    return model.eval().requires_grad_(False)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keeps diffusers and transformers from drawing bars and from saying what the caller's errors say shorter."""
    from diffusers.utils import logging as diffusers_logging
    from transformers.utils import logging

    libraries = (diffusers_logging, logging)
    shown, said = logging.is_progress_bar_enabled(), [library.get_verbosity() for library in libraries]
    logging.disable_progress_bar()
    for library in libraries:
        library.set_verbosity_error()
    try:
        yield
    finally:
        for library, before in zip(libraries, said, strict=True):
            library.set_verbosity(before)
        if shown:
            logging.enable_progress_bar()


def load_tensors(model: torch.nn.Module, tensors: dict[str, Tensor], dtype: torch.dtype, what: str) -> None:
    """Gives a model (one on the meta device too) exactly these weights, frozen and in evaluation mode.

    Raises:
        ValueError: weights that the model does not know, lacks or has in another shape; it names them.
    """
    own = model.state_dict()
    complain(what, own.keys() - tensors.keys(), tensors.keys() - own.keys())
    for name, tensor in tensors.items():
        if tensor.shape != own[name].shape:
            raise ValueError(f"{what}: {name} must have shape {tuple(own[name].shape)}, got {tuple(tensor.shape)}")
    # Copies: parts of a mapped file start anywhere, and matrices that are aligned otherwise are multiplied otherwise.
    copies = {name: tensor.to(dtype, copy=True) for name, tensor in tensors.items()}
    model.load_state_dict(copies, strict=True, assign=True)
    model.eval().requires_grad_(False)


def complain(what: str, missing: Iterable[str], foreign: Iterable[str]) -> None:
    """Raises ValueError that names the keys, if there are any."""
    faults = []
    for label, keys in (("lacks", sorted(missing)), ("has foreign", sorted(foreign))):
        if keys:
            more = f" and {len(keys) - SHOWN} more" if len(keys) > SHOWN else ""
            faults.append(f"{label} {', '.join(keys[:SHOWN])}{more}")
    if faults:
        raise ValueError(f"{what}: not the weights of this model: it {'; it '.join(faults)}")


def read_tensors(path: Path, trust_pickle: bool = False) -> dict[str, Tensor]:
    """The tensors of a file, on the CPU.

    Raises:
        ValueError: a pickle that is not trusted, or a file that cannot be read as what it claims to be.
    """
    import safetensors
    import safetensors.torch

    if path.suffix == ".safetensors":
        try:
            return safetensors.torch.load_file(path)
        except safetensors.SafetensorError as error:
            raise ValueError(f"{path}: not a safetensors file ({error})") from error
    require_trust(path, trust_pickle)
    return unpickle(path)


def require_trust(path: Path, trust_pickle: bool) -> None:
    """Raises ValueError if a file is a pickle that is not trusted; before anything is read of it."""
    if path.suffix != ".safetensors" and not trust_pickle:
        raise ValueError(
            f"{path} is not safetensors but a pickle, which can run code of whoever made it as you. Only tensors would "
            "be unpickled (torch's weights_only), which makes that hard, not impossible. If you trust where this file "
            "comes from: --allow-pickle"
        )


def unpickle(path: Path) -> dict[str, Tensor]:
    """The tensors of a pickle that the user trusts; the only place where one is read, and only its tensors.

    Raises:
        ValueError: it holds anything else.
    """
    try:
        # Mapped: a checkpoint of training has three numbers for the optimiser beside each weight, which are not read.
        with _known_to_torch(ModelCheckpoint):
            content = torch.load(path, map_location="cpu", weights_only=True, mmap=is_zipfile(path))
    except UnpicklingError as error:
        # torch's own words are how to run the code.
        found = UNKNOWN.search(str(error))
        what = (
            f"it holds {found[1]}, which is no tensor"
            if found
            else "it holds something else, such as code, or is damaged"
        )
        raise ValueError(
            f"{path}: not a file of tensors alone: {what}. Nothing was read. Look for a copy as safetensors"
        ) from error
    except Exception as error:  # whatever a foreign file makes the reader stumble over
        said = (str(error).splitlines() or [type(error).__name__])[0]
        raise ValueError(f"{path}: not a file of tensors alone, or damaged ({said})") from error
    content = content.get("state_dict", content) if isinstance(content, dict) else None
    if not content or not all(isinstance(k, str) and isinstance(v, Tensor) for k, v in content.items()):
        raise ValueError(f"{path}: expected a dictionary of tensors")
    return dict(content)


@contextmanager
def _known_to_torch(kind: type[Any]) -> Iterator[None]:
    """Lets torch find a class by its name in pickles, as its safe_globals does from version 2.5 on."""
    before = torch.serialization.get_safe_globals()
    torch.serialization.add_safe_globals([kind])
    try:
        yield
    finally:
        torch.serialization.clear_safe_globals()
        torch.serialization.add_safe_globals(before)


def header(path: Path) -> dict[str, tuple[int, ...]]:
    """Names and shapes of the tensors in a safetensors file, without reading them.

    Raises:
        ValueError: not such a file.
    """
    import safetensors

    try:
        with safetensors.safe_open(path, "pt") as file:
            return {name: tuple(file.get_slice(name).get_shape()) for name in file.keys()}  # noqa: SIM118
    except safetensors.SafetensorError as error:
        raise ValueError(f"{path}: not a safetensors file ({error})") from error
