"""The server: pages under a secret in the address, on 127.0.0.1 unless another address is asked for, by uvicorn."""

import re
import socket
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from threading import Thread

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import Route

from diff3ds.tasks.serving.answer import Answer, Answers, Asked
from diff3ds.tasks.serving.door import HOST, Door, check_names

# What a page may send: a sketch of 100,000 strokes takes 50 MB. A file that is dropped on a page goes to the disk, and
# may be as large as a folder of photographs.
MOST_BYTES, MOST_FILE = 1 << 26, 1 << 31
METHODS = ("GET", "PUT", "POST", "DELETE")
NOTHING = "there is nothing here: open the address that diff3ds {} says"
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
# Requests that are answered at a time; more are told to come later. A browser has six open.
AT_A_TIME = 64
# Seconds that requests have to end in when the server does.
GRACE = 2


class PageServer:
    """Listens, and answers while `serve_forever` runs; `address` is what to open, with its secret."""

    def __init__(
        self,
        answers: Answers,
        command: str,
        port: int,
        host: str = HOST,
        allowed: Sequence[str] = (),
        files: Path | None = None,
    ) -> None:
        """Listens at once.

        Args:
            answers: to what is let in.
            command: of diff3ds that serves, for sentences.
            port: of the address; 0 takes one that is free.
            host: the address that it listens on.
            allowed: other names by which browsers reach this machine.
            files: a folder for files on their way; without one a page sends none.

        Raises:
            ValueError: a port or name that is none.
            OSError: the address or port cannot be had.
        """
        if not 0 <= port <= 65535:
            raise ValueError(f"port must be from 0 to 65535, got {port}")
        check_names(allowed)
        self.socket = _listening(host, port)
        self.server_address = self.socket.getsockname()
        self.server_port: int = self.server_address[1]
        self.door = Door.at(command, host, self.server_port, allowed)
        self.secret, self.address = self.door.secret, self.door.address
        self._answers, self._files = answers, files
        app = Starlette(routes=[Route("/{path:path}", self._answer, methods=list(METHODS))])
        config = uvicorn.Config(
            app, log_config=None, log_level="error", access_log=False, server_header=False, lifespan="off", ws="none",
            limit_concurrency=AT_A_TIME, timeout_graceful_shutdown=GRACE,
        )  # fmt: skip
        self._server = uvicorn.Server(config)

    def serve_forever(self) -> None:
        """Answers until `shutdown`; on the main thread until Ctrl-C, which it raises."""
        self._server.run(sockets=[self.socket])

    def shutdown(self) -> None:
        """Ends `serve_forever`, from another thread."""
        self._server.should_exit = True

    def server_close(self) -> None:
        """Lets the port go."""
        self.socket.close()

    async def _answer(self, request: Request) -> Response:
        """Lets a request in, takes what comes with it, and answers on a thread."""
        headers = request.headers
        refusal = self.door.refusal(headers.get("host", ""), headers.get("origin"), request.method != "GET")
        if refusal is not None:
            return _response(Answer(HTTPStatus.FORBIDDEN, body=refusal))
        path = request.scope["raw_path"]
        if path == ICON.encode():
            return _response(Answer(HTTPStatus.NO_CONTENT))
        name = self.door.asked(path)
        nothing = Answer(HTTPStatus.NOT_FOUND, body=NOTHING.format(self.door.command))
        if name is None:
            return _response(nothing)
        asked = Asked(request.method, name, dict(request.query_params), headers.get("if-match", "").strip('"'))
        file = request.method == "POST" and self._files is not None and name.startswith("files")
        if request.method in ("PUT", "POST"):
            taken = await (self._file(request) if file else _body(request))
            if isinstance(taken, Answer):
                return _response(taken)
            body, held = (b"", taken) if isinstance(taken, Path) else (taken, None)
            asked = Asked(asked.method, asked.name, asked.question, asked.held, body, held)
        try:
            return _response(await run_in_threadpool(lambda: self._answers(asked) or nothing))
        finally:
            if asked.file is not None:
                asked.file.unlink(missing_ok=True)

    async def _file(self, request: Request) -> Path | Answer:
        """A file that comes with a request, on the disk."""
        assert self._files is not None
        self._files.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=self._files, prefix=".coming-", delete=False) as held:
            path = Path(held.name)
            try:
                async for part in _parts(request, MOST_FILE):
                    if isinstance(part, Answer):
                        path.unlink()
                        return part
                    held.write(part)
            except OSError as error:
                path.unlink()
                return Answer(HTTPStatus.INSUFFICIENT_STORAGE, body=f"there is no room for the file: {error.strerror}")
        return path


def _listening(host: str, port: int) -> socket.socket:
    try:
        socket.getaddrinfo(host, port)
        return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except socket.gaierror as error:
        raise OSError(f"{host} is no address of this machine ({error.strerror}): leave --host out") from error
    except OSError as error:
        where = f"port {port}" if host == HOST else f"port {port} of {host}"
        raise OSError(f"{where} cannot be had ({error.strerror}): leave --port out for one that is free") from error


async def _body(request: Request) -> bytes | Answer:
    content = bytearray()
    async for part in _parts(request, MOST_BYTES):
        if isinstance(part, Answer):
            return part
        content += part
    return bytes(content)


async def _parts(request: Request, most: int) -> AsyncIterator[bytes | Answer]:
    """What comes with a request, in parts; where its length is not said or too much, or it breaks off, that alone."""
    length = request.headers.get("content-length", "")
    if not re.fullmatch(r"[0-9]{1,19}", length):
        yield Answer(HTTPStatus.LENGTH_REQUIRED, body="the length of what comes must be said")
        return
    if int(length) > most:
        too_much = f"{length} bytes are more than the {most} that are taken from a page"
        yield Answer(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, body=too_much)
        return
    try:
        async for part in request.stream():
            yield part
    except ClientDisconnect:
        yield Answer(HTTPStatus.BAD_REQUEST, body=f"not all of {length} bytes came")


def _response(answer: Answer) -> Response:
    content = answer.body.encode() if isinstance(answer.body, str) else answer.body
    charset = "; charset=utf-8" if isinstance(answer.body, str) else ""
    headers = {**HEADERS, "Content-Type": f"{answer.kind}{charset}"}
    if answer.saved_as:
        headers["Content-Disposition"] = f'attachment; filename="{answer.saved_as}"'
    return Response(content, answer.status, headers)


def serve_until_interrupted(server: PageServer, say: Callable[[str], None]) -> None:
    """Answers until Ctrl-C, which it says."""
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        say("ended")


@contextmanager
def serving(server: PageServer) -> Iterator[Thread]:
    """Within this block a thread beside it serves."""
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield thread
    finally:
        # Told to end before it has begun, uvicorn would begin all the same.
        while thread.is_alive() and not server._server.started:
            time.sleep(0.01)
        server.shutdown()
        thread.join()
        server.server_close()
