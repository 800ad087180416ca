"""A server on this machine that answers as the Hugging Face hub does, and fails on demand."""

import hashlib
import json
import re
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

COMMIT = "c0ffee" + 34 * "0"
# Files of more bytes are stored apart from git, and known by their SHA-256.
LARGE = 1000


@dataclass
class Hub:
    """Repositories and how they fail.

    Attributes:
        files: content by repository and path.
        breaks: a path's connections break after so many bytes each, in this order.
        damaged: paths whose content arrives with its last byte changed, so many times.
        gated: repositories whose terms must be accepted first.
        ranges: whether parts of files can be asked for.
        requests: method, path in the repository, and range, in order.
    """

    files: dict[str, dict[str, bytes]] = field(default_factory=dict)
    breaks: dict[str, list[int]] = field(default_factory=dict)
    damaged: dict[str, int] = field(default_factory=dict)
    gated: set[str] = field(default_factory=set)
    ranges: bool = True
    requests: list[tuple[str, str, str | None]] = field(default_factory=list)
    url: str = ""

    def gets(self, path):
        """The ranges of a file that were asked for."""
        return [wanted for method, name, wanted in self.requests if method == "GET" and name == path]


def digest(content):
    """(digest, whether the file is large), as the hub has them."""
    if len(content) > LARGE:
        return hashlib.sha256(content).hexdigest(), True
    return hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest(), False


@contextmanager
def serve(hub):
    """Serves a hub on 127.0.0.1; its url is set."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *args):
            pass

        def do_HEAD(self):
            self.answer(body=False)

        def do_GET(self):
            self.answer(body=True)

        def refuse(self, status, code):
            self.send_response(status)
            self.send_header("X-Error-Code", code)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def answer(self, body):
            path = self.path.partition("?")[0]
            if listing := re.fullmatch(r"/api/models/([^/]+/[^/]+)(/revision/.+)?", path):
                return self.listing(listing[1])
            repository, _, name = re.fullmatch(r"/([^/]+/[^/]+)/resolve/([^/]+)/(.+)", path).groups()
            content = hub.files.get(repository, {}).get(name)
            hub.requests.append((self.command, name, self.headers.get("Range")))
            if content is None:
                return self.refuse(404, "EntryNotFound")
            return self.file(name, content, body)

        def listing(self, repository):
            if repository in hub.gated:
                return self.refuse(403, "GatedRepo")
            if repository not in hub.files:
                return self.refuse(404, "RepoNotFound")
            siblings = []
            for name, content in hub.files[repository].items():
                known, large = digest(content)
                sibling = {"rfilename": name, "size": len(content), "blobId": known if not large else 40 * "0"}
                if large:
                    sibling["lfs"] = {"sha256": known, "size": len(content), "pointerSize": 130}
                siblings.append(sibling)
            body = json.dumps({"id": repository, "sha": COMMIT, "siblings": siblings}).encode()
            self.send_response(200)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            return self.wfile.write(body)

        def file(self, name, content, body):
            known = digest(content)[0]
            start = 0
            if body and hub.damaged.get(name, 0) > 0:
                hub.damaged[name] -= 1
                content = content[:-1] + bytes([content[-1] ^ 1])
            wanted = self.headers.get("Range")
            if wanted and hub.ranges:
                start = int(re.fullmatch(r"bytes=(\d+)-", wanted)[1])
            self.send_response(206 if start else 200)
            self.send_header("ETag", f'"{known}"')
            self.send_header("X-Repo-Commit", COMMIT)
            self.send_header("Content-Length", str(len(content) - start))
            if start:
                self.send_header("Content-Range", f"bytes {start}-{len(content) - 1}/{len(content)}")
            self.end_headers()
            if not body:
                return None
            if hub.breaks.get(name):
                self.wfile.write(content[start : start + hub.breaks[name].pop(0)])
                self.close_connection = True
                return None
            return self.wfile.write(content[start:])

    class Server(ThreadingHTTPServer):
        def handle_error(self, request, client_address):
            """Clients that hang up are part of the tests."""

    server = Server(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    hub.url = f"http://127.0.0.1:{server.server_address[1]}"
    try:
        yield hub
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
