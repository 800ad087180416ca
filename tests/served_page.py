"""The local server of `diff3ds view` on a thread, within a block."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from diff3ds.tasks.view_sketch.serve import server_of


@contextmanager
def served(source: Path, said: list[str] | None = None, **more: Any) -> Iterator[Any]:
    """A server of a file or folder, on any free port; what it says goes to `said`."""
    server = server_of(source, 0, (said if said is not None else []).append, **more)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
