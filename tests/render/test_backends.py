"""Which backend draws on a GPU that is only pretended, and why not the kernels."""

import importlib.util
import threading
from importlib import import_module

import pytest
import torch

from diff3ds.render.backends import get_num_threads, set_num_threads, torch_on_one_thread
from diff3ds.render.cuda import versions

backends = import_module("diff3ds.render.backends")
GPU = torch.device("cuda", 0)


@pytest.fixture
def gpu(monkeypatch):
    """An H200, a torch for CUDA 13, and all packages."""
    for function in (backends._why_no_cuda, backends._warn_about_slow_device):
        function.cache_clear()
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "get_device_capability", lambda device: (9, 0))
    monkeypatch.setattr(torch.version, "hip", None)
    monkeypatch.setattr(torch.version, "cuda", "13.0")
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: find_spec("json" if name.startswith("cuda") else name)
    )
    monkeypatch.setattr(versions.metadata, "version", lambda name: "13.1.2")
    yield
    for function in (backends._why_no_cuda, backends._warn_about_slow_device):
        function.cache_clear()


def test_kernels_draw(gpu):
    assert backends.available_backends()[-1] == "cuda"
    assert backends.choose_backend(None, GPU, torch.float32) == "cuda"


def refused(why: str) -> None:
    """The reference draws, with a note; to ask for the kernels is an error."""
    assert "cuda" not in backends.available_backends()
    with pytest.warns(RuntimeWarning, match=f"{why}; the reference in PyTorch draws"):
        assert backends.choose_backend(None, GPU, torch.float32) == "reference"
    with pytest.raises(ValueError, match=f'backend "cuda" does not run here. {why}'):
        backends.choose_backend("cuda", GPU, torch.float32)


def test_packages_that_are_missing(gpu, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    refused("The kernels for NVIDIA GPUs need cuda-core: `pip install .*`")


def test_gpus_that_are_too_old(gpu, monkeypatch):
    monkeypatch.setattr(torch.cuda, "get_device_capability", lambda device: (6, 1))
    refused("The kernels for NVIDIA GPUs need compute capability 7.0, and this one has 6.1")


def test_one_of_two_gpus_is_too_old(gpu, monkeypatch):
    monkeypatch.setattr(torch.cuda, "get_device_capability", lambda device: (6, 1) if device.index == 1 else (7, 0))
    assert backends.choose_backend(None, GPU, torch.float32) == "cuda"
    with pytest.warns(RuntimeWarning, match="this one has 6.1"):
        assert backends.choose_backend(None, torch.device("cuda", 1), torch.float32) == "reference"


def test_a_compiler_newer_than_torch(gpu, monkeypatch):
    """What it makes, a driver that is just new enough for torch would not load."""
    monkeypatch.setattr(torch.version, "cuda", "12.8")
    refused(r'The compiler of the kernels .* torch is built for CUDA 12: pip install "cuda-bindings==12.\*"')


def test_a_compiler_older_than_torch(gpu, monkeypatch):
    monkeypatch.setattr(versions.metadata, "version", lambda name: "12.9.1")
    assert backends.choose_backend("cuda", GPU, torch.float64) == "cuda"


def test_fits_side_by_side_leave_the_number_of_threads_as_it_was():
    """They overlap: the second begins while the first is inside, and ends after it."""
    torch_threads = torch.get_num_threads()
    torch.set_num_threads(2)
    inside, second_inside, left = threading.Event(), threading.Event(), threading.Event()
    seen: list[int] = []

    def first() -> None:
        with torch_on_one_thread():
            inside.set()
            assert second_inside.wait(60)
        left.set()

    def second() -> None:
        assert inside.wait(60)
        with torch_on_one_thread():
            second_inside.set()
            assert left.wait(60)
            seen.append(get_num_threads())

    set_num_threads(3)
    try:
        runs = [threading.Thread(target=run) for run in (first, second)]
        for run in runs:
            run.start()
        for run in runs:
            run.join(60)
        assert seen == [3]
        assert get_num_threads() == 3
        # Also in threads that begin later.
        later: list[int] = []
        thread = threading.Thread(target=lambda: later.append(torch.get_num_threads()))
        thread.start()
        thread.join(60)
        assert later == [torch.get_num_threads()] == [2]
        set_num_threads(2)
        assert get_num_threads() == 2
    finally:
        set_num_threads(None)
        torch.set_num_threads(torch_threads)
