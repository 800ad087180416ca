"""Settings shared by all tests: one thread each, repeatable property tests, the folder with data for development."""

import gc
import os
from pathlib import Path

# One thread a process, before torch starts any: pytest-xdist fills the processors, and tests that need more say so.
os.environ["OMP_NUM_THREADS"] = "1"

import hypothesis
import jaxtyping
import pytest
import torch
from gpu_promise import promised
from reading_here import reading_here

# Each takes up to 1.5 GB of memory.
MOST_WORKERS = 8

# Before any library of the hub is imported: nothing is looked for on the network.
os.environ["HF_HUB_OFFLINE"] = "1"

# Derandomised: a run fails or passes for what the code does, not for the day's luck. No deadline: machines differ.
hypothesis.settings.register_profile("diff3ds", derandomize=True, deadline=None, print_blob=False, database=None)
hypothesis.settings.load_profile("diff3ds")


def pytest_xdist_auto_num_workers(config) -> int:
    """All tests, or a folder of them, share the processors; files named one by one run here, as all do with a GPU."""
    named_files = any(".py" in argument for argument in config.args)
    gpu = promised() or torch.cuda.is_available()
    return 0 if named_files or gpu else min(len(os.sched_getaffinity(0)), MOST_WORKERS)


def pytest_addoption(parser: pytest.Parser) -> None:
    """For the run that checks annotations: the cases of one test call the same functions."""
    parser.addoption("--first-cases", action="store_true", help="of each test the first of its cases alone")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """After the slow ones are left out, or a test whose first case is slow would have none."""
    if config.getoption("--first-cases"):
        first: dict[str, pytest.Item] = {}
        for item in items:
            first.setdefault(item.nodeid.partition("[")[0], item)
        kept = set(first.values())
        config.hook.pytest_deselected(items=[item for item in items if item not in kept])
        items[:] = list(first.values())


def pytest_collection() -> None:
    """What collection makes stays to the end: no search for garbage need look at it, now or later."""
    gc.disable()


def pytest_collection_finish() -> None:
    """From here on tests make garbage."""
    gc.freeze()
    gc.enable()


@pytest.fixture
def generator() -> torch.Generator:
    """A seeded source of random numbers."""
    return torch.Generator().manual_seed(0)


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder that DIFF3DS_DATA names; tests on real data are skipped without it."""
    folder = os.environ.get("DIFF3DS_DATA")
    if not folder or not Path(folder).is_dir():
        pytest.skip("DIFF3DS_DATA does not name the folder with the data for development")
    return Path(folder)


@pytest.fixture
def unchecked():
    """The package as users run it: bad arguments meet its own errors, not those of the checked annotations."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture
def read_here():
    """Files are read in this process."""
    with reading_here():
        yield
