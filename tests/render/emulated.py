"""The CUDA kernels on the CPU, as a device: threads are fibers of one thread (emulation/), compiled by the system's compiler."""

import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
from importlib import import_module
from pathlib import Path

import pytest
import torch

from diff3ds.render.cuda.device import threads_of
from diff3ds.render.cuda.job import Job

HERE = Path(__file__).parent
KERNELS = HERE.parents[1] / "csrc" / "cuda"


@functools.cache
def compiler() -> str | None:
    """A C++ compiler, if there is one."""
    return next((found for name in (os.environ.get("CXX", ""), "g++", "clang++") if name and (found := shutil.which(name))), None)


@functools.cache
def library(real: str) -> ctypes.CDLL:
    """The kernels for pixels in "float" or "double"."""
    folder = Path(tempfile.mkdtemp(prefix="diff3ds-emulated-"))
    target, source = folder / f"{real}.so", HERE / "emulation" / "emulate.cpp"
    command = [compiler(), "-std=c++20", "-O1", "-shared", "-fPIC", f"-DREAL={real}", "-DSTROKE_EMULATE", f"-I{KERNELS}"]
    subprocess.run([*command, str(source), "-o", str(target)], check=True)
    loaded = ctypes.CDLL(str(target))
    shutil.rmtree(folder)
    loaded.job_size.restype = ctypes.c_size_t
    loaded.emulate.restype = ctypes.c_char_p
    assert loaded.job_size() == ctypes.sizeof(Job), "job.py and device.cuh disagree"
    return loaded


class Emulated:
    """Runs kernels at once. backwards: threads and blocks take their turns in the opposite order."""

    strides = 3

    def __init__(self, real: str, backwards: bool = False):
        self.library, self.backwards, self.waits, self.recording = library(real), backwards, 0, False

    def launch(self, name: str, blocks: int, job: Job) -> None:
        error = self.library.emulate(self.library[name], blocks, threads_of(name), ctypes.byref(job), self.backwards)
        assert not error, f"{name}: {error.decode()}"

    def wait(self) -> None:
        self.waits += 1

    def capturing(self) -> bool:
        return self.recording

    def report(self, length: int) -> torch.Tensor:
        return torch.zeros(length, dtype=torch.int64)


@functools.cache
def emulated(device: torch.device, dtype: torch.dtype) -> Emulated:
    return Emulated("float" if dtype == torch.float32 else "double")


def use_emulation(monkeypatch, device_for=emulated) -> None:
    """From now on the backend "cuda" draws tensors on the CPU."""
    if compiler() is None:
        pytest.skip("no C++ compiler to emulate the CUDA kernels with")
    # `diff3ds.render` is the function; its module has to be asked for.
    module, cuda = import_module("diff3ds.render"), import_module("diff3ds.render.cuda.rasterize")
    monkeypatch.setattr(cuda, "device_for", device_for)
    choose = module.choose_backend

    def chosen(backend, device, dtype):
        can = device.type == "cpu" and dtype in (torch.float32, torch.float64)
        return "cuda" if backend == "cuda" and can else choose(backend, device, dtype)

    monkeypatch.setattr(module, "choose_backend", chosen)
