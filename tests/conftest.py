"""Settings shared by all tests: repeatable property tests, and the folder with data for development."""

import os
from pathlib import Path

import hypothesis
import jaxtyping
import pytest
import torch

# Before any library of the hub is imported: nothing is looked for on the network.
os.environ["HF_HUB_OFFLINE"] = "1"

# Derandomised: a run fails or passes for what the code does, not for the day's luck. No deadline: machines differ.
hypothesis.settings.register_profile("diff3ds", derandomize=True, deadline=None, print_blob=False, database=None)
hypothesis.settings.load_profile("diff3ds")


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
