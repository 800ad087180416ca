"""The compiled CPU kernels as `autograd` takes them: from curves, in space or projected, to images, and back."""

from types import ModuleType
from typing import Any

import torch

from diff3ds._shapes import Tensor
from diff3ds.render.autograd import Gradients, Upstream
from diff3ds.render.backends import get_num_threads, kernels
from diff3ds.render.kernel_inputs import Images, KernelInputs


def forward(inputs: KernelInputs, save: bool) -> tuple[Images, Any]:
    """The images, and what `backward` needs of them."""
    module = _ready_kernels()
    # Keyword by keyword: no order that two languages must agree on.
    options = module.Options(**inputs.options._asdict())
    chains = None if inputs.chains is None else (inputs.chains.first, inputs.chains.closed)
    batch = None if inputs.batch is None else inputs.batch.table
    given = inputs.curves, chains, batch, inputs.appearance
    color, alpha, depth, state = module.forward(*given, inputs.size, options, save)
    return (torch.from_numpy(color), torch.from_numpy(alpha), torch.from_numpy(depth)), state


def backward(
    state: Any, upstream: Upstream, planes: tuple[Tensor, Tensor], background: Tensor, needs: tuple[bool, ...]
) -> Gradients:
    """Gradients of the appearance and of the curves."""
    # Only the gradient of depth needs them.
    given = (None, None) if upstream[2] is None else planes
    gradients = _ready_kernels().backward(state, upstream, given, needs[3], needs[-1])
    if needs[3]:
        gradients = (*gradients[:3], _summed(gradients[3], background.shape), *gradients[4:])
    return tuple(None if g is None else torch.from_numpy(g) for g in gradients)


def _ready_kernels() -> ModuleType:
    module = kernels()
    assert module is not None
    module.set_threads(get_num_threads())
    return module


def _summed(gradient: Any, shape: tuple[int, ...]) -> Any:
    """The gradient of what was expanded from a shape. Numpy's sums do not depend on the number of threads."""
    axes = tuple(k for k, n in enumerate(shape) if n == 1)
    total = gradient.sum(axis=axes, keepdims=True, dtype="float64") if axes else gradient
    return total.astype(gradient.dtype, copy=False)
