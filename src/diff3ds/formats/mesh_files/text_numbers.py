"""Numbers in the texts of mesh files."""

import re
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float

# How programs built with old compilers of Microsoft write NaN and infinity.
_NO_NUMBER = re.compile(rb"-?1\.#\w*|[-+]?nan(?:\([^)\s]*\))?", re.IGNORECASE)


def numbers(text: bytes) -> Float[Array, " N"]:
    """Numbers between white space, float64.

    Raises:
        ValueError: something that is none; a decimal comma is named.
    """
    try:
        return _parsed(text, np.float64)
    except ValueError:
        if not _NO_NUMBER.search(text):
            raise
        return _parsed(_NO_NUMBER.sub(b"nan", text), np.float64)


def whole_numbers(text: bytes) -> NDArray[np.int64]:
    """Whole numbers between white space.

    Raises:
        ValueError: something that is none.
    """
    return _parsed(text, np.int64)


def _parsed(text: bytes, kind: type) -> NDArray[Any]:
    if not text.strip():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        # numpy stops at what is no number, with this warning.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, kind, sep=" ")
        except (DeprecationWarning, ValueError):
            pass
    wrong = next((word for word in text.split() if not _is_number(word, kind)), b"")
    shown = wrong[:40].decode("latin-1")
    comma = ": write decimal points, not commas" if re.fullmatch(rb"[-+]?\d+,\d+", wrong) else ""
    raise ValueError(f"{shown!r} is no {'whole ' if kind is np.int64 else ''}number{comma}")


def _is_number(word: bytes, kind: type) -> bool:
    try:
        int(word) if kind is np.int64 else float(word)
    except ValueError:
        return False
    return True


def widths(lines: list[bytes]) -> NDArray[np.int64]:
    """How many words each line has."""
    return np.fromiter((len(line.split()) for line in lines), np.int64, len(lines))


def table(lines: list[bytes], count: NDArray[np.int64], least: int) -> Float[Array, "N W"]:
    """Numbers in lines of so many words each, NaN behind the end of shorter ones; at least so many columns.

    Raises:
        ValueError: as `numbers`.
    """
    flat = numbers(b"\n".join(lines))
    if len(flat) != count.sum():
        raise ValueError("a line has something that is no number")
    found = np.full((len(lines), int(count.max(initial=least))), np.nan)
    found[np.arange(found.shape[1]) < count[:, None]] = flat
    return found
