"""Reads a file in a process of its own: `python reader_process.py READER FILE` answers in JSON.

The reader is a file below the folder of this one, such as cad/step_reader; its `strokes_of(path)` returns strokes, and
lines of what is left out or assumed. None of these files imports the package.
"""

import contextlib
import importlib.util
import json
import os
import sys
from pathlib import Path
from typing import Any

# Bytes of addresses: what hostile counts ask for fails. Libraries map some 2 GiB by themselves.
MEMORY = 1 << 33


def answer_of(reader: str, path: str) -> dict[str, Any]:
    """{"strokes": [...], "said": [...]} or {"error": message}."""
    try:
        place = Path(__file__).parent / f"{reader}.py"
        spec = importlib.util.spec_from_file_location(place.stem, place)
        assert spec, place
        assert spec.loader, place
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        strokes, said = module.strokes_of(path)
    # The libraries' exceptions have no common class but this.
    except Exception as error:
        return {"error": str(error).strip() or type(error).__name__}
    return {"strokes": strokes, "said": said}


def main(reader: str, path: str) -> None:
    """Prints the answer."""
    with contextlib.suppress(ImportError):  # not on Windows
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    # Libraries print statistics to the standard output: that goes to the error output, the answer to the real one.
    answer = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    result = answer_of(reader, path)
    with answer:
        json.dump(result, answer)


if __name__ == "__main__":
    main(*sys.argv[1:])
