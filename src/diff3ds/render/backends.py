"""Which implementation renders: the kernels for the tensors' device where they are, else the reference."""

import functools
import importlib
import importlib.util
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Lock
from types import ModuleType
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from diff3ds._checks import users_level
from diff3ds.render.cuda.versions import advice_on_bindings

Backend = Literal["reference", "cpu", "cuda"]

# Volta, the first whose lanes may take different ways between exchanges.
_OLDEST_GPU = (7, 0)
_ANY_GPU = torch.device("cuda")

_thread_count: int | None = None
# Of the kernels inside `torch_on_one_thread`, in one thread of Python: fits may run side by side.
_fixed_threads: ContextVar[int | None] = ContextVar("threads of the CPU kernels", default=None)
# How often `torch_on_one_thread` is entered and not left, and torch's threads before.
_entering, _inside, _torch_threads = Lock(), 0, 1


@functools.cache
def kernels() -> ModuleType | None:
    """The compiled CPU kernels, or None if the package was installed without a compiler."""
    try:
        return importlib.import_module("diff3ds._kernels")
    except ModuleNotFoundError:
        return None


def for_kernels(*arrays: NDArray[Any]) -> list[Tensor]:
    """Arrays as the compiled kernels take them: as tensors, of the same memory if they can be; floats are doubles."""
    return [torch.from_numpy(np.ascontiguousarray(x, np.float64 if x.dtype.kind == "f" else None)) for x in arrays]


def set_num_threads(count: int | None) -> None:
    """Threads of the CPU kernels; None (the default) follows `torch.get_num_threads()`.

    Results do not depend on it, to the last bit.

    Raises:
        ValueError: not a positive integer.
    """
    global _thread_count
    if count is not None and not (isinstance(count, int) and count > 0):
        raise ValueError(f"the number of threads must be a positive integer or None, got {count!r}")
    _thread_count = count


def get_num_threads() -> int:
    """Threads that the CPU kernels use."""
    return _fixed_threads.get() or _thread_count or torch.get_num_threads()


@contextmanager
def torch_on_one_thread(kernels: int | None = None) -> Iterator[None]:
    """Inside, torch computes on one thread, and the kernels on as many as before, or as many as said.

    Torch splits its sums over its threads, so that their last bits depend on the number of threads; the kernels' do
    not.
    """
    global _inside, _torch_threads
    nested = _fixed_threads.get()
    with _entering:
        # They may overlap, on several threads of Python: what the first to enter finds is what all bring back.
        _torch_threads = _torch_threads if _inside else torch.get_num_threads()
        _inside += 1
        token = _fixed_threads.set(kernels or nested or _thread_count or _torch_threads)
        torch.set_num_threads(1)
    try:
        yield
    finally:
        with _entering:
            _inside -= 1
            torch.set_num_threads(1 if nested else _torch_threads)
        _fixed_threads.reset(token)


def available_backends() -> list[Backend]:
    """Backends that run on this machine, the reference first."""
    compiled: list[Backend] = [] if kernels() is None else ["cpu"]
    on_gpu: list[Backend] = [] if _why_no_cuda() else ["cuda"]
    return ["reference", *compiled, *on_gpu]


@functools.cache
def _why_no_cuda(device: torch.device = _ANY_GPU) -> str:
    """What keeps the CUDA kernels from running on a GPU, or on torch's current one; empty if nothing does."""
    if torch.version.hip is not None or not torch.cuda.is_available():
        return "There is no NVIDIA GPU that torch sees"
    if any(importlib.util.find_spec(name) is None for name in ("cuda", "cuda.core", "cuda.bindings")):
        return 'The kernels for NVIDIA GPUs need cuda-core: `pip install "diff3ds[cuda]"`'
    if (capability := torch.cuda.get_device_capability(device)) < _OLDEST_GPU:
        needed, got = (".".join(map(str, numbers)) for numbers in (_OLDEST_GPU, capability))
        return f"The kernels for NVIDIA GPUs need compute capability {needed}, and this one has {got}"
    if advice := advice_on_bindings():
        return f"The compiler of the kernels for NVIDIA GPUs is newer than torch; {advice}"
    return ""


def choose_backend(backend: Backend | None, device: torch.device, dtype: torch.dtype) -> Backend:
    """The backend asked for, if it can draw on this device and dtype, or for None the best that can.

    Raises:
        ValueError: an unknown backend, or one that cannot.
    """
    if backend is None:
        return _best_backend(device, dtype)
    if backend not in ("reference", "cpu", "cuda"):
        raise ValueError(f'backend must be "reference", "cpu", "cuda" or None, got {backend!r}')
    if backend == "reference":
        return backend
    if backend == "cpu" and kernels() is None:
        raise ValueError(f'backend "cpu" is not installed. {_HOW_TO_BUILD}')
    if backend == "cuda" and (why := _why_no_cuda(device if device.type == "cuda" else _ANY_GPU)):
        raise ValueError(f'backend "cuda" does not run here. {why}')
    if device.type != backend:
        raise ValueError(
            f'backend "{backend}" draws tensors on {backend}, got {device}: use .to("{backend}") or backend=None'
        )
    if dtype not in _KERNEL_DTYPES:
        names = ", ".join(str(known).removeprefix("torch.") for known in _KERNEL_DTYPES)
        raise ValueError(f'backend "{backend}" draws {names}, got {dtype}: use .to(torch.float32)')
    return backend


def kernel_dtype(dtype: torch.dtype) -> torch.dtype:
    """The dtype in which kernels draw strokes of another: halves have too few digits, and too few numbers to gain."""
    return torch.float32 if dtype in _HALVES else dtype


def drawing_device(device: torch.device) -> torch.device:
    """Where strokes on a device are drawn: there, or on the CPU if they cannot be projected there."""
    if not lacks_float64(device):
        return device
    _warn_about_drawing_elsewhere(device.type)
    return torch.device("cpu")


def lacks_float64(device: torch.device) -> bool:
    """Whether a device cannot compute in float64, as Apple's GPUs cannot."""
    return device.type == "mps"


_HALVES = (torch.float16, torch.bfloat16)
_KERNEL_DTYPES = (torch.float32, torch.float64, *_HALVES)
_HOW_TO_BUILD = (
    "Install a C++20 compiler (g++ or clang++, for example `apt install g++` or `xcode-select --install`) and install "
    "diff3ds again: `pip install --force-reinstall --no-deps diff3ds`, or for a checkout `pip install -e .`"
)


def _best_backend(device: torch.device, dtype: torch.dtype) -> Backend:
    if device.type not in ("cpu", "meta"):
        if device.type == "cuda" and not _why_no_cuda(device):
            return "cuda" if dtype in _KERNEL_DTYPES else "reference"
        _warn_about_slow_device(device)
        return "reference"
    if device.type != "cpu" or dtype not in _KERNEL_DTYPES:
        return "reference"
    if kernels() is None:
        _warn_about_missing_kernels()
        return "reference"
    return "cpu"


@functools.cache
def _warn_about_slow_device(device: torch.device) -> None:
    """Once a process and device."""
    amd = torch.version.hip is not None
    why = "There are no kernels for AMD GPUs" if amd else f"There are no kernels for {device.type} devices"
    why = _why_no_cuda(device) if device.type == "cuda" and not amd else why
    warnings.warn(
        f"{why}; the reference in PyTorch draws, much slower. On the CPU compiled kernels draw: move the sketch and "
        'the cameras there with .to("cpu").',
        RuntimeWarning,
        stacklevel=users_level(),
    )


@functools.cache
def _warn_about_drawing_elsewhere(kind: str) -> None:
    """Once a process and kind of device."""
    warnings.warn(
        f"{kind} devices lack float64, in which strokes are projected: they are drawn on the CPU, and the images moved "
        'back. Nothing is moved if the sketch and the cameras are on the CPU: .to("cpu").',
        RuntimeWarning,
        stacklevel=users_level(),
    )


@functools.cache
def _warn_about_missing_kernels() -> None:
    """Once a process."""
    warnings.warn(
        "diff3ds was installed without its compiled kernels; the reference draws instead, hundreds of times slower. "
        f"{_HOW_TO_BUILD}.",
        RuntimeWarning,
        stacklevel=users_level(),
    )
