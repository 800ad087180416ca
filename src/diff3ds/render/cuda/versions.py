"""Versions of what compiles the kernels, and whether they fit the torch that runs them."""

from importlib import metadata

import torch

# Packages that bring NVRTC, for CUDA 13 and 12: each may be replaced by itself.
NVRTC = ("nvidia-cuda-nvrtc", "nvidia-cuda-nvrtc-cu12")


def compiler_versions() -> list[str]:
    """Of all that decides which NVRTC compiles; to load it and ask would take longer than to read what it made.

    Raises:
        PackageNotFoundError: cuda-core or cuda-bindings are not installed.
    """
    needed = [metadata.version(name) for name in ("cuda-core", "cuda-bindings")]
    return [torch.__version__, *needed, *(_version(name) for name in NVRTC)]


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def bindings_major() -> int:
    """The version of CUDA that cuda-bindings are for.

    Raises:
        PackageNotFoundError: they are not installed.
    """
    return int(metadata.version("cuda-bindings").split(".")[0])


def advice_on_bindings() -> str:
    """What to do where cuda-bindings are for a newer CUDA than torch; empty if they are not.

    A driver that is just new enough for torch loads nothing that a newer compiler made.

    Raises:
        PackageNotFoundError: they are not installed.
    """
    if torch.version.cuda is None:
        return ""
    torchs = int(torch.version.cuda.split(".")[0])
    newer = bindings_major() > torchs
    return f'torch is built for CUDA {torchs}: pip install "cuda-bindings=={torchs}.*"' if newer else ""
