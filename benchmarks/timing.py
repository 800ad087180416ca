"""Interleaved timing: every way to do a job takes its turn in every round, so that a busy moment hits all of them."""

import time
from collections.abc import Callable
from typing import NamedTuple

import torch

# Seconds that one way spends on its turn, so that short calls run in a warm cache as they do in a loop.
TURN = 0.03
MAX_CALLS = 50


class Times(NamedTuple):
    """Milliseconds a call: median and quartiles over all timed calls."""

    median: float
    low: float
    high: float

    def __str__(self) -> str:
        median, low, high = (f"{x:.0f}" if x > 999 else f"{x:.3g}" for x in self)
        return f"{median} [{low}, {high}]"


def interleaved(ways: dict[str, Callable[[], object]], rounds: int) -> dict[str, Times]:
    """Times of each way, over so many rounds; one untimed call comes before every turn."""
    calls = {name: _calls_a_turn(way) for name, way in ways.items()}
    samples: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, way in ways.items():
            way()
            samples[name] += [milliseconds(way) for _ in range(calls[name])]
    return {name: _summary(values) for name, values in samples.items()}


def _calls_a_turn(way: Callable[[], object]) -> int:
    way()
    return max(1, min(MAX_CALLS, int(1e3 * TURN / milliseconds(way))))


def milliseconds(way: Callable[[], object]) -> float:
    """Time of a single call."""
    start = time.perf_counter()
    way()
    return 1e3 * (time.perf_counter() - start)


def _summary(values: list[float]) -> Times:
    return Times(*torch.tensor(values, dtype=torch.float64).quantile(torch.tensor([0.5, 0.25, 0.75]).double()).tolist())
