"""Checks of settings that need no torch: the command line makes them before anything large is loaded."""

import dataclasses
import math
from typing import Any

# Images beyond this side, pixels, are taken for a mistake.
MAX_SIZE = 65536


def require_finite(options: Any) -> None:
    """Raises ValueError that names the first field of a dataclass with a number that is not finite."""
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        numbers = value if isinstance(value, tuple) else (value,)
        if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
            got = " ".join(map(str, numbers))
            raise ValueError(f"{field.name} must be finite, got {got}")


def check_seed(seed: int) -> None:
    """Raises ValueError for what torch's generators do not take."""
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 1 << 63:
        raise ValueError(f"seed must be a whole number from 0 to 2^63 - 1, got {seed!r}")
