"""Some cases of the fuzzing run (benchmarks/fuzz.py draws as many as asked for)."""

import pytest
from fuzz_cases import run_case


def parts(stop: int, size: int) -> list:
    """Starts of parts of a range; all but the first part are slow."""
    return [0, *(pytest.param(start, marks=pytest.mark.slow) for start in range(size, stop, size))]


@pytest.mark.parametrize("start", parts(400, 50))
def test_extreme_scenes(start):
    failures = {seed: wrong for seed in range(start, start + 50) if (wrong := run_case(seed))}
    assert not failures


@pytest.mark.parametrize("seed", parts(15, 1))
def test_extreme_scenes_of_the_reference(seed):
    assert not run_case(seed, "reference")


# Found by fuzzing: coordinates to 1e29, of which float32 leaves a depth of 0, and a stroke wider than all numbers.
NO_DEPTH = 4864


@pytest.mark.parametrize("start", parts(200, 20))
def test_extreme_scenes_of_cuda(cuda, start):
    failures = {seed: wrong for seed in (*range(start, start + 20), NO_DEPTH) if (wrong := run_case(seed, cuda))}
    assert not failures
