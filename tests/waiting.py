"""Waiting for what another process, thread or page does, however loaded the machine is."""

import time
from collections.abc import Callable
from typing import TypeVar

# Seconds.
PATIENCE = 300
Found = TypeVar("Found")


def until(condition: Callable[[], Found], what: str) -> Found:
    """What the condition says once that is true."""
    end = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < end, f"{what} does not happen"
        time.sleep(0.02)
    return found
