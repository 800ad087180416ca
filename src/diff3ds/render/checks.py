"""Checks and conversions of what the renderer is given."""

import functools
import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._modes import check_plain
from diff3ds._shapes import Tensor
from diff3ds.camera import Cameras
from diff3ds.project import Strokes2D
from diff3ds.sketch import Sketch

Background = float | Sequence[float] | Tensor

# Coordinates in pixels beyond this cannot come from a drawing; their squares would overflow.
MAX_COORDINATE = 1e100
# Those of the kernels, where a call is short.
_GRAY_DTYPES = {torch.float32: np.float32, torch.float64: np.float64}


class InvalidStrokeError(ValueError):
    """A stroke with a value that cannot be drawn."""


def check_scene(sketch: object, cameras: object, drawn_by: str = "render") -> None:
    """Raises TypeError if these are no sketch and no cameras, with the name of the function that they were given to."""
    if not isinstance(sketch, Sketch) or not isinstance(cameras, Cameras):
        got = f"{type(sketch).__name__} and {type(cameras).__name__}"
        several = ": render_batch takes several, of any sizes; concatenate of Sketch and of Cameras joins them"
        hint = several if isinstance(sketch, list | tuple) or isinstance(cameras, list | tuple) else ""
        raise TypeError(f"{drawn_by} takes a Sketch and Cameras, got {got}{hint}")


def check_strokes(strokes: Strokes2D) -> None:
    """Raises TypeError or ValueError if types, shapes, dtypes or devices do not fit; no look at values."""
    if not isinstance(strokes, Strokes2D):
        raise TypeError(f"strokes must be Strokes2D, got {type(strokes).__name__}")
    for name in ("cubics", "half_width", "color", "opacity"):
        if not isinstance(getattr(strokes, name), Tensor):
            raise TypeError(f"{name} must be a tensor, got {type(getattr(strokes, name)).__name__}")
    cubics, color = strokes.cubics, strokes.color
    if cubics.ndim != 4 or cubics.shape[2:] != (4, 4) or cubics.dtype != torch.float64:
        raise ValueError(f"cubics must be float64 of shape (V, N, 4, 4), got {cubics.dtype} of {tuple(cubics.shape)}")
    views, segments = cubics.shape[:2]
    chains = strokes.chains
    if chains is not None and (len(chains.stroke) != segments or chains.stroke.device != cubics.device):
        got = f"{len(chains.stroke)} on {chains.stroke.device}"
        raise ValueError(f"chains must be of the {segments} segments of cubics, on {cubics.device}, got {got}")
    count = segments if chains is None else len(chains)
    expected: dict[str, list[tuple[int, ...]]] = {
        "half_width": [(1, count), (views, count), (1, segments, 4), (views, segments, 4)],
        "color": [(count, 3)],
        "opacity": [(count,)],
    }
    for name, shapes in expected.items():
        value = getattr(strokes, name)
        if tuple(value.shape) not in shapes:
            wanted = " or ".join(map(str, shapes))
            raise ValueError(f"{name} must have shape {wanted} for {count} strokes, got {tuple(value.shape)}")
        if value.dtype != color.dtype or not value.is_floating_point():
            raise TypeError(f"{name} must have the floating point dtype of color, {color.dtype}, got {value.dtype}")
        if value.device != cubics.device:
            raise ValueError(f"{name} must be on the device of cubics, {cubics.device}, got {value.device}")
    if (square := strokes.square) is not None:
        if square.shape != (views, 2, 2) or square.dtype != torch.float64 or square.device != cubics.device:
            got = f"{square.dtype} of {tuple(square.shape)} on {square.device}"
            raise ValueError(f"square must be float64 of shape ({views}, 2, 2) on {cubics.device}, got {got}")
        check_plain(square=square)
    check_plain(cubics=cubics, half_width=strokes.half_width, color=color, opacity=strokes.opacity)
    if strokes.width_space not in ("image", "world"):
        raise ValueError(f'width_space must be "image" or "world", got {strokes.width_space!r}')
    if not isinstance(strokes.orthographic, bool):
        raise TypeError(f"orthographic must be True or False, got {type(strokes.orthographic).__name__}")
    if strokes.orthographic and strokes.width_space != "image":
        raise ValueError(
            f'orthographic strokes have half widths in pixels (width_space="image"), got {strokes.width_space!r}'
        )
    if not 0 < strokes.near < math.inf:
        raise ValueError(f"near must be a positive number, got {strokes.near}")


def check_stroke_values(strokes: Strokes2D) -> None:
    """Raises InvalidStrokeError for the first value out of range; names the field, the view, stroke and value."""
    cubics = strokes.cubics.detach()
    weights = cubics[..., strokes.depth_ratio[1]]
    rules = {
        "cubics": (cubics, cubics.abs() < MAX_COORDINATE, f"finite, below {MAX_COORDINATE:g}"),
        f"cubics (the weights {'Z' if strokes.orthographic else 'W'})": (weights, weights > 0, "positive"),
    }
    width, color, opacity = (getattr(strokes, name).detach() for name in ("half_width", "color", "opacity"))
    rules["half_width"] = (width, (width >= 0) & (width < MAX_COORDINATE), "finite and not negative")
    rules["color"] = (color[None], color[None].isfinite(), "finite")
    rules["opacity"] = (opacity[None], (opacity[None] >= 0) & (opacity[None] <= 1), "in [0, 1]")
    for name, (value, good, expected) in rules.items():
        if not bool(good.all()):
            view, stroke, *_ = (~good).nonzero()[0].tolist()
            got = value[view, stroke].reshape(-1)[int(good[view, stroke].reshape(-1).int().argmin())].item()
            row = "stroke" if strokes.chains is None or value.shape[1] == len(opacity) else "segment"
            raise InvalidStrokeError(f"{name} of {row} {stroke} (view {view}) must be {expected}, got {got}")


def canvas_from(background: Background, like: Tensor, shape: tuple[int, int, int, int]) -> Tensor:
    """The background as a tensor of four axes that expands to (V, H, W, 3).

    Raises:
        TypeError, ValueError: another dtype or device than the colours, a shape that does not expand, or, but for
            tensors on a GPU, values that are not finite.
    """
    if isinstance(background, Tensor):
        if background.dtype != like.dtype or background.device != like.device:
            got = f"{background.dtype} on {background.device}"
            raise TypeError(f"background must be {like.dtype} on {like.device} as the colours are, got {got}")
        check_plain(background=background)
        canvas = background
    else:
        _check_numbers(background)
        try:
            if isinstance(background, int | float):
                return _gray(float(background), like)
            canvas = _from_sequence(background, like)
        except (TypeError, ValueError, RuntimeError) as error:
            got = type(background).__name__
            raise TypeError(f"background must be a number, three numbers or a tensor, got {got}") from error
    # A look at a GPU's values would wait. A sum is the faster one, and finite if they are, but for huge ones.
    if canvas.device.type == "cpu" and not (math.isfinite(float(canvas.detach().sum())) or _all_finite(canvas)):
        raise ValueError("background must be finite, got NaN or infinite values")
    if canvas.ndim == 0 or canvas.shape[-1] == 1:
        canvas = canvas.reshape(*canvas.shape[:-1], 1).expand(*canvas.shape[:-1], 3)
    canvas = canvas.reshape((1,) * (4 - canvas.ndim) + tuple(canvas.shape))
    if len(canvas.shape) != 4 or any(n not in (1, m) for n, m in zip(canvas.shape, shape, strict=True)):
        raise ValueError(f"background must broadcast to {shape}, got shape {tuple(canvas.shape)}")
    return canvas


def _all_finite(values: Tensor) -> bool:
    return bool(values.detach().isfinite().all())


def _check_numbers(background: float | Sequence[float]) -> None:
    """Raises ValueError for numbers that are not finite, before they are written on any device."""
    numbers = background if isinstance(background, Sequence) else [background]
    if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
        raise ValueError(f"background must be finite, got {background}")


def _gray(value: float, like: Tensor) -> Tensor:
    if like.device.type == "cpu" and like.dtype in _GRAY_DTYPES:
        return torch.from_numpy(_gray_pixel(value, like.dtype))
    # Written by the device itself: a copy to it would wait, and be no part of a captured graph.
    return like.new_full((1, 1, 1, 3), value)


@functools.lru_cache(maxsize=16)
def _gray_pixel(value: float, dtype: torch.dtype) -> NDArray[np.floating]:
    """Kept, since the kernels draw a few strokes in less time than torch takes to make it.

    A tensor would keep what made it: a transform of torch.func, inference mode, a default device.
    """
    return np.full((1, 1, 1, 3), value, _GRAY_DTYPES[dtype])


def _from_sequence(background: Sequence[float], like: Tensor) -> Tensor:
    if not all(isinstance(value, int | float) for value in background):
        return torch.as_tensor(background, dtype=like.dtype, device=like.device)
    return torch.cat([like.new_full((1,), value) for value in background])
