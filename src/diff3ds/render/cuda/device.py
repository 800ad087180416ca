"""What runs the kernels: a GPU, or in the tests its emulation on the CPU."""

import functools
from typing import Protocol, runtime_checkable

import torch

from diff3ds._shapes import Int, Tensor
from diff3ds.render.cuda.job import Job


# Threads of a block, by the first word of a kernel's name (entry.cuh has them too).
THREADS = {"place": 1024, "draw": 256, "conclude": 256, "differentiate": 256, "value": 256}


def threads_of(name: str) -> int:
    """Threads of a block of this kernel."""
    return THREADS.get(name.split("_")[0], 128)


@runtime_checkable
class Device(Protocol):
    """Runs kernels of one precision in order.

    Attributes:
        strides: blocks of kernels over lists whose length only the device knows.
    """

    strides: int

    def launch(self, name: str, blocks: int, job: Job) -> None:
        """Starts a kernel; the job is copied."""
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
def device_for(device: torch.device, dtype: torch.dtype) -> Device:
    """The runner of kernels for tensors like these."""
    from diff3ds.render.cuda.gpu import Gpu

    return Gpu(device, "float" if dtype == torch.float32 else "double")
