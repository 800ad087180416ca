"""A large file from the Hugging Face hub: goes on where it stopped, checked by digest, in place only when whole."""

import errno
import hashlib
import importlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

# Bytes received, or hashed, at a time.
CHUNK = 1 << 20
# A connection that breaks is opened anew so many times without a new byte, after pauses of 1, 2, 4, ... seconds.
ATTEMPTS, PAUSE = 5, 1.0
# Seconds to wait for a server.
TIMEOUT = 30.0


@dataclass(frozen=True)
class RemoteFile:
    """A file of a repository.

    Attributes:
        url: where it is.
        name: to be shown.
        size: bytes.
        digest: SHA-256 of the content, 64 hexadecimal digits; or its name in git, 40 digits, for small files.
    """

    url: str
    name: str
    size: int
    digest: str


def download(file: RemoteFile, target: Path, report: Callable[[int], None] = lambda done: None) -> None:
    """Downloads a file to `target`; what has come is kept beside it as `*.part`, and the next call goes on from there.

    Args:
        report: called with the bytes that are there so far.

    Raises:
        ConnectionError: the connection broke, and could not be made again.
        huggingface_hub.errors.HfHubHTTPError: the server refuses.
        ValueError: the content is not that of the digest; it is removed.
        OSError: the disk is full, among others.
    """
    part = _part(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    done, attempts = begun(target), 0
    while True:
        try:
            _receive(file, target, report)
            break
        except transport_error() as error:
            attempts = attempts + 1 if begun(target) == done else 1
            done = begun(target)
            if attempts >= ATTEMPTS:
                raise ConnectionError(
                    f"{file.name}: the connection broke after {done} of {file.size} bytes ({error}); "
                    "the same command goes on from there"
                ) from error
            time.sleep(PAUSE * 2 ** (attempts - 1))
        except OSError as error:
            if error.errno == errno.ENOSPC:
                raise disk_full(target.parent, file.size - begun(target)) from error
            raise
    if digest_of(part, file.digest) != file.digest:
        part.unlink()
        raise ValueError(f"{file.name}: arrived damaged (another digest than the hub says); run the same command again")
    part.replace(target)


def begun(target: Path) -> int:
    """Bytes that have come of a file that is not whole yet."""
    part = _part(target)
    return part.stat().st_size if part.exists() else 0


def disk_full(folder: Path, missing: int) -> OSError:
    """The error of a disk that has no room for so many bytes more."""
    return OSError(
        f"{folder}: no room for the {missing / 1e9:.2f} GB that are still to come. Make room, or set HF_HOME to a "
        "folder on a larger disk; the same command goes on from there",
    )


def digest_of(path: Path, like: str) -> str:
    """The digest of a file, SHA-256 or git's, whichever `like` is one of."""
    digest = hashlib.sha256() if len(like) == 64 else hashlib.sha1(b"blob %d\0" % path.stat().st_size)
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def transport_error() -> type[Exception]:
    """What the HTTP client of the hub's library (httpx, httpx2) raises when a connection fails."""
    from huggingface_hub import get_session

    client = importlib.import_module(type(get_session()).__module__.partition(".")[0])
    error = client.TransportError
    assert isinstance(error, type)
    return error


def _receive(file: RemoteFile, target: Path, report: Callable[[int], None]) -> None:
    """Appends what is missing to a partial file, in one connection."""
    from huggingface_hub import get_session

    utils = importlib.import_module("huggingface_hub.utils")
    part, done = _part(target), begun(target)
    if done == file.size:
        return
    # The digest is of the content as it is, not compressed.
    headers = {**utils.build_hf_headers(), "Accept-Encoding": "identity"}
    if 0 < done < file.size:
        headers["Range"] = f"bytes={done}-"
    with get_session().stream("GET", file.url, headers=headers, timeout=TIMEOUT) as response:
        utils.hf_raise_for_status(response)
        # A server that knows no ranges sends all.
        done = done if response.status_code == 206 else 0
        with part.open("ab" if done else "wb") as out:
            for chunk in response.iter_bytes(CHUNK):
                done += len(chunk)
                if done > file.size:
                    break
                out.write(chunk)
                report(done)
    if done != file.size:
        part.unlink()
        raise ValueError(f"{file.name}: the server sent another size than the {file.size} bytes that the hub says")


def _part(target: Path) -> Path:
    return target.with_name(f"{target.name}.part")
