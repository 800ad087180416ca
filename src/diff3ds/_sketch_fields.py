"""What a sketch is given for its fields, as it keeps it: tensors of one dtype, on one device, of the right shape."""

import reprlib
from collections.abc import Sequence

import torch

from diff3ds._checks import as_numbers, kind
from diff3ds._modes import can_look_at
from diff3ds._shapes import Tensor


def marks(fixed: Tensor | None, points: Tensor, count: int) -> Tensor | None:
    """The marks of strokes, if they fit and, where that can be seen without waiting, there are any."""
    if fixed is None:
        return None
    if not isinstance(fixed, Tensor) or fixed.dtype != torch.bool:
        got = f"a tensor of {fixed.dtype}" if isinstance(fixed, Tensor) else kind(fixed)
        raise TypeError(f"fixed must be a tensor of torch.bool or None, got {got}")
    if fixed.shape != (count,):
        raise ValueError(f"fixed must have shape ({count},) for {count} strokes, got {tuple(fixed.shape)}")
    if fixed.device != points.device:
        raise ValueError(f"fixed must be on the device of points, {points.device}, got {fixed.device}")
    return None if can_look_at(fixed) and not bool(fixed.any()) else fixed


def called(field: str, texts: Sequence[str] | None, count: int) -> tuple[str, ...] | None:
    """A text of each stroke, if they fit and there are any."""
    if texts is None:
        return None
    if not isinstance(texts, list | tuple) or not all(issubclass(each, str) for each in {*map(type, texts)}):
        raise TypeError(f"{field} must be strings, one a stroke, or None, got {reprlib.repr(texts)}")
    if len(texts) != count:
        raise ValueError(f"{field} must be {count}, one a stroke, got {len(texts)}")
    return tuple(texts) if any(texts) else None


def worth(importance: Tensor | None, points: Tensor, count: int) -> Tensor | None:
    """The importance of strokes, if it fits."""
    if importance is None:
        return None
    if not isinstance(importance, Tensor) or not importance.is_floating_point():
        raise TypeError(f"importance must be a floating point tensor or None, got {kind(importance)}")
    return filled("importance", importance.detach().to(points.dtype), points, (count,))


def filled(name: str, value: object, points: Tensor, shape: tuple[int, ...], rows: str = "strokes") -> Tensor:
    """The value as a tensor of this shape, with a row for each of these, on the dtype and device of `points`."""
    if isinstance(value, Tensor):
        if not value.is_floating_point() or value.dtype != points.dtype:
            raise TypeError(f"{name} must have the dtype of points, {points.dtype}, got {value.dtype}")
        if value.device != points.device:
            raise ValueError(f"{name} must be on the device of points, {points.device}, got {value.device}")
    else:
        value = as_numbers(name, value, points.dtype, points.device)
    if (
        value.ndim < len(shape)
        and value.shape == shape[len(shape) - value.ndim :]
        and (value.ndim == 0 or name == "color")
    ):
        return value.expand(shape)
    if value.shape != shape:
        raise ValueError(f"{name} must have shape {shape} for {shape[0]} {rows}, got {tuple(value.shape)}")
    return value
