"""A page with a sketch from a server on this machine, which gives it to nobody else.

It listens on 127.0.0.1, shows the page under a secret in the address and nothing besides, and answers only what asks
for this address by name: not other sites' scripts, and no name that another site has pointed here.
"""

import secrets
import webbrowser
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Lock
from typing import Any

from diff3ds.formats.scenes.html import sketch_page
from diff3ds.tasks.sketch_input import load_sketch

# The only address it listens on.
HOST = "127.0.0.1"
# Of all answers: nothing is kept, shown within other pages, or handed to them.
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
}


def run_view(
    source: Path, port: int, opened: bool, show: Callable[[str], None], say: Callable[[str], None] = lambda line: None
) -> None:
    """Shows a sketch until Ctrl-C.

    Args:
        source: a file with a sketch, or the folder of a run.
        port: of the address; 0 takes one that is free.
        opened: whether the browser of this machine is told to open it.
        show: told the address.
        say: told how to end, and what is wrong with a file that has changed.

    Raises:
        ValueError, OSError, ImportError: as `load_sketch`; a port that is taken or none.
    """
    with server_of(source, port, say) as server:
        show(server.address)
        say("Ctrl-C ends it")
        if opened:
            webbrowser.open(server.address)
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            say("ended")


class PageServer(ThreadingHTTPServer):
    """Serves one page.

    Attributes:
        address: to open, with its secret.
    """

    daemon_threads = True

    def __init__(self, page: "_Page", port: int) -> None:
        """Listens at once."""
        super().__init__((HOST, port), _Handler)
        self.page = page
        self.secret = secrets.token_urlsafe(16)
        self.names = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}
        self.address = f"http://{HOST}:{self.server_port}/{self.secret}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away is no fault."""


def server_of(source: Path, port: int, say: Callable[[str], None]) -> PageServer:
    """The server of a sketch, which listens but does not answer yet.

    Raises:
        ValueError, OSError, ImportError: as `run_view`.
    """
    if not 0 <= port <= 65535:
        raise ValueError(f"port must be from 0 to 65535, got {port}")
    # What cannot be shown is said before anything listens.
    load_sketch(source)
    page = _Page(source, say)
    page.text()
    try:
        return PageServer(page, port)
    except OSError as error:
        raise OSError(f"port {port} cannot be had ({error.strerror}): leave --port out for one that is free") from error


class _Page:
    """The page of a file, made anew when that changes; of a file that has become no sketch, the one before."""

    def __init__(self, source: Path, say: Callable[[str], None]) -> None:
        self.source, self.say = source, say
        self.lock = Lock()
        self.made: tuple[str, str] | None = None
        self.refused = ""

    def version(self) -> str:
        """Says which state of the file the page shows, after a look at it."""
        self.text()
        assert self.made is not None
        return self.made[0]

    def text(self) -> str:
        """The page.

        Raises:
            ValueError, OSError, ImportError: as `load_sketch`, where there is no page from before.
        """
        with self.lock:
            try:
                version = self._state()
                if version not in (self.made[0] if self.made else "", self.refused):
                    title = self.source.stem if self.source.is_file() else self.source.resolve().name
                    self.made = version, sketch_page(title, load_sketch(self.source).detach(), version)
                    self.refused = ""
            except (ValueError, OSError, ImportError) as error:
                if self.made is None:
                    raise
                # Once, and not at every question; a file in the middle of being written is another one soon.
                if (state := self._state_or_nothing()) != self.refused:
                    self.refused = state
                    self.say(f"warning: {error}; the page shows what there was")
            assert self.made is not None
            return self.made[1]

    def _state(self) -> str:
        path = self.source / "sketch.json" if self.source.is_dir() else self.source
        found = path.stat()
        return f"{found.st_mtime_ns}-{found.st_size}"

    def _state_or_nothing(self) -> str:
        try:
            return self._state()
        except OSError:
            return "nothing"


class _Handler(BaseHTTPRequestHandler):
    """Answers GET for two addresses."""

    server: PageServer
    # Nothing of Python or of this package for those who only knock.
    server_version, sys_version = "diff3ds", ""
    # Seconds that somebody may take to ask.
    timeout = 10

    def do_GET(self) -> None:
        """The page, or the state of its file."""
        origin = self.headers.get("Origin")
        foreign = origin is not None and origin.removeprefix("http://") not in self.server.names
        if self.headers.get("Host") not in self.server.names or foreign:
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", "this address is for the browser of its own machine")
            return
        asked = self.path.encode()
        for name, kind, made in (
            ("", "text/html", self.server.page.text),
            ("version", "text/plain", self.server.page.version),
        ):
            if secrets.compare_digest(asked, f"/{self.server.secret}/{name}".encode()):
                self._answer(HTTPStatus.OK, kind, made())
                return
        self._answer(
            HTTPStatus.NOT_FOUND, "text/plain", "there is nothing here: open the address that diff3ds view says"
        )

    def _answer(self, status: HTTPStatus, kind: str, text: str) -> None:
        content = text.encode()
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": f"{kind}; charset=utf-8"}.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing: the address has a secret."""
