"""One row of the tables of docs/reference/formats-read.md, as a file that has the feature."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Example:
    """A small file with one feature of its format, and what is right to come of it.

    Attributes:
        make: writes the file, and what lies beside it, into an empty folder and returns its path.
        right: whether what was read is right; not asked where the feature is refused.
        words: that the refusal, or the warning, has; both must have some.
    """

    make: Callable[[Path], Path]
    right: Callable[[Any], Any] = lambda read: True
    words: str = ""
