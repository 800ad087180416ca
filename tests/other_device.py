"""A device without float64, as Apple's GPUs are, that is not there: its values are on the CPU, behind another name."""

import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map

# Of all names the one that autograd takes without a driver.
NAME = "meta"


class There(torch.Tensor):
    """A tensor on that device."""

    @staticmethod
    def __new__(cls, held: torch.Tensor):
        return torch.Tensor._make_wrapper_subclass(cls, held.shape, held.stride(), dtype=held.dtype, device=NAME)

    def __init__(self, held: torch.Tensor):
        if held.dtype == torch.float64:
            raise TypeError("this device has no float64")
        self.held = held

    __torch_function__ = torch._C._disabled_torch_function_impl

    @classmethod
    def __torch_dispatch__(cls, function, types, args=(), kwargs=None):
        raise AssertionError(f"{function}: the device is off")


class OtherDevice(TorchDispatchMode):
    """While it is on, `.to("meta")` moves values to that device; tensors of two devices do not mix, as on real ones."""

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        target = kwargs.get("device")
        places = {x.device.type for x in tree_leaves((args, kwargs)) if _has_place(x)}
        assert len(places) < 2, f"{function}: tensors on two devices"
        kwargs = {**kwargs, "device": torch.device("cpu")} if target is not None else kwargs
        result = function(*tree_map(_held, args), **tree_map(_held, kwargs))
        there = (str(target) if target is not None else next(iter(places), "cpu")) == NAME
        return tree_map(lambda x: There(x) if isinstance(x, torch.Tensor) else x, result) if there else result


def _has_place(value: object) -> bool:
    # A single number of the CPU goes with any device.
    return isinstance(value, There) or (isinstance(value, torch.Tensor) and value.ndim > 0)


def _held(value: object) -> object:
    return value.held if isinstance(value, There) else value
