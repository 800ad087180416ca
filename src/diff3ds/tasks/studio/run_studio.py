"""`diff3ds studio`: a page on this machine to say, draw or drop what becomes a sketch."""

import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path

from diff3ds._files import existing_folder
from diff3ds.tasks.serving.door import HOST
from diff3ds.tasks.serving.serve import PageServer, serve_until_interrupted
from diff3ds.tasks.studio.desk import Desk
from diff3ds.tasks.studio.line import Line
from diff3ds.tasks.view_sketch.view import warn_of

# Files on their way, in the folder of the studio.
COMING = ".coming"


def run_studio(
    out: Path,
    port: int,
    opened: bool,
    show: Callable[[str], None],
    say: Callable[[str], None] = lambda line: None,
    host: str = HOST,
    allowed: Sequence[str] = (),
) -> None:
    """Serves the studio until Ctrl-C; what is being made then goes on with the next studio of the folder.

    Args:
        out: the folder of what is made.
        port: of the address; 0 takes one that is free.
        opened: whether the browser of this machine is told to open it.
        show: told the address.
        say: told how to end, and what failed.
        host: the address that it listens on.
        allowed: other names by which browsers reach this machine.

    Raises:
        ValueError, OSError: a port that is taken or none; names that are none; a folder that cannot be made.
    """
    existing_folder(out)
    line = Line(out, say)
    server = PageServer(Desk(line, say).answer, "studio", port, host, allowed, out / COMING)
    out.mkdir(parents=True, exist_ok=True)
    with line:
        show(server.address)
        warn_of(host, say, "makes, sees and deletes sketches")
        say(f"what is made lies in {out}; Ctrl-C ends it")
        if opened:
            webbrowser.open(server.address)
        serve_until_interrupted(server, say)
