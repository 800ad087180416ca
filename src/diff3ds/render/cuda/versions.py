"""Versions of what compiles the kernels, and whether they fit the torch that runs them."""

from importlib import metadata

import torch


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
