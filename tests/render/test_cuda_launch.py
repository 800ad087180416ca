"""What is asked of the driver and the compiler, where a driver that only takes notes stands in: no GPU is needed."""

import threading
from contextlib import nullcontext
from importlib import import_module
from types import SimpleNamespace

import pytest
import torch
from gpu_promise import need

from diff3ds.render.areas.area_job import AreaJob
from diff3ds.render.cuda import compile as compiling
from diff3ds.render.cuda import gpu
from diff3ds.render.cuda.job import Job
from diff3ds.render.cuda.sources import AREAS, DRAWING, MONTE_CARLO, PARTS, kernels

need("cuda.bindings.driver")
driver = import_module("cuda.bindings.driver")

# Seconds after which a thread that did not come is missed.
PATIENCE = 60


@pytest.fixture
def compiled(monkeypatch) -> list[str]:
    """The parts that were compiled."""
    begun: list[str] = []
    monkeypatch.setattr(compiling, "compiled", lambda part, real, arch: begun.append(part) or part.encode())
    return begun


@pytest.fixture
def device(monkeypatch, compiled) -> gpu.Gpu:
    """A GPU of compute capability 9.0, on which everything succeeds."""
    for name in ("cuThreadExchangeStreamCaptureMode", "cuLibraryLoadData", "cuLibraryGetKernel", "cuKernelGetFunction"):
        monkeypatch.setattr(driver, name, lambda *arguments: (0, arguments))
    monkeypatch.setattr(driver, "cuCtxGetCurrent", lambda: (0, driver.CUcontext(1)))
    monkeypatch.setattr(driver, "cuLaunchKernel", lambda *arguments: (0,))
    properties = SimpleNamespace(major=9, minor=0, multi_processor_count=132)
    monkeypatch.setattr(torch.cuda, "get_device_properties", lambda device: properties)
    monkeypatch.setattr(torch.cuda, "device", nullcontext)
    monkeypatch.setattr(torch.cuda, "current_stream", lambda device: SimpleNamespace(cuda_stream=7))
    return gpu.Gpu(torch.device("cuda"), "float")


def settle() -> None:
    """Until all threads that compile have ended."""
    for thread in threading.enumerate():
        if thread.name.startswith("diff3ds-compile"):
            thread.join(PATIENCE)


def test_what_only_monte_carlo_needs_is_compiled_for_its_gradients_alone(device, compiled):
    """And then with its first kernel, not when the backward pass waits for it."""
    for job in (Job(), Job(save=1), Job(strata=2)):
        for name, kernel in kernels().items():
            if kernel.part in DRAWING:
                device.launch([(name, 1)], job)
        device._kernels.clear()
    settle()
    assert sorted(compiled) == sorted(DRAWING)
    device.launch([("count_pieces", 1)], Job(strata=2, save=1))
    settle()
    assert sorted(compiled) == sorted(DRAWING + MONTE_CARLO)
    assert kernels()["differentiate_samples"].part in MONTE_CARLO


def test_layers_compile_nothing_of_strokes(device, compiled):
    settle()
    compiled.clear()
    layers = gpu.Gpu(torch.device("cuda"), "float", AREAS)
    layers.launch([(name, 1) for name, kernel in kernels().items() if kernel.part in AREAS], AreaJob())
    settle()
    assert compiled == list(AREAS)


def test_a_kernel_that_nothing_announced_is_compiled(device, compiled):
    device.launch([("sum_outlines", 1)], Job())
    assert "outlines" in compiled


def test_parts_are_compiled_side_by_side(monkeypatch):
    """Each waits until all have begun."""
    meeting = threading.Barrier(len(PARTS))

    def compiled(part: str, real: str, arch: str) -> bytes:
        meeting.wait(PATIENCE)
        return f"{part} {real} {arch}".encode()

    monkeypatch.setattr(compiling, "compiled", compiled)
    codes = compiling.Codes("double", "sm_80")
    codes.begin(PARTS)
    assert [codes.of(part) for part in PARTS] == [f"{part} double sm_80".encode() for part in PARTS]
    codes.begin(PARTS)
    assert not meeting.n_waiting


def test_a_thread_without_a_context_gets_torchs_before_anything_is_loaded(device, monkeypatch):
    """Autograd's begin so, and where a backward pass finds its memory in torch's cache, nothing has bound them."""
    asked: list[tuple[str, object]] = []

    def put(name: str, *answer: object) -> None:
        monkeypatch.setattr(driver, name, lambda *arguments: asked.append((name, *arguments)) or (0, *answer))

    put("cuCtxGetCurrent", driver.CUcontext(0))
    put("cuDeviceGet", driver.CUdevice(1))
    put("cuDevicePrimaryCtxRetain", "context")
    put("cuCtxSetCurrent")
    put("cuLibraryLoadData", "library")
    put("cuLaunchKernel")
    device._device = torch.device("cuda", 1)
    device.launch([("draw_image", 1)], Job())
    names = [name for name, *_ in asked]
    assert names[:4] == ["cuCtxGetCurrent", "cuDeviceGet", "cuDevicePrimaryCtxRetain", "cuCtxSetCurrent"]
    assert asked[1][1] == 1
    assert int(asked[2][1]) == 1
    assert asked[3][1] == "context"
    assert names[4:] == ["cuLibraryLoadData", "cuLaunchKernel"]


def test_what_the_driver_refuses_is_named(device, monkeypatch):
    error = driver.CUresult.CUDA_ERROR_INVALID_VALUE
    monkeypatch.setattr(driver, "cuLaunchKernel", lambda *arguments: (error,))
    with pytest.raises(
        RuntimeError, match="cuda refuses draw_image of the renderer's kernels: CUDA_ERROR_INVALID_VALUE"
    ):
        device.launch([("draw_image", 1)], Job())
