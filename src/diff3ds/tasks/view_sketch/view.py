"""`diff3ds view`: the page of one sketch, or of a run while it goes on, for the browser of this machine."""

import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Literal

from diff3ds.tasks.serving.door import HOST
from diff3ds.tasks.serving.serve import PageServer, serve_until_interrupted, serving
from diff3ds.tasks.sketch_input import load_sketch
from diff3ds.tasks.surface_input import SurfaceInput
from diff3ds.tasks.view_sketch.answers import answer_of
from diff3ds.tasks.view_sketch.shown_page import ShownPage


def run_view(
    source: Path,
    port: int,
    opened: bool,
    show: Callable[[str], None],
    say: Callable[[str], None] = lambda line: None,
    beside: Path | None = None,
    surface: Path | None = None,
    surface_up: Literal["z", "y"] = "z",
    host: str = HOST,
    allowed: Sequence[str] = (),
) -> None:
    """Shows a sketch until Ctrl-C.

    Args:
        source: a file with a sketch, or the folder of a run.
        port: of the address; 0 takes one that is free.
        opened: whether the browser of this machine is told to open it.
        show: told the address.
        say: told how to end, and what is wrong with a file that has changed.
        beside: a file with a second sketch, or the folder of a run, which is seen by the same camera.
        surface: a mesh that hides lines of the sketch; by default that of the run, where there is one.
        surface_up: the axis that points up in its file.
        host: the address that it listens on.
        allowed: other names by which browsers reach this machine, such as that of a hub that passes requests on.

    Raises:
        ValueError, OSError, ImportError: as `load_sketch` and `load_surface`; a port that is taken or none; names that
            are none.
    """
    server = server_of(source, port, say, False, beside, surface, surface_up, host, allowed)
    show(server.address)
    warn_of(host, say, "sees and changes the sketch")
    say("Ctrl-C ends it")
    if opened:
        webbrowser.open(server.address)
    serve_until_interrupted(server, say)


def warn_of(host: str, say: Callable[[str], None], what: str) -> None:
    """Says what an address means that others reach."""
    if host not in (HOST, "localhost", "::1"):
        say(f"warning: {host} is more than this machine: whoever has the address {what}")


@contextmanager
def shown_meanwhile(out: Path, show: Callable[[str], None], say: Callable[[str], None]) -> Iterator[None]:
    """Serves the page of a run while it goes on, by a thread beside it; when it is done, until Ctrl-C.

    A run that fails, or that Ctrl-C stops, takes the page with it.

    Args:
        out: the folder of the run, which need not be there yet.
        show: told the address.
        say: told how to end, when the run is done.
    """
    server = server_of(out, 0, say, waits=True)
    with serving(server) as thread:
        show(server.address)
        yield
        say(f"the page stays at {server.address} until Ctrl-C")
        with suppress(KeyboardInterrupt):
            # In parts, between which Ctrl-C is seen on every system.
            while thread.is_alive():
                thread.join(0.5)


def server_of(
    source: Path,
    port: int,
    say: Callable[[str], None],
    waits: bool = False,
    beside: Path | None = None,
    surface: Path | None = None,
    surface_up: Literal["z", "y"] = "z",
    host: str = HOST,
    allowed: Sequence[str] = (),
) -> PageServer:
    """The server of a sketch, which listens but does not answer yet.

    Args:
        waits: `source` is the folder of a run that has not begun: its page is empty before there are strokes.
        beside: as of `run_view`, as the next ones.
        surface: what hides lines.
        surface_up: the axis that points up in its file.
        host: as of `run_view`, as the next one.
        allowed: names.

    Raises:
        ValueError, OSError, ImportError: as `run_view`.
    """
    # What cannot be shown is said before anything listens.
    for path in [] if waits else [source, *([] if beside is None else [beside])]:
        load_sketch(path)
    solid = SurfaceInput(source, surface, surface_up, say)
    page = ShownPage(source, say, solid, waits, None if beside is None else ShownPage(beside, say))
    page.text()
    return PageServer(partial(answer_of, page), "view", port, host, allowed)
