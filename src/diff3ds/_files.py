"""Files that are read with bounds, and written whole or not at all."""

import codecs
import errno
import json
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# A sketch of 100,000 strokes takes 50 MB as JSON; more is taken for a mistake or an attack.
MAX_TEXT_BYTES = 1 << 28
# No space on the disk, or none of a user's share of it, which some systems do not know.
FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))
# A string, to be kept, or a comment; one that is never closed goes on to the end, so that the search takes linear time.
_COMMENTS = re.compile(r'("(?:[^"\\]|\\.)*")|//[^\n]*|/\*.*?(?:\*/|\Z)', re.DOTALL)


def is_file(path: Path) -> bool:
    """Whether there is such a file: none of a name that is longer than any, or has a null character."""
    return os.path.isfile(path)


def check_there(path: Path, wanted: str, most: float | None = None) -> None:
    """Sees that there is something to be read.

    Args:
        wanted: what could be given, as the end of a sentence, such as "a mesh, a file such as part.stl".
        most: bytes that are read of a file; None where a folder may be given too.

    Raises:
        FileNotFoundError: it is not there.
        IsADirectoryError: it is a folder, and a file is wanted.
        ValueError: it has more bytes.
    """
    if not os.path.exists(path):
        raise FileNotFoundError(f"{path} is not there: give {wanted}")
    if most is None:
        return
    if os.path.isdir(path):
        raise IsADirectoryError(f"{path} is a folder: give {wanted}")
    size = path.stat().st_size
    if size > most:
        raise ValueError(f"{path}: {size} bytes are more than the {most} that are read")


def read_text(path: Path) -> str:
    """The text of a file.

    Raises:
        FileNotFoundError: it is missing.
        ValueError: it is larger than 256 MiB, or neither UTF-8 nor, with a byte order mark, UTF-16.
    """
    check_there(path, "a file that is", MAX_TEXT_BYTES)
    content = path.read_bytes()
    # Editors and shells of Windows write byte order marks, and UTF-16 with one.
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        kind = "; of the CSV files that spreadsheets write take CSV UTF-8" if path.suffix.lower() == ".csv" else ""
        raise ValueError(f"{path}: not a text file (UTF-8){kind}") from error


def read_json(path: Path) -> Any:
    """The content of a JSON file, which may have comments as C++ has them, for instant-ngp reads such files.

    Raises:
        FileNotFoundError, ValueError: as `read_text`; not JSON.
    """
    return parse_json(read_text(path), path)


def parse_json(text: str, path: Path) -> Any:
    """The content of the text of such a file.

    Raises:
        ValueError: not JSON; the message names the path.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        try:
            return json.loads(_COMMENTS.sub(lambda found: found[1] or " ", text))
        except (ValueError, RecursionError):
            raise ValueError(f"{path}: not a JSON file ({error})") from error


def existing_folder(path: Path) -> Path:
    """The nearest folder that is there: this one or one above it, in which it can be made.

    Raises:
        NotADirectoryError: that is a file.
    """
    there = next(place for place in (path, *path.absolute().parents) if place.exists())
    if not there.is_dir():
        raise NotADirectoryError(f"{there} is a file, not a folder for results: give another -o")
    return there


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`, renamed to it when the block succeeds and removed when it does not.

    Raises:
        OSError: it cannot be written; of a full disk, says what to do.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(8)}{path.suffix}")
    try:
        # With the rights of any new file, which tempfile's have not; to ask for the umask would change it for all
        # threads. Within the try, since an interruption may come between any two lines.
        temporary.touch(exist_ok=False)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        if error.errno not in FULL:
            raise
        advice = "make room. What was written before is whole; a run with a checkpoint goes on by --resume"
        raise OSError(error.errno, f"{error.strerror}: {advice}", str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Writes a text file, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_bytes(path: Path, content: bytes) -> None:
    """Writes a binary file, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)
