"""Layers drawn by the compiled kernels as one operation of autograd."""

from types import ModuleType
from typing import Any, cast

import torch
from torch.autograd.function import once_differentiable

from diff3ds._shapes import Float, Tensor
from diff3ds.render.areas.painted_layers import Layers
from diff3ds.render.backends import get_num_threads, kernels


def drawn(layers: Layers, width: int, height: int, background: Float[Tensor, "H W 4"] | None) -> Float[Tensor, "H W 4"]:
    """The picture as `draw_layers` says, differentiable once, in reverse mode."""
    values = layers.values()
    given = (*values, background) if background is not None else values
    if torch.is_grad_enabled() and any(value.requires_grad for value in given):
        return cast(Tensor, _Draw.apply(layers.tables(), width, height, background, *values))  # type: ignore[no-untyped-call]
    return torch.from_numpy(_module().areas_draw(values, layers.tables(), background, width, height, False)[0])


def _module() -> ModuleType:
    module = kernels()
    assert module is not None
    module.set_threads(get_num_threads())
    return module


class _Draw(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, tables: tuple[Tensor, ...], width: int, height: int, background: Tensor | None, *values: Tensor
    ) -> Tensor:
        image, ctx.state = _module().areas_draw(values, tables, background, width, height, True)
        # The state points into these: held here too, a change of one before the backward is an error.
        ctx.save_for_backward(*values, *(() if background is None else (background,)))
        return torch.from_numpy(image)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        _ = ctx.saved_tensors
        *gradients, background = _module().areas_backward(ctx.state, upstream, ctx.needs_input_grad[3])
        made = [torch.from_numpy(g) for g in gradients]
        return None, None, None, None if background is None else torch.from_numpy(background), *made
