"""A device that works through a queue, as a GPU does, and is not there: it is an error to wait for it."""

import torch
from other_device import NAME, OtherDevice, There
from torch.utils._pytree import tree_leaves

aten = torch.ops.aten
# What tells the host values, or how many there are, that are known on the device only.
TELLING = {
    aten._local_scalar_dense.default,
    aten.equal.default,
    aten.masked_select.default,
    aten.nonzero.default,
    aten.repeat_interleave.Tensor,
}
INDEXING = {aten.index.Tensor, aten.index_put.default, aten.index_put_.default, aten._index_put_impl_.default}


class QueuedDevice(OtherDevice):
    """While it is `busy`, values reach it from pinned memory only, and none come back.

    Tensors of two devices do not mix, so an index on the CPU, which a GPU would fetch and wait, is an error as well.

    Attributes:
        busy: whether a wait is an error.
        copies: to the device, made while it was busy.
    """

    def __init__(self):
        super().__init__()
        self.busy, self.copies = False, 0
        self._pinned: list[torch.Tensor] = []

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        if function is aten.is_pinned.default:
            return self._has_pinned(args[0])
        if function is aten._pin_memory.default:
            self._pinned.append(args[0].clone())
            return self._pinned[-1]
        if self.busy:
            self._check(function, args, kwargs)
        elif function is aten.copy_.default and isinstance(args[0], There) and not isinstance(args[1], There):
            args = (args[0], There(args[1]), *args[2:])
        return super().__torch_dispatch__(function, types, args, kwargs)

    def _check(self, function, args, kwargs) -> None:
        tensors = [x for x in tree_leaves((args, kwargs)) if isinstance(x, torch.Tensor)]
        there = [x for x in tensors if isinstance(x, There)]
        # torch makes a tensor of numbers on the CPU and copies it, out of sight of this class.
        hidden = any(x.device.type == NAME and not isinstance(x, There) for x in tensors)
        assert not hidden, "numbers of Python are copied to the device, which waits"
        assert not (there and function in TELLING), f"{function} waits for values"
        masks = [x for x in tree_leaves(args[1]) if isinstance(x, There)] if there and function in INDEXING else []
        assert all(x.dtype != torch.bool for x in masks), f"{function} waits for what a mask selects"
        target = kwargs.get("device")
        if function is aten._to_copy.default and target is not None:
            if torch.device(target).type != NAME:
                assert not there, "a copy from the device waits"
            elif not there:
                at_once = self._has_pinned(args[0]) and kwargs.get("non_blocking")
                assert at_once, "a copy to the device waits"
                self.copies += 1

    def _has_pinned(self, tensor: torch.Tensor) -> bool:
        return any(tensor is x for x in self._pinned)
