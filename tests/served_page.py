"""The local servers of `diff3ds view` and `diff3ds studio` on a thread, within a block."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from diff3ds.tasks.serving.serve import PageServer, serving
from diff3ds.tasks.studio.desk import Desk
from diff3ds.tasks.studio.line import Line
from diff3ds.tasks.studio.run_studio import COMING
from diff3ds.tasks.view_sketch.view import server_of


@contextmanager
def served(source: Path, said: list[str] | None = None, **more: Any) -> Iterator[Any]:
    """A server of a file or folder, on any free port; what it says goes to `said`."""
    server = server_of(source, 0, (said if said is not None else []).append, **more)
    with serving(server):
        yield server


@contextmanager
def served_studio(out: Path) -> Iterator[Any]:
    """A server of a studio; its `line` is not worked on but within a block of its own."""
    line = Line(out, lambda text: None)
    server: Any = PageServer(Desk(line, lambda text: None).answer, "studio", 0, files=out / COMING)
    server.line = line
    with serving(server):
        yield server
