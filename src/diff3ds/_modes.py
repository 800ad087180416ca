"""Whether transforms and modes of torch have a part in what is computed: what they touch must not outlive them."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import torch
from torch.autograd import forward_ad

from diff3ds._shapes import Tensor

Given = ParamSpec("Given")
Made = TypeVar("Made")


def outside_of_graph(function: Callable[Given, Made], *args: Given.args, **kwargs: Given.kwargs) -> Made:
    """Calls the function where torch.compile makes a graph: that ends here, and another one begins behind it."""
    return cast(Made, torch.compiler.disable(function)(*args, **kwargs))  # type: ignore[no-untyped-call]


def transformed() -> bool:
    """Whether torch.func or forward mode is at work: then a tensor may have derivatives that it does not tell of."""
    return torch._C._are_functorch_transforms_active() or forward_ad._current_level >= 0


def in_graph() -> bool:
    """Whether a graph is made, by torch.compile, torch.export or make_fx: then no value can be looked at."""
    return torch.compiler.is_compiling() or recorded()


def recorded() -> bool:
    """Whether make_fx, or what is built on it, follows every operation."""
    return torch._C._get_dispatch_mode(torch._C._TorchDispatchModeKey.PROXY) is not None


def can_look_at(value: Tensor) -> bool:
    """Whether the values of a tensor can be looked at, and without waiting for a GPU."""
    return value.device.type == "cpu" and not in_graph()


def is_ordinary(value: Tensor) -> bool:
    """Whether a tensor may be kept and used anywhere later: no graph, mode or transform has a part in it."""
    # What graphs are made of has no values to keep, and torch.compile does not know what follows.
    if in_graph():
        return False
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
    if in_graph() or not torch._C._are_functorch_transforms_active():
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
