"""Checks of arguments that several modules share; their errors name the argument."""

import sys

import torch

from diff3ds._shapes import Tensor


def users_level() -> int:
    """The `stacklevel` of a warning by the function that asks: that of the line outside of the package that led there.

    What torch calls itself, such as the backward pass, is not outside.
    """
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] in {"diff3ds", "torch"}:
        frame, level = frame.f_back, level + 1
    return level


def kind(value: object) -> str:
    """What a value is, for an error: the dtype of a tensor, or else the type."""
    return str(value.dtype) if isinstance(value, Tensor) else type(value).__name__


def as_numbers(
    name: str, value: object, dtype: torch.dtype | None = None, device: torch.device | None = None
) -> Tensor:
    """A number, a list of numbers or a tensor as a tensor.

    Raises:
        TypeError: it is none of these.
    """
    try:
        return torch.as_tensor(value, dtype=dtype, device=device)
    except (TypeError, ValueError, RuntimeError) as error:
        raise TypeError(f"{name} must be a number, a list of numbers or a tensor, got {kind(value)}") from error


def check_finite(**values: Tensor) -> None:
    """Raises ValueError for NaN and infinity, with which no search would end; waits for a GPU."""
    for name, value in values.items():
        if not bool(value.detach().isfinite().all()):
            raise ValueError(f"{name} must be finite, got NaN or infinity")


def check_generator(generator: object) -> None:
    """Raises TypeError for all but generators, such as a seed."""
    if not isinstance(generator, torch.Generator):
        wanted = "a torch.Generator, such as torch.Generator().manual_seed(0)"
        raise TypeError(f"generator must be {wanted}, got {generator!r}")
