"""How tests with tensors on the CPU run the CUDA kernels: emulated, or on the device."""

import functools
from importlib import import_module

import pytest
import torch
from emulated import Emulated, compiler
from gpu_promise import lack, promised

NO_COMPILER = "no C++ compiler to emulate the CUDA kernels with"


def on_device(name: str) -> list:
    """A parameter for tests on the device, where there is one or one is promised."""
    return [pytest.param(name, marks=pytest.mark.gpu)] if promised() or torch.cuda.is_available() else []


@functools.cache
def emulated(device: torch.device, dtype: torch.dtype) -> Emulated:
    return Emulated("float" if dtype == torch.float32 else "double")


def use_emulation(monkeypatch, device_for=emulated) -> None:
    """From now on the backend "cuda" draws tensors on the CPU, by emulation."""
    if compiler() is None:
        lack(NO_COMPILER)
    monkeypatch.setattr(import_module("diff3ds.render.cuda.rasterize"), "device_for", device_for)
    _let_cuda_draw(monkeypatch)


def use_device(monkeypatch) -> None:
    """From now on the backend "cuda" moves tensors to the device, draws, and moves the images back."""
    assert torch.cuda.is_available(), "DIFF3DS_GPU promises a GPU, and torch sees none"
    module = import_module("diff3ds.render.autograd")
    draw = module.draw

    def there_and_back(inputs, kernels):
        if kernels is not import_module("diff3ds.render.cuda.rasterize"):
            return draw(inputs, kernels)
        curves, appearance = (tuple(t.cuda() for t in tensors) for tensors in (inputs.curves, inputs.appearance))
        chains = None if inputs.chains is None else inputs.chains.to("cuda")
        cameras = None if inputs.cameras is None else tuple(t.cuda() for t in inputs.cameras)
        there = inputs._replace(curves=curves, cameras=cameras, appearance=appearance, chains=chains)
        return tuple(x.cpu() for x in draw(there, kernels))

    monkeypatch.setattr(module, "draw", there_and_back)
    _let_cuda_draw(monkeypatch)


def _let_cuda_draw(monkeypatch) -> None:
    # `diff3ds.render` is the function; its module has to be asked for.
    module = import_module("diff3ds.render")
    choose = module.choose_backend

    def chosen(backend, device, dtype):
        can = device.type == "cpu" and dtype in (torch.float16, torch.bfloat16, torch.float32, torch.float64)
        return "cuda" if backend == "cuda" and can else choose(backend, device, dtype)

    monkeypatch.setattr(module, "choose_backend", chosen)
