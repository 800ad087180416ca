"""The local server of `diff3ds view` on a thread, within a block."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from diff3ds.tasks.serving.serve import serving
from diff3ds.tasks.view_sketch.view import server_of


@contextmanager
def served(source: Path, said: list[str] | None = None, **more: Any) -> Iterator[Any]:
    """A server of a file or folder, on any free port; what it says goes to `said`."""
    server = server_of(source, 0, (said if said is not None else []).append, **more)
    with serving(server):
        yield server
