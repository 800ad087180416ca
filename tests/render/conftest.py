"""Fixtures of the renderer's tests: every backend of this machine, and both kinds of antialiasing."""

import pytest
from emulated import use_emulation

from diff3ds.render import available_backends, get_num_threads, set_num_threads


@pytest.fixture(params=[*(name for name in available_backends() if name != "cuda"), "cuda"])
def backend(request, monkeypatch) -> str:
    """A backend that draws tensors on the CPU; the CUDA kernels are emulated."""
    if request.param == "cuda":
        use_emulation(monkeypatch)
    return request.param


@pytest.fixture(params=["analytic", "montecarlo"])
def antialiasing(request) -> str:
    return request.param


@pytest.fixture
def threads():
    """Sets the number of threads of the kernels; put back afterwards."""
    before = get_num_threads()
    yield set_num_threads
    set_num_threads(before)
