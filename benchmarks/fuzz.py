"""Fuzzing of the renderer: random shapes, extreme values and sizes; prints the number of cases and of failures.

python benchmarks/fuzz.py --cases 20000 [--backend emulated]

"emulated" are the CUDA kernels, run as the tests run them without a GPU: pytest and a C++ compiler are needed.
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "render"))
from fuzz_cases import run_case


def main() -> int:
    """Runs the cases one after another; the exit status is 1 if any failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=20_000, help="number of random scenes")
    parser.add_argument("--start", type=int, default=0, help="seed of the first")
    parser.add_argument("--backend", choices=["reference", "cpu", "emulated"], help="default: the best there is")
    options = parser.parse_args()
    backend = _emulated() if options.backend == "emulated" else options.backend
    begin, failures = time.perf_counter(), 0
    for seed in range(options.start, options.start + options.cases):
        try:
            wrong = run_case(seed, backend)
        except (ArithmeticError, RuntimeError, TypeError, ValueError) as error:
            wrong = f"{type(error).__name__}: {error}"
        if wrong:
            failures += 1
            print(f"seed {seed}: {wrong}", flush=True)
    print(f"{options.cases} cases, {failures} failures, {time.perf_counter() - begin:.0f} s")
    return int(failures > 0)


def _emulated() -> str:
    """The backend that from now on draws tensors on the CPU by the emulated CUDA kernels."""
    import pytest
    from cuda_backends import use_emulation

    use_emulation(pytest.MonkeyPatch())
    return "cuda"


if __name__ == "__main__":
    sys.exit(main())
