"""The kernels of each backend, and how they draw."""

from importlib import import_module
from typing import cast

from diff3ds.render import autograd, cpu
from diff3ds.render.kernel_inputs import Images, KernelInputs


def kernels_of(backend: str) -> autograd.Kernels:
    """Those of "cpu" or "cuda"; the latter are imported by those who draw with them only."""
    return cast(autograd.Kernels, cpu if backend == "cpu" else import_module("diff3ds.render.cuda.rasterize"))


def drawn_by(backend: str, inputs: KernelInputs) -> Images:
    """Colour, alpha and depth, differentiable once."""
    return autograd.draw(inputs, kernels_of(backend))
