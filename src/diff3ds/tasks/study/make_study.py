"""A user study as one page that needs no network: what `diff3ds study make` does."""

import base64
import io
import json
import re
import secrets
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import torch
from PIL import Image

from diff3ds._files import existing_folder, write_text
from diff3ds._shapes import Float, Tensor
from diff3ds.formats import load, tile_images
from diff3ds.formats.framing import framed
from diff3ds.render import render
from diff3ds.tasks.evaluate.runs import Run, find_runs, reference_of
from diff3ds.tasks.study.questions import LEAST, MOST, QUESTIONS
from diff3ds.viewer.page import digest, embedded

PAGE, KEY, ANSWERS = "study.html", "study.json", "answers"
# Pixels of a view, and from where the four are, degrees.
SIZE, AZIMUTHS, ELEVATION = 256, (30.0, 120.0, 210.0, 300.0), 20.0


def make_study(methods: Mapping[str, Path], out: Path, title: str = "3D sketches") -> int:
    """Writes study.html, which participants open, and study.json, which says which sketch is whose.

    Participants see phrases or pictures and sketches in an order of their own, and no names of methods; the page gives
    them a file of their answers, which goes to the folder `answers`.

    Args:
        methods: folders of runs of "diff3ds text" or "diff3ds image" by the names of methods. What all of them have
            made once is compared.
        out: folder of the study.
        title: of the page.

    Returns:
        The number of sketches that each participant is asked about.

    Raises:
        ValueError, OSError: as `find_runs`; fewer than two methods, one without a run that another has, or with two
            of the same; a folder that holds a study.
    """
    if len(methods) < 2:
        raise ValueError("a study compares at least two methods: NAME=FOLDER NAME=FOLDER")
    existing_folder(out)
    if (out / KEY).exists():
        raise ValueError(f"{out} holds a study, whose answers another one would not fit: give another folder (-o)")
    runs = {method: _by_subject(method, folder) for method, folder in methods.items()}
    subjects = list(dict.fromkeys(subject for of_method in runs.values() for subject in of_method))
    for method, of_method in runs.items():
        if missing := [subject for subject in subjects if subject not in of_method]:
            raise ValueError(
                f"{method} has no run of {missing[0]!r}, which others have: a study compares like with like"
            )
    key: dict[str, dict[str, str]] = {}
    tasks: list[dict[str, Any]] = []
    for subject in subjects:
        first = next(iter(runs.values()))[subject]
        sketches = []
        for method, of_method in runs.items():
            code = secrets.token_hex(4)
            key[code] = {"method": method, "subject": subject}
            sketches.append({"code": code, "image": _views(of_method[subject].folder / "sketch.json")})
        tasks.append({"asked": first.phrase, "picture": _picture(first), "sketches": sketches})
    study = secrets.token_hex(8)
    text = _page(title, {"study": study, "tasks": tasks, "questions": QUESTIONS, "least": LEAST, "most": MOST})
    (out / ANSWERS).mkdir(parents=True, exist_ok=True)
    write_text(out / PAGE, text)
    write_text(out / KEY, json.dumps({"study": study, "methods": list(methods), "sketches": key}, indent=1))
    return len(key)


def _by_subject(method: str, folder: Path) -> dict[str, Run]:
    found: dict[str, Run] = {}
    for run in find_runs(folder, ("phrase", "picture")):
        if run.subject in found:
            raise ValueError(f"{method} has two runs of {run.subject!r}: {found[run.subject].folder} and {run.folder}")
        found[run.subject] = run
    return found


def _views(path: Path) -> str:
    """Four views of a sketch in one picture."""
    sketch = load(path)
    cameras = framed(sketch, AZIMUTHS, ELEVATION, size=SIZE).to(sketch.points.dtype)
    return _data(tile_images(render(sketch, cameras).color.detach(), columns=2))


def _picture(run: Run) -> str | None:
    picture = reference_of(run)
    return None if picture is None else _data(picture)


def _data(image: Float[Tensor, "H W 3"]) -> str:
    """A picture as an address that holds it."""
    file = io.BytesIO()
    pixels = (image.clamp(0, 1) * 255).round().to(torch.uint8).numpy()
    Image.fromarray(pixels).save(file, "PNG", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"


def _page(title: str, data: Mapping[str, Any]) -> str:
    room = files("diff3ds.tasks.study")
    markup, style, script = (room.joinpath(f"study.{s}").read_text(encoding="utf-8") for s in ("html", "css", "js"))
    policy = f"default-src 'none'; img-src data:; script-src {digest(script)}; style-src {digest(style)}"
    parts = {
        "policy": f"{policy}; base-uri 'none'; form-action 'none'",
        "title": escape(title),
        "style": style,
        "script": script,
        "data": embedded(json.dumps(data)),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], markup)


def named_folders(words: Sequence[str]) -> dict[str, Path]:
    """Methods and their folders, from NAME=FOLDER.

    Raises:
        ValueError: a word that is none, or a name twice.
    """
    found: dict[str, Path] = {}
    for word in words:
        name, equals, folder = word.partition("=")
        if not (name and equals and folder):
            raise ValueError(f"a method and its runs are NAME=FOLDER, got {word!r}")
        if name in found:
            raise ValueError(f"{name} is named twice: give each method a name of its own")
        found[name] = Path(folder)
    return found
