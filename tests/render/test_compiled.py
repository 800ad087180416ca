"""torch.compile and torch.export around `render`: the checks of `compiled_checks.py`, in a process of their own.

Dynamo cannot look into the checks of annotations that the package is imported with here.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from diff3ds.render import available_backends

CHECKS = Path(__file__).parent / "compiled_checks.py"
QUICK = ["-q", "--noconftest", "-p", "no:cacheprovider", "-o", "addopts="]


def run_checks(marked: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *QUICK, "-m", marked, CHECKS], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-20_000:]


@pytest.mark.slow
@pytest.mark.skipif("cpu" not in available_backends(), reason="no compiled kernels")
def test_graphs_draw_as_eager_calls_do() -> None:
    run_checks("not slow")


@pytest.mark.slow
@pytest.mark.skipif("cpu" not in available_backends(), reason="no compiled kernels")
def test_inductor_draws_as_eager_calls_do() -> None:
    run_checks("slow")
