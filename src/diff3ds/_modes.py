"""Whether transforms and modes of torch have a part in what is computed: what they touch must not outlive them."""

import torch
from torch.autograd import forward_ad

from diff3ds._shapes import Tensor


def transformed() -> bool:
    """Whether torch.func or forward mode is at work: then a tensor may have derivatives that it does not tell of."""
    return torch._C._are_functorch_transforms_active() or forward_ad._current_level >= 0


def is_ordinary(value: Tensor) -> bool:
    """Whether a tensor may be kept and used anywhere later: no graph, mode or transform has a part in it."""
    return (
        type(value) is Tensor
        and not value.requires_grad
        and not value.is_inference()
        and not torch._C._functorch.is_functorch_wrapped_tensor(value)
        # In forward mode it may have a tangent.
        and forward_ad._current_level < 0
    )


def check_plain(**values: Tensor) -> None:
    """Raises RuntimeError for tensors whose values cannot be looked at, which all that draws does."""
    if torch.compiler.is_compiling() or not torch._C._are_functorch_transforms_active():
        return
    for name, value in values.items():
        # Below what torch.func differentiates lies a plain tensor.
        while torch._C._functorch.is_gradtrackingtensor(value):
            value = torch._C._functorch.get_unwrapped(value)
        if torch._C._functorch.is_functorch_wrapped_tensor(value):
            raise RuntimeError(
                f"{name} must have values that can be looked at, which torch.vmap and functionalize forbid: loop in "
                "place of vmap, or draw all strokes as one sketch and all views at once"
            )
