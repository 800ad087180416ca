"""What the studio's page asks for, and what it is answered."""

import json
import re
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from threading import Lock
from typing import Any

from diff3ds.formats import save
from diff3ds.tasks.results import SURFACE
from diff3ds.tasks.serving.answer import Answer, Asked, as_json, refused
from diff3ds.tasks.sketch_input import load_sketch
from diff3ds.tasks.studio import downloads, drawn, dropped, said
from diff3ds.tasks.studio.entry import Entry
from diff3ds.tasks.studio.line import Line
from diff3ds.tasks.view_sketch.answers import PICTURE, answer_of
from diff3ds.tasks.view_sketch.run_folder import pictures_of
from diff3ds.tasks.view_sketch.shown_page import ShownPage
from diff3ds.viewer.studio_page import studio_page

# The pictures by which things are known that have no strokes yet, the best first.
FACES = ("lines.png", "reference.png", "targets.png")
_MADE = re.compile(r"jobs/([a-z0-9-]+)/(stop|resume|delete|duplicate|again)")
_RUN = re.compile(r"runs/([a-z0-9-]+)/(.*)", re.DOTALL)
_FILE = re.compile(r"files/([0-9a-f]{16})/(.+)", re.DOTALL)


class Desk:
    """Answers one studio's page."""

    def __init__(self, line: Line, say: Callable[[str], None]) -> None:
        """Takes what there is, and what is told of saving."""
        self._line, self._say = line, say
        self._pages: dict[str, ShownPage] = {}
        # Small pictures of sketches, each with the state of the file that it is of.
        self._faces: dict[str, tuple[str, bytes]] = {}
        self._lock = Lock()

    def answer(self, asked: Asked) -> Answer | None:
        """The answer; None where there is nothing of that name."""
        if (found := _RUN.fullmatch(asked.name)) is not None:
            return self._of_run(found[1], asked.within(found[2]))
        if asked.method == "GET":
            return self._got(asked)
        try:
            return self._done(asked)
        except (ValueError, TypeError, OSError, ImportError) as error:
            return refused(ValueError(str(error)) if not isinstance(error, OSError) else error)

    def _got(self, asked: Asked) -> Answer | None:
        if asked.name == "":
            return Answer(HTTPStatus.OK, "text/html", studio_page())
        if asked.name == "state":
            return as_json([self._about(entry) for entry in self._line.entries()])
        if asked.name == "said":
            return as_json(said.understood(asked.question.get("phrase", "")))
        return None

    def _about(self, entry: Entry) -> dict[str, Any]:
        """A thing as its card shows it."""
        folder = self._line.out / entry.name
        state = _state(folder)
        if state:
            face = f"face?{state}"
        else:
            there = {picture["name"]: picture["version"] for picture in pictures_of(folder)} if folder.is_dir() else {}
            face = next((f"{PICTURE}{name}?{there[name]}" for name in FACES if name in there), "")
        shown = ("name", "title", "command", "made", "state", "message", "stage", "done", "total")
        return {
            **{name: getattr(entry, name) for name in shown},
            "left": entry.times(self._line.took_before(entry)),
            "line": entry.line(self._line.out),
            "said": entry.lines[-1] if entry.lines else "",
            "face": face,
            "sketch": bool(state),
        }

    def _done(self, asked: Asked) -> Answer | None:
        if (file := _FILE.fullmatch(asked.name)) is not None and asked.file is not None:
            dropped.take(self._line.out, file[1], file[2], asked.file)
            return as_json({})
        if asked.method != "PUT":
            return None
        if (made := _MADE.fullmatch(asked.name)) is not None:
            return self._change(made[1], made[2])
        if asked.name not in ("drawn", "dropped", "jobs"):
            return None
        content = _content(asked.text)
        if asked.name == "drawn":
            return as_json(drawn.guesses_of(content.get("strokes")))
        if asked.name == "dropped":
            found = dropped.what_is(self._line.out, str(content.get("group")))
            return as_json({"what": found.what, "title": found.title, "command": found.command})
        return as_json(self._about(self._begin(content)))

    def _change(self, name: str, how: str) -> Answer:
        changed = getattr(self._line, how)(name)
        if how == "delete":
            with self._lock:
                self._pages.pop(name, None)
                self._faces.pop(name, None)
        return as_json(self._about(changed) if isinstance(changed, Entry) else {})

    def _begin(self, content: dict[str, Any]) -> Entry:
        """Puts into the line what is said, drawn or dropped.

        Raises:
            ValueError, TypeError, OSError: it cannot be made.
        """
        if isinstance(phrase := content.get("phrase"), str):
            if refused := said.understood(phrase)["refused"]:
                raise ValueError(refused)
            return self._line.add(phrase.strip(), "text", {"phrase": phrase.strip()})
        if "strokes" in content:
            shows = content.get("shows")
            if shows is not None and not isinstance(shows, str):
                raise ValueError("what a drawing shows is said in words")
            path = dropped.folder_of(self._line.out, str(content.get("group"))) / "drawing.png"
            drawn.save_drawing(path, content["strokes"])
            return self._from_file(shows or "a drawing", "image", path, {"shows": shows} if shows else {})
        found = dropped.what_is(self._line.out, str(content.get("group")))
        if found.command:
            return self._from_file(found.title, found.command, found.source, found.options)
        sketch = load_sketch(found.source)
        return self._line.put(found.title, lambda folder: save(folder / "sketch.json", sketch))

    def _from_file(self, title: str, command: str, file: Path, options: dict[str, Any]) -> Entry:
        subject = {"picture" if command == "image" else "source": file.relative_to(self._line.out).as_posix()}
        return self._line.add(title, command, {**subject, **options})

    def _of_run(self, name: str, asked: Asked) -> Answer | None:
        entry = self._line.entry(name)
        if entry is None:
            return None
        if asked.method == "GET" and asked.name == "about":
            formats = [
                {"key": key, "name": each.name, "purpose": each.purpose} for key, each in downloads.FORMATS.items()
            ]
            again = entry.command in ("text", "image", "views")
            hatches = downloads.HATCHES if (self._line.out / name / SURFACE).is_file() else ()
            looks = {"styles": downloads.STYLES, "hatches": hatches}
            return as_json({**self._about(entry), "formats": formats, **looks, "again": again})
        if asked.method == "GET" and asked.name == "face":
            return self._face(self._line.out / name)
        if asked.method == "GET" and asked.name.startswith("download/"):
            try:
                file, content = downloads.made(
                    self._line.out / name, name, asked.name.removeprefix("download/"), asked.question
                )
            except (ValueError, OSError, ImportError) as error:
                return Answer(HTTPStatus.BAD_REQUEST, body=str(error))
            return Answer(HTTPStatus.OK, _kind(file), content, file)
        with self._lock:
            page = self._pages.get(name)
            if page is None:
                folder = self._line.out / name
                page = self._pages[name] = ShownPage(folder, self._say, waits=True, title=entry.title, in_studio=True)
        return answer_of(page, asked)

    def _face(self, folder: Path) -> Answer:
        """A small picture of a sketch, without hidden lines where it is known what hides."""
        state = _state(folder)
        with self._lock:
            known, content = self._faces.get(folder.name, ("", b""))
        if known != state or not state:
            try:
                _, content = downloads.made(folder, folder.name, "png", {"hidden": "drop"}, downloads.SMALL)
            except (ValueError, OSError, ImportError) as error:
                return Answer(HTTPStatus.NOT_FOUND, body=str(error))
            with self._lock:
                self._faces[folder.name] = state, content
        return Answer(HTTPStatus.OK, "image/png", content)


def _state(folder: Path) -> str:
    """Tells one state of a sketch from others; "" where there is none."""
    try:
        found = (folder / "sketch.json").stat()
    except OSError:
        return ""
    return f"{found.st_mtime_ns}-{found.st_size}"


def _kind(file: str) -> str:
    """The media type of a file that is saved; of what is shown as well, its own."""
    return {".svg": "image/svg+xml", ".png": "image/png"}.get(Path(file).suffix, "application/octet-stream")


def _content(text: str) -> dict[str, Any]:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"what came is no JSON ({error})") from error
    if not isinstance(content, dict):
        raise ValueError("what came is no JSON object")
    return content
