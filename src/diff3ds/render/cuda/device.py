"""What runs the kernels: a GPU, or in the tests its emulation on the CPU."""

import ctypes
import functools
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import torch

from diff3ds._shapes import Int, Tensor
from diff3ds.render.cuda.sources import DRAWING


@runtime_checkable
class Device(Protocol):
    """Runs kernels of one precision in order.

    Attributes:
        strides: blocks of kernels over lists whose length only the device knows.
    """

    strides: int

    def launch(self, launches: Sequence[tuple[str, int]], job: ctypes.Structure) -> None:
        """Starts kernels, given by name and number of blocks, one after the other; the job is copied."""
        ...

    def wait(self) -> None:
        """Until all is done."""
        ...

    def capturing(self) -> bool:
        """Whether launches are recorded, not run."""
        ...

    def report(self, length: int) -> Int[Tensor, " C"]:
        """Zeros, in memory that host and device see."""
        ...


@functools.cache
def device_for(device: torch.device, dtype: torch.dtype, parts: tuple[str, ...] = DRAWING) -> Device:
    """The runner of kernels for tensors like these; parts: those that are compiled at once."""
    from diff3ds.render.cuda.gpu import Gpu

    return Gpu(device, "float" if dtype == torch.float32 else "double", parts)
