"""Layers by the compiled kernels of the CPU."""

from types import ModuleType
from typing import Any

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Index, Int, Tensor
from diff3ds.render.backends import get_num_threads, kernels


def draw(
    values: tuple[Tensor, ...],
    tables: tuple[Tensor, ...],
    background: Float[Tensor, "H W 4"] | None,
    size: tuple[int, int],
    save: bool,
) -> tuple[Float[Tensor, "H W 4"], Any]:
    """The picture, and what `backward` needs if that is saved."""
    image, state = _module().areas_draw(values, tables, background, *size, save)
    return torch.from_numpy(image), state


def backward(state: Any, upstream: Float[Tensor, "H W 4"], want_background: bool) -> tuple[Tensor | None, ...]:
    """Gradients of the values, and of the background."""
    *gradients, background = _module().areas_backward(state, upstream, want_background)
    made = [torch.from_numpy(g) for g in gradients]
    return *made, None if background is None else torch.from_numpy(background)


def covered(
    values: tuple[Tensor, ...], tables: tuple[Tensor, ...], size: tuple[int, int]
) -> list[tuple[Int[Index, " n"], Float[Array, " n"]]]:
    """The pixels of each layer, and how much of each it covers."""
    first, pixels, shares = _module().areas_covered(values, tables, *size)
    # Of C's long long, which numpy tells from its own integers.
    split = np.split(pixels.view(np.int64), first[1:-1]), np.split(shares.astype(np.float64), first[1:-1])
    return list(zip(*split, strict=True))


def _module() -> ModuleType:
    module = kernels()
    assert module is not None
    module.set_threads(get_num_threads())
    return module
