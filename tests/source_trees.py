"""Sources of Python, parsed: without a search for garbage, which would take three quarters of the time."""

import ast
import functools
import gc
from pathlib import Path


@functools.cache
def tree_of(path: Path) -> ast.Module:
    """Of a file, once for all tests."""
    text, searches = path.read_text(encoding="utf-8"), gc.isenabled()
    gc.disable()
    try:
        return ast.parse(text)
    finally:
        if searches:
            gc.enable()
