"""What a page saves: its sketch to the file it shows, to a copy beside that, or kept there until it is saved."""

import hashlib
import json
import re
from pathlib import Path

from diff3ds._files import write_text
from diff3ds.formats.sketch_json import json_text, sketch_of_text

# Names that pages give themselves, and how many of them may keep edits beside one file.
PAGE_NAME = re.compile(r"[0-9a-f]{16}")
MOST_KEPT = 100


class ChangedError(Exception):
    """The file is no longer what the page was shown."""


def digest_of(path: Path) -> str:
    """Says which content a file has; of a file that is not there, "nothing"."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:32]
    except FileNotFoundError:
        return "nothing"


def checked_text(text: str, name: str) -> str:
    """The text of a sketch.json as the package writes it.

    Raises:
        ValueError: it is no sketch, or one without strokes.
    """
    sketch = sketch_of_text(text, Path(name))
    if len(sketch) == 0:
        raise ValueError("the sketch has no strokes, and a file without any cannot be shown")
    return json_text(sketch)


def save_over(shown: Path, text: str, loaded: str) -> Path:
    """Writes a sketch to the file that is shown; beside it, as JSON, if that is of another format.

    Args:
        shown: the file.
        text: of a sketch.json.
        loaded: the content that the page began with, as of `digest_of`.

    Returns:
        The file that was written.

    Raises:
        ChangedError: the file has other content now.
        ValueError, OSError: as `checked_text`; the file cannot be written.
    """
    checked = checked_text(text, shown.name)
    if digest_of(shown) != loaded:
        raise ChangedError(
            f"Not saved: {shown.name} has changed since this page read it. Save your edits as a copy, or load the file "
            "anew, which drops them."
        )
    target = shown if shown.suffix.lower() == ".json" else free_name(shown)
    write_text(target, checked)
    return target


def save_copy(shown: Path, text: str) -> Path:
    """Writes a sketch beside a file, under a name that is free, and says which.

    Raises:
        ValueError, OSError: as `save_over`.
    """
    checked = checked_text(text, shown.name)
    target = free_name(shown)
    write_text(target, checked)
    return target


def free_name(shown: Path) -> Path:
    """A name for a JSON file beside another file, which none has."""
    names = [shown.with_suffix(".json"), *(shown.with_name(f"{shown.stem}-{number}.json") for number in range(2, 1000))]
    for path in names:
        if not path.exists():
            return path
    raise ValueError(f"there are too many copies of {shown.name}: remove some")


def _kept_file(shown: Path, page: str) -> Path:
    return shown.with_name(f"{shown.stem}.autosave-{page}.json")


def kept_by_pages(shown: Path) -> str:
    """The pages that keep edits beside a file, the latest first, as JSON."""
    found = []
    for path in shown.parent.glob(f"{_escaped(shown.stem)}.autosave-*.json"):
        page = path.stem.rpartition("-")[2]
        if PAGE_NAME.fullmatch(page) and path == _kept_file(shown, page):
            found.append((path.stat().st_mtime_ns, page))
    return json.dumps([page for _, page in sorted(found, reverse=True)])


def _escaped(stem: str) -> str:
    return re.sub(r"([\[\]*?])", r"[\1]", stem)


def keep(shown: Path, page: str, text: str) -> None:
    """Keeps the edits of a page.

    Raises:
        ValueError, OSError: as `save_over`; too many pages.
    """
    kept = json.loads(kept_by_pages(shown))
    if page not in kept and len(kept) >= MOST_KEPT:
        raise ValueError(f"{len(kept)} pages keep edits of {shown.name} that were not saved: remove some of them")
    write_text(_kept_file(shown, page), checked_text(text, shown.name))


def kept_of(shown: Path, page: str) -> str | None:
    """The edits that a page keeps, as JSON; None without any.

    Raises:
        ValueError, OSError: the file is no sketch.
    """
    path = _kept_file(shown, page)
    return checked_text(path.read_text(encoding="utf-8"), path.name) if path.is_file() else None


def forget(shown: Path, page: str) -> None:
    """Removes the edits that a page keeps."""
    _kept_file(shown, page).unlink(missing_ok=True)
