"""Reads a file in a process of its own: `python reader_process.py READER FILE` answers in JSON.

The reader is a module of this package, such as diff3ds.formats.cad.step_reader; its `found_in(path, told)` returns what
it finds, and lines of what is left out or assumed, and tells how much it has done. Readers import each other as modules
of the package, of which nothing else is imported, torch least of all.
"""

import contextlib
import importlib
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

# Bytes of addresses: what hostile counts ask for fails. Libraries map some 2 GiB by themselves.
MEMORY = 1 << 33


def answer_of(reader: str, path: str, told: Callable[[int, int], None] = lambda done, of: None) -> dict[str, Any]:
    """{"found": ..., "said": [...]} or {"error": message}."""
    try:
        found, said = importlib.import_module(reader).found_in(path, told)
    # The libraries' exceptions have no common class but this.
    except Exception as error:
        return {"error": str(error).strip() or type(error).__name__}
    return {"found": found, "said": said}


def main(reader: str, path: str) -> None:
    """Prints {"done": ..., "of": ...} now and then, and the answer; a line each."""
    with contextlib.suppress(ImportError):  # not on Windows
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    # Packages without what their own __init__ would import.
    formats = Path(__file__).parent
    for name, folder in (("diff3ds", formats.parent), ("diff3ds.formats", formats)):
        sys.modules[name] = ModuleType(name)
        sys.modules[name].__path__ = [str(folder)]
    # Libraries print statistics to the standard output: that goes to the error output, the answer to the real one.
    answer = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    def told(done: int, of: int) -> None:
        print(json.dumps({"done": done, "of": of}), file=answer, flush=True)

    result = answer_of(reader, path, told)
    with answer:
        json.dump(result, answer)


if __name__ == "__main__":
    main(*sys.argv[1:])
