"""What a call of the CUDA kernels costs the processor, with a driver that only takes notes: no GPU is needed.

    python benchmarks/host_cuda.py [A|B|C|D]

Tensors are on the CPU, so that what a GPU would do in PyTorch's own operations is in these times as well; what the
driver does with a launch is not. Prints medians with quartiles, launches and PyTorch's operations of a call.
"""

import argparse
from collections.abc import Callable
from contextlib import ExitStack, nullcontext
from importlib import import_module
from types import SimpleNamespace
from unittest.mock import patch

import torch
from cuda.bindings import driver
from timing import interleaved
from torch.profiler import ProfilerActivity, profile
from workloads import WORKLOADS, leaves, scene

import diff3ds as ds

ROUNDS = 20
LOADING = ("cuThreadExchangeStreamCaptureMode", "cuLibraryLoadData", "cuLibraryGetKernel", "cuKernelGetFunction")


def main() -> None:
    """Prints a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("workload", nargs="?", default="A", choices=WORKLOADS)
    name = parser.parse_args().workload
    torch.set_num_threads(1)
    launched: list[int] = []
    with ExitStack() as stack:
        pretend(stack, launched)
        ways = calls(name)
        counts = {way: (operations_of(call), launches_of(call, launched)) for way, call in ways.items()}
        for way, times in interleaved(ways, ROUNDS).items():
            operations, launches = counts[way]
            print(f"{name} {way:20}{times} ms, {launches} launches, {operations} operations of PyTorch")


def calls(name: str) -> dict[str, Callable[[], object]]:
    """A picture alone, and one with gradients of all that a sketch has."""
    sketch, cameras = scene(WORKLOADS[name])
    leaf, tensors = leaves(sketch)
    upstream = torch.rand(len(cameras), *cameras.size, 3)
    return {
        "forward": lambda: ds.render(sketch, cameras),
        "forward + backward": lambda: torch.autograd.grad(ds.render(leaf, cameras).color, tensors, upstream),
    }


def operations_of(call: Callable[[], object]) -> int:
    """How many operations PyTorch dispatches."""
    with profile(activities=[ProfilerActivity.CPU]) as found:
        call()
    return sum(event.count for event in found.key_averages() if event.key.startswith("aten::"))


def launches_of(call: Callable[[], object], launched: list[int]) -> int:
    """How many kernels a call starts."""
    launched.clear()
    call()
    return len(launched)


def pretend(stack: ExitStack, launched: list[int]) -> None:
    """Until the stack is closed, tensors on the CPU are drawn by a GPU whose driver notes the blocks of a launch."""

    def launch(kernel: object, blocks: int, *rest: object) -> tuple[int]:
        launched.append(blocks)
        return (0,)

    def put(owner: object, name: str, value: object) -> None:
        stack.enter_context(patch.object(owner, name, value))

    gpu, compiling = (import_module(f"diff3ds.render.cuda.{name}") for name in ("gpu", "compile"))
    for name in LOADING:
        put(driver, name, lambda *arguments: (0, arguments))
    put(driver, "cuCtxGetCurrent", lambda: (0, 1))
    put(driver, "cuLaunchKernel", launch)
    put(compiling, "compiled", lambda part, real, arch: part.encode())
    put(gpu.Gpu, "report", lambda self, length: torch.zeros(length, dtype=torch.int64))
    properties = SimpleNamespace(major=9, minor=0, multi_processor_count=132)
    put(torch.cuda, "get_device_properties", lambda device: properties)
    put(torch.cuda, "device", nullcontext)
    stream = SimpleNamespace(cuda_stream=7, synchronize=lambda: None)
    put(torch.cuda, "current_stream", lambda device: stream)
    put(torch.cuda, "is_current_stream_capturing", lambda: False)
    one = gpu.Gpu(torch.device("cuda"), "float")
    put(import_module("diff3ds.render.cuda.rasterize"), "device_for", lambda device, dtype: one)
    put(import_module("diff3ds.render"), "choose_backend", lambda backend, device, dtype: "cuda")


if __name__ == "__main__":
    main()
