"""Files of the networks that judge images: found on this disk, in a folder or in the hub's cache, and read."""

import zipfile
from collections.abc import Collection
from pathlib import Path

from diff3ds._shapes import Tensor
from diff3ds.weights.locate import locate
from diff3ds.weights.read import read_tensors
from diff3ds.weights.weight_options import Source

# One line that turns what PyTorch saved into safetensors.
CONVERT = (
    'python -c "import torch; from safetensors.torch import save_file; '
    "save_file({{k: v.float().contiguous() for k, v in {loaded}.items()}}, '{new}')\""
)
STATE_DICT = "torch.load('{path}', map_location='cpu', weights_only=True)"
TORCHSCRIPT = "torch.jit.load('{path}', map_location='cpu').state_dict()"


def find_folder(text: str, what: str) -> Path:
    """The folder that a path, or owner/name[@revision] of the hub, means.

    Args:
        what: the model that it should hold, for messages.

    Raises:
        ValueError: neither a folder that exists nor a name.
        FileNotFoundError: the repository was never downloaded; it says how to.
    """
    path = _place(text, what, "")
    if not path.is_dir():
        raise ValueError(f"{what}: {path} is a file; give the folder with config.json and model.safetensors")
    return path


def find_file(text: str, what: str, name: str) -> Path:
    """The file that a path, or owner/name[@revision] of the hub, means.

    Args:
        what: the network whose weights it should hold, for messages.
        name: of the file in a folder or repository.

    Raises:
        ValueError: neither a file that exists nor a name.
        FileNotFoundError: the folder has no such file, or the repository was never downloaded; it says how to.
    """
    path = _place(text, what, f" {name}")
    if path.is_dir():
        path = path / name
        if not path.is_file():
            raise FileNotFoundError(f"{what}: {path.parent} has no {name}; give a file with the weights")
    return path


def read_network(path: Path, allowed: Collection[Path] = ()) -> dict[str, Tensor]:
    """The tensors of a file, on the CPU.

    Args:
        allowed: files that the user allows to be pickles, of which only tensors are read.

    Raises:
        ValueError: not a file of tensors; for one that PyTorch saved, with the command that converts it.
    """
    script = zipfile.is_zipfile(path) and any("/code/" in name for name in zipfile.ZipFile(path).namelist())
    trusted = path.resolve() in {other.resolve() for other in allowed} and not script
    if path.suffix == ".safetensors" or trusted:
        return read_tensors(path, trusted)
    loaded = (TORCHSCRIPT if script else STATE_DICT).format(path=path)
    kind = "a TorchScript archive, which is a program" if script else "not safetensors but maybe a pickle"
    raise ValueError(
        f"{path}: {kind}, which can do harm when it is read. If you trust where it comes from, convert it once:\n  "
        + CONVERT.format(loaded=loaded, new=path.with_suffix(".safetensors"))
    )


def _place(text: str, what: str, file: str) -> Path:
    try:
        source = Source.parse(text)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error
    found = locate(source)
    if found is None:
        revision = f" --revision {source.revision}" if source.revision else ""
        raise FileNotFoundError(
            f"{what}: {source} is not on this disk. Get it with\n  hf download {source.place}{file}{revision}"
        )
    return found.path
