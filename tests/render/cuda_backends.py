"""How tests with tensors on the CPU run the CUDA kernels: emulated, or on the device."""

import functools
from importlib import import_module

import pytest
import torch
from emulated import Emulated, compiler
from gpu_promise import lack, promised

from diff3ds.render.cuda.sources import AREAS

NO_COMPILER = "no C++ compiler to emulate the CUDA kernels with"


def on_device(name: str) -> list:
    """A parameter for tests on the device, where there is one or one is promised."""
    return [pytest.param(name, marks=pytest.mark.gpu)] if promised() or torch.cuda.is_available() else []


@functools.cache
def emulated(device: torch.device, dtype: torch.dtype) -> Emulated:
    return Emulated("float" if dtype == torch.float32 else "double")


@functools.cache
def emulated_areas(device: torch.device, dtype: torch.dtype, parts: tuple[str, ...] = AREAS) -> Emulated:
    return Emulated("float" if dtype == torch.float32 else "double", name="emulate_areas")


def use_emulation(monkeypatch, device_for=emulated) -> None:
    """From now on the backend "cuda" draws tensors on the CPU, by emulation."""
    if compiler() is None:
        lack(NO_COMPILER)
    monkeypatch.setattr(import_module("diff3ds.render.cuda.rasterize"), "device_for", device_for)
    monkeypatch.setattr(import_module("diff3ds.render.areas.on_cuda"), "device_for", emulated_areas)
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
    areas = import_module("diff3ds.render.areas.on_cuda")
    _layers_there_and_back(monkeypatch, areas)
    _let_cuda_draw(monkeypatch)


def _layers_there_and_back(monkeypatch, areas) -> None:
    draw, back = areas.draw, areas.backward

    def draw_there(values, tables, background, size, save):
        values, tables = (tuple(t.cuda() for t in tensors) for tensors in (values, tables))
        image, state = draw(values, tables, None if background is None else background.cuda(), size, save)
        return image.cpu(), state

    def back_there(state, upstream, want_background):
        return tuple(None if g is None else g.cpu() for g in back(state, upstream.cuda(), want_background))

    monkeypatch.setattr(areas, "draw", draw_there)
    monkeypatch.setattr(areas, "backward", back_there)


def _let_cuda_draw(monkeypatch) -> None:
    # `diff3ds.render` is the function; its modules have to be asked for.
    for name in ("diff3ds.render", "diff3ds.render.areas"):
        module = import_module(name)
        monkeypatch.setattr(module, "choose_backend", functools.partial(_chosen, module.choose_backend))


def _chosen(choose, backend, device, dtype):
    can = device.type == "cpu" and dtype in (torch.float16, torch.bfloat16, torch.float32, torch.float64)
    return "cuda" if backend == "cuda" and can else choose(backend, device, dtype)
