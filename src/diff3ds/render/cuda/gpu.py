"""A GPU that runs the kernels: on torch's current stream, in torch's context of that GPU."""

import ctypes
from collections.abc import Sequence
from typing import Any

import torch

from diff3ds._shapes import Int, Tensor
from diff3ds.render.cuda.compile import Codes
from diff3ds.render.cuda.job import Job
from diff3ds.render.cuda.sources import DRAWING, MONTE_CARLO, kernels

# Blocks of kernels over lists, for every processor of the GPU: enough to hide the latency of memory (empirical).
BLOCKS_PER_PROCESSOR = 8


class Gpu:
    """Runs kernels of one precision ("float" or "double") on one GPU."""

    def __init__(self, device: torch.device, real: str, parts: Sequence[str] = DRAWING) -> None:
        self._device = device
        properties = torch.cuda.get_device_properties(device)
        self.strides: int = BLOCKS_PER_PROCESSOR * properties.multi_processor_count
        self._codes = Codes(real, f"sm_{properties.major}{properties.minor}")
        self._codes.begin(parts)
        self._parts: dict[str, Any] = {}
        self._kernels: dict[str, Any] = {}

    def launch(self, launches: Sequence[tuple[str, int]], job: ctypes.Structure) -> None:
        """Starts kernels on the current stream.

        Raises:
            RuntimeError: the driver refuses.
        """
        from cuda.bindings import driver

        # The driver copies the job before it returns.
        arguments = (ctypes.c_void_p * 1)(ctypes.addressof(job))
        address = ctypes.addressof(arguments)
        with torch.cuda.device(self._device):
            self._bind()
            stream = torch.cuda.current_stream(self._device).cuda_stream or driver.CU_STREAM_LEGACY
            known = kernels()
            for name, blocks in launches:
                kernel = self._kernels.get(name) or self._load(name, job)
                threads = known[name].threads
                started = driver.cuLaunchKernel(kernel, blocks, 1, 1, threads, 1, 1, 0, stream, address, 0)
                self._checked(started, name)

    def _bind(self) -> None:
        """Makes torch's context that of this thread, if it has none.

        A thread of autograd begins so, and torch binds it with its first call to the device that needs one: neither the
        choice of a device nor memory from torch's cache does.
        """
        from cuda.bindings import driver

        if int(self._checked(driver.cuCtxGetCurrent(), "context")):
            return
        index = torch.cuda.current_device() if self._device.index is None else self._device.index
        gpu = self._checked(driver.cuDeviceGet(index), "device")
        # Kept for good, as torch does.
        context = self._checked(driver.cuDevicePrimaryCtxRetain(gpu), "context")
        self._checked(driver.cuCtxSetCurrent(context), "context")

    def _load(self, name: str, job: ctypes.Structure) -> Any:
        """By the driver itself, not by cuda-core: its import alone takes longer than all of a later process may."""
        from cuda.bindings import driver

        part = kernels()[name].part
        if isinstance(job, Job) and job.strata and job.save:
            # The backward pass will need them.
            self._codes.begin(MONTE_CARLO)
        # Loading takes memory, which a capture forbids its thread to do unless it says that it knows.
        relaxed = driver.CUstreamCaptureMode.CU_STREAM_CAPTURE_MODE_RELAXED
        before = self._checked(driver.cuThreadExchangeStreamCaptureMode(relaxed), "capture mode")
        try:
            if part not in self._parts:
                code = self._codes.of(part)
                self._parts[part] = self._checked(driver.cuLibraryLoadData(code, [], [], 0, [], [], 0), part)
            kernel = self._checked(driver.cuLibraryGetKernel(self._parts[part], name.encode()), name)
            # Now, not at the first launch.
            self._kernels[name] = self._checked(driver.cuKernelGetFunction(kernel), name)
        finally:
            self._checked(driver.cuThreadExchangeStreamCaptureMode(before), "capture mode")
        return self._kernels[name]

    def _checked(self, answer: tuple[Any, ...], what: str) -> Any:
        """What the driver gives beside its error code.

        Raises:
            RuntimeError: there was an error.
        """
        if int(answer[0]):
            raise RuntimeError(f"{self._device} refuses {what} of the renderer's kernels: {answer[0].name}")
        return answer[1] if len(answer) > 1 else None

    def wait(self) -> None:
        """Until the current stream is done."""
        torch.cuda.current_stream(self._device).synchronize()

    def capturing(self) -> bool:
        """Whether the current stream records a graph."""
        with torch.cuda.device(self._device):
            return torch.cuda.is_current_stream_capturing()

    def report(self, length: int) -> Int[Tensor, " C"]:
        """Pinned memory, which the GPU sees at the same address."""
        return torch.zeros(length, dtype=torch.int64, device="cpu").pin_memory()
