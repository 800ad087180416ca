"""Layers drawn by kernels as one operation of autograd."""

from types import ModuleType
from typing import Any, cast

import torch
from torch.autograd.function import once_differentiable

from diff3ds._shapes import Float, Tensor
from diff3ds.render.areas.painted_layers import Layers


def drawn(
    kernels: ModuleType, layers: Layers, width: int, height: int, background: Float[Tensor, "H W 4"] | None
) -> Float[Tensor, "H W 4"]:
    """The picture as `draw_layers` says, differentiable once, in reverse mode; kernels: `on_cpu` or `on_cuda`."""
    values, size = layers.values(), (width, height)
    given = (*values, background) if background is not None else values
    if torch.is_grad_enabled() and any(value.requires_grad for value in given):
        return cast(Tensor, _Draw.apply(kernels, layers.tables(), size, background, *values))  # type: ignore[no-untyped-call]
    return cast(Tensor, kernels.draw(values, layers.tables(), background, size, False)[0])


class _Draw(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        kernels: ModuleType,
        tables: tuple[Tensor, ...],
        size: tuple[int, int],
        background: Tensor | None,
        *values: Tensor,
    ) -> Tensor:
        image, ctx.state = kernels.draw(values, tables, background, size, True)
        ctx.kernels = kernels
        # The state points into these: held here too, a change of one before the backward is an error.
        ctx.save_for_backward(*values, *(() if background is None else (background,)))
        return cast(Tensor, image)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        _ = ctx.saved_tensors
        *gradients, background = ctx.kernels.backward(ctx.state, upstream, ctx.needs_input_grad[3])
        return None, None, None, background, *gradients
