"""Graphs of torch (compile, export, make_fx) around `render`: the checks of `compiled_checks.py`, in another process.

Dynamo cannot look into the checks of annotations that the package is imported with here.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from diff3ds.render import available_backends

CHECKS = Path(__file__).parent / "compiled_checks.py"
QUICK = ["-q", "--noconftest", "-p", "no:cacheprovider", "-o", "addopts="]


def run_checks(*chosen: str) -> None:
    command = [sys.executable, "-m", "pytest", *QUICK, *chosen, CHECKS]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-20_000:]


@pytest.mark.skipif("cpu" not in available_backends(), reason="no compiled kernels")
def test_a_whole_graph_draws_as_eager_calls_do() -> None:
    """The one that every run makes: images and gradients, in one graph of torch.compile and in one of make_fx."""
    run_checks("-k", "(test_a_compiled_loss_is_the_loss and world) or make_fx")


@pytest.mark.slow
@pytest.mark.skipif("cpu" not in available_backends(), reason="no compiled kernels")
def test_graphs_draw_as_eager_calls_do() -> None:
    run_checks("-m", "not slow")


@pytest.mark.slow
@pytest.mark.skipif("cpu" not in available_backends(), reason="no compiled kernels")
def test_inductor_draws_as_eager_calls_do() -> None:
    run_checks("-m", "slow")
