"""A page with a sketch from a server on this machine, which gives it to nobody else.

It listens on 127.0.0.1, shows the page under a secret in the address and nothing besides, and answers only what asks
for this machine by name, through whatever port a tunnel has: not other sites' scripts, and no name that another site
has pointed here.
"""

import json
import re
import secrets
import socket
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any, Literal

from diff3ds.tasks.sketch_input import load_sketch
from diff3ds.tasks.surface_input import SurfaceInput
from diff3ds.tasks.view_sketch import saving
from diff3ds.tasks.view_sketch.run_folder import picture_in
from diff3ds.tasks.view_sketch.shown_page import ShownPage

# The address it listens on, unless another is asked for; how browsers call this machine; all addresses of a machine.
HOST = "127.0.0.1"
NAMES = (HOST, "localhost", "[::1]")
EVERYWHERE = ("0.0.0.0", "::")
# What a request calls a server: a name or address, and a port; what users call one.
_AUTHORITY = re.compile(r"(\[[0-9a-f:.]+\]|[^\[\]:/@\s]+)(?::[0-9]{1,5})?")
_NAME = re.compile(r"[\w.-]+")
# Before the names of a run's pictures.
PICTURE = "picture/"
# Before the names of pages that keep edits.
KEPT = "autosave/"
NOTHING = "there is nothing here: open the address that diff3ds view says"
# What browsers ask every site for, once pages may show pictures of it; there is none, which is no fault.
ICON = "/favicon.ico"
# Of all answers: nothing is kept, shown within other pages, or handed to them.
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
}


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
    with server_of(source, port, say, False, beside, surface, surface_up, host, allowed) as server:
        show(server.address)
        if host not in (HOST, "localhost", "::1"):
            say(f"warning: {host} is more than this machine: whoever has the address sees and changes the sketch")
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

    def __init__(self, page: ShownPage, port: int, host: str = HOST, allowed: Sequence[str] = ()) -> None:
        """Listens at once."""
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        super().__init__((host, port), _Handler)
        self.page = page
        self.secret = secrets.token_urlsafe(16)
        called = HOST if host in EVERYWHERE else f"[{host}]" if ":" in host else host
        self.names = {*NAMES, called.lower()}
        self.allowed = {name.lower() for name in allowed}
        self.address = f"http://{called}:{self.server_port}/{self.secret}/"

    def is_named(self, authority: str) -> bool:
        """Whether a request that calls this server so, at whatever port, means this machine."""
        name = _name_in(authority)
        return name in self.names or name in self.allowed

    def is_own_page(self, origin: str) -> bool:
        """Whether a page of this server asks; names that are allowed may be those of a hub that speaks https."""
        scheme, _, authority = origin.partition("://")
        name = _name_in(authority)
        return (scheme == "http" and name in self.names) or (scheme in ("http", "https") and name in self.allowed)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away is no fault."""


def _name_in(authority: str) -> str | None:
    """The name or address, without the port, in lower case; None of what is neither."""
    found = _AUTHORITY.fullmatch(authority.lower())
    return found[1] if found else None


@contextmanager
def shown_meanwhile(out: Path, show: Callable[[str], None], say: Callable[[str], None]) -> Iterator[None]:
    """Serves the page of a run while it goes on, by a thread beside it; when it is done, until Ctrl-C.

    A run that fails, or that Ctrl-C stops, takes the page with it.

    Args:
        out: the folder of the run, which need not be there yet.
        show: told the address.
        say: told how to end, when the run is done.
    """
    with server_of(out, 0, say, waits=True) as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.2}, daemon=True)
        thread.start()
        try:
            show(server.address)
            yield
            say(f"the page stays at {server.address} until Ctrl-C")
            with suppress(KeyboardInterrupt):
                # In parts, between which Ctrl-C is seen on every system.
                while thread.is_alive():
                    thread.join(0.5)
        finally:
            server.shutdown()
            thread.join()


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
    if not 0 <= port <= 65535:
        raise ValueError(f"port must be from 0 to 65535, got {port}")
    for name in allowed:
        if not _NAME.fullmatch(name):
            raise ValueError(f"allow_host must be a name alone, such as hub.example.org, got {name!r}")
    # What cannot be shown is said before anything listens.
    for path in [] if waits else [source, *([] if beside is None else [beside])]:
        load_sketch(path)
    solid = SurfaceInput(source, surface, surface_up, say)
    page = ShownPage(source, say, solid, waits, None if beside is None else ShownPage(beside, say))
    page.text()
    try:
        return PageServer(page, port, host, allowed)
    except socket.gaierror as error:
        raise OSError(f"{host} is no address of this machine ({error.strerror}): leave --host out") from error
    except OSError as error:
        where = f"port {port}" if host == HOST else f"port {port} of {host}"
        raise OSError(f"{where} cannot be had ({error.strerror}): leave --port out for one that is free") from error


def kept_name(name: str | None) -> str | None:
    """The page whose kept edits an address is that of; None of others."""
    page = (name or "").removeprefix(KEPT) if (name or "").startswith(KEPT) else ""
    return page if saving.PAGE_NAME.fullmatch(page) else None


class _Handler(BaseHTTPRequestHandler):
    """Answers GET for the page and what it asks for."""

    server: PageServer
    # Nothing of Python or of this package for those who only knock.
    server_version, sys_version = "diff3ds", ""
    # Seconds that somebody may take to ask.
    timeout = 10

    def do_GET(self) -> None:
        """The page, its sketch as it is now, or what belongs to its run."""
        if self._is_foreign():
            return
        if self.path == ICON:
            self._answer(HTTPStatus.NO_CONTENT, "text/plain", "")
            return
        name = self._asked()
        try:
            found = None if name is None else self._found(name)
        except (ValueError, OSError) as error:
            # Such as kept edits that something has damaged: the page says so.
            self._answer(HTTPStatus.INTERNAL_SERVER_ERROR, "text/plain", str(error))
            return
        if found is None:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", NOTHING)
        else:
            self._answer(HTTPStatus.OK, *found)

    def do_PUT(self) -> None:
        """Saves the sketch of a page, or keeps its edits."""
        if self._is_foreign(must_say=True):
            return
        name = self._asked()
        page = kept_name(name)
        if name not in ("sketch", "copy") and page is None:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", NOTHING)
            return
        text = self._body()
        if text is None:
            return
        try:
            self._answer(HTTPStatus.OK, "application/json", self._saved(name, page, text))
        except saving.ChangedError as error:
            self._answer(HTTPStatus.PRECONDITION_FAILED, "text/plain", str(error))
        except ValueError as error:
            self._answer(HTTPStatus.BAD_REQUEST, "text/plain", str(error))
        except OSError as error:
            self._answer(HTTPStatus.INSUFFICIENT_STORAGE, "text/plain", str(error))

    def do_DELETE(self) -> None:
        """Forgets the edits that a page kept."""
        if self._is_foreign(must_say=True):
            return
        page = kept_name(self._asked())
        if page is None:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", NOTHING)
            return
        saving.forget(self.server.page.shown, page)
        self._answer(HTTPStatus.NO_CONTENT, "text/plain", "")

    def _saved(self, name: str | None, page: str | None, text: str) -> str:
        shown = self.server.page
        if page is not None:
            saving.keep(shown.shown, page, text)
            return "{}"
        if name == "copy":
            with shown.lock:
                target = saving.save_copy(shown.shown, text)
            shown.say(f"saved {target}")
            return json.dumps({"name": target.name})
        return shown.save(text, self.headers.get("If-Match", "").strip('"'))

    def _is_foreign(self, must_say: bool = False) -> bool:
        """Whether somebody else asks, who is then refused; browsers say who writes."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        foreign = must_say if origin is None else not self.server.is_own_page(origin)
        if self.server.is_named(host) and not foreign:
            return False
        told = self.server.address.replace(self.server.secret, "...")
        refused = (
            f"this page is for the browser of its own machine: open it as {told}, or by localhost with the port of a "
            f"tunnel (ssh -L {self.server.server_port}:{HOST}:{self.server.server_port} MACHINE). To reach it by "
            "another name, as through a hub or a container, start diff3ds view with --allow-host NAME"
        )
        self._answer(HTTPStatus.FORBIDDEN, "text/plain", refused)
        return True

    def _asked(self) -> str | None:
        """What stands behind the secret in the address; None without the secret."""
        secret, slash, name = self.path.removeprefix("/").partition("/")
        known = secrets.compare_digest(secret.encode(), self.server.secret.encode())
        return name if known and slash else None

    def _body(self) -> str | None:
        """The text that comes with a request; where it is none, or too much, that is answered."""
        length = self.headers.get("Content-Length", "")
        if not re.fullmatch(r"[0-9]{1,19}", length):
            self._answer(HTTPStatus.LENGTH_REQUIRED, "text/plain", "the length of the sketch must be said")
            return None
        if int(length) > saving.MOST_BYTES:
            too_much = f"{length} bytes are more than the {saving.MOST_BYTES} that are saved from a page"
            self._answer(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "text/plain", too_much)
            return None
        try:
            content = self.rfile.read(int(length))
            if len(content) != int(length):
                raise ValueError(f"only {len(content)} of {length} bytes came")
            return content.decode()
        except (ValueError, OSError) as error:
            self._answer(HTTPStatus.BAD_REQUEST, "text/plain", f"the sketch did not come whole, as UTF-8: {error}")
            return None

    def _found(self, name: str) -> tuple[str, str | bytes] | None:
        """The kind and content of what has this name behind the secret, or None."""
        page = self.server.page
        texts = {
            "": ("text/html", page.text),
            "version": ("text/plain", page.version),
            "sketch": ("application/json", page.sketch),
            "run": ("application/json", page.run),
            "autosaves": ("application/json", lambda: saving.kept_by_pages(page.shown)),
        }
        if name in texts:
            kind, made = texts[name]
            text = made()
            return None if text is None else (kind, text)
        if (kept := kept_name(name)) is not None:
            text = saving.kept_of(page.shown, kept)
            return None if text is None else ("application/json", text)
        if page.is_run and name.startswith(PICTURE):
            # Behind the question mark, which of its states: for the browser alone.
            picture = picture_in(page.source, name.removeprefix(PICTURE).partition("?")[0])
            return None if picture is None else ("image/png", picture)
        return None

    def _answer(self, status: HTTPStatus, kind: str, body: str | bytes) -> None:
        content = body.encode() if isinstance(body, str) else body
        self.send_response(status)
        charset = "; charset=utf-8" if isinstance(body, str) else ""
        for name, value in {**HEADERS, "Content-Type": f"{kind}{charset}"}.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing: the address has a secret."""
