"""Fixtures of the renderer's tests: every backend of this machine, and both kinds of antialiasing."""

import pytest

from diff3ds.render import available_backends, get_num_threads, set_num_threads


@pytest.fixture(params=available_backends())
def backend(request) -> str:
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
