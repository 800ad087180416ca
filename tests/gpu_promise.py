"""Where DIFF3DS_GPU promises GPUs, what a test of theirs lacks is a failure, not a skip."""

import os
from importlib import import_module

import pytest


def promised() -> int:
    """How many GPUs this machine is said to have: a test that cannot use them has failed."""
    return int(os.environ.get("DIFF3DS_GPU") or 0)


def lack(what: str, gpus: int = 1) -> None:
    """Skips a test or a module; where as many GPUs are promised, it has failed."""
    if promised() >= gpus:
        pytest.fail(f"{what}, and DIFF3DS_GPU={promised()} promises that nothing is left out")
    pytest.skip(what, allow_module_level=True)


def need(*modules: str) -> None:
    """Skips a test or a module, as `lack`, that needs other modules."""
    for name in modules:
        try:
            import_module(name)
        except ImportError:
            lack(f"{name} is not installed")
