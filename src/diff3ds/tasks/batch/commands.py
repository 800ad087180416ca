"""The commands that a job may name: their options, checked before any is run, and how they are run."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from diff3ds._settings import option_hints, with_options
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.points.points_options import PointsOptions
from diff3ds.tasks.progress import Report
from diff3ds.tasks.text_image.prior_options import BUILT_IN, FOR_PHRASES, FOR_PICTURES
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase, Picture
from diff3ds.tasks.typed_options import filled
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.weights.catalog import KNOWN

# What each command takes beside options, and which of these are files.
SUBJECTS = {"text": "phrase", "image": "picture", "views": "source", "mesh": "source", "points": "source"}
PATHS = ("picture", "source")
# The modules that do the work; they are loaded once for all jobs.
MODULES = {
    "text": "diff3ds.tasks.text_image.text",
    "image": "diff3ds.tasks.text_image.image",
    "views": "diff3ds.tasks.views.run_views",
    "mesh": "diff3ds.tasks.mesh.draw_mesh",
    "points": "diff3ds.tasks.points.draw_points",
}
# Of commands that read a file, what they are told besides.
_OF_FILES: dict[str, type[ViewsOptions] | type[MeshOptions] | type[PointsOptions]] = {
    "views": ViewsOptions,
    "mesh": MeshOptions,
    "points": PointsOptions,
}
# Options that are texts, of which some are paths, and what of these is none, whatever lies in the folder.
MAYBE_PATHS, NAMES = ("background", "prior", "weights"), ("white", "black")
# What the batch itself decides.
OWN = ("resume", "overwrite")

Spec = RunSpec[Phrase] | RunSpec[Picture] | ViewsOptions | MeshOptions | PointsOptions


@functools.cache
def _hints(command: str) -> dict[str, Any]:
    kinds = {"text": RunSpec[Phrase], "image": RunSpec[Picture], **_OF_FILES}
    hints = option_hints(kinds[command])
    return {SUBJECTS[command]: str} | {name: hint for name, hint in hints.items() if name not in OWN}


def check_options(command: str, options: Mapping[str, Any], base: Path) -> None:
    """Sees that a command takes these options, and that its subject is there.

    Raises:
        TypeError, ValueError: an option or a value that it does not take; a phrase that the built-in prior, where it
            is named, does not know.
        FileNotFoundError: a picture, folder or mesh that is not there.
    """
    spec = spec_of(command, options, base)
    if isinstance(spec, RunSpec):
        spec.prior.require((*(FOR_PHRASES if command == "text" else FOR_PICTURES), *BUILT_IN))
        if isinstance(spec.subject, Phrase) and spec.prior.prior in BUILT_IN and spec.prior.library is None:
            _check_phrase(spec.subject.phrase)
    if SUBJECTS[command] in PATHS and not (place := base / options[SUBJECTS[command]]).exists():
        raise FileNotFoundError(f"{place}: no such file or folder")


@functools.cache
def _check_phrase(phrase: str) -> None:
    from diff3ds.library.scene import parse_scene

    parse_scene(phrase)


def spec_of(command: str, options: Mapping[str, Any], base: Path) -> Spec:
    """The command's options as it takes them; relative paths are relative to `base`.

    Raises:
        TypeError, ValueError: as `check_options`.
    """
    hints = _hints(command)
    for name in OWN:
        if name in options:
            raise ValueError(f"{name} is for the batch to decide: leave it out")
    rest = dict(options)
    subject = rest.pop(SUBJECTS[command], None)
    if not isinstance(subject, str) or not subject.strip():
        raise ValueError(f"{command} needs a {SUBJECTS[command]}, got {subject!r}")
    known = {name: hint for name, hint in hints.items() if name != SUBJECTS[command]}
    start: Spec
    if command == "text":
        start = RunSpec(Phrase(subject))
    elif command == "image":
        start = RunSpec(Picture(base / subject))
    else:
        start = _OF_FILES[command]()
    return filled(command, start, known, _placed(rest, known, base))


def run_command(
    command: str, options: Mapping[str, Any], base: Path, out: Path, report: Report, say: Callable[[str], None]
) -> None:
    """Runs a job in its folder; what an earlier try has reached there, it goes on from.

    Raises:
        Exception: as the command.
    """
    spec = spec_of(command, options, base)
    if isinstance(spec, RunSpec):
        from diff3ds.tasks.text_image.distillation import CHECKPOINT
        from diff3ds.tasks.text_image.image import run_image
        from diff3ds.tasks.text_image.text import run_text
        from diff3ds.tasks.text_image.text_scene import PLAN

        begun = any((out / name).exists() for name in (CHECKPOINT, PLAN))
        spec = replace(spec, output=replace(spec.output, resume=begun))
        if command == "text":
            run_text(spec, out, report, say)  # type: ignore[arg-type] # of a phrase
        else:
            run_image(spec, out, report, say)  # type: ignore[arg-type] # of a picture
    elif isinstance(spec, ViewsOptions):
        from diff3ds.tasks.views.run_views import run_views

        run_views(base / options["source"], out, with_options(spec, resume=True), report, say)
    elif isinstance(spec, MeshOptions):
        from diff3ds.tasks.mesh.draw_mesh import run_mesh

        run_mesh(base / options["source"], out, spec, report, say)
    else:
        from diff3ds.tasks.points.draw_points import run_points

        run_points(base / options["source"], out, spec, report, say)


def worded(cells: Mapping[str, str]) -> dict[str, Any]:
    """The options of a line of words, each as its command takes it: numbers from digits, several from several words.

    Raises:
        ValueError: words that cannot be read so; the command is none.
    """
    command = cells.get("command")
    if command not in SUBJECTS:
        raise ValueError(f"command must be one of {', '.join(SUBJECTS)}, got {command!r}")
    hints = _hints(command)
    options: dict[str, Any] = {}
    for name, words in cells.items():
        hint = hints.get(name.replace("-", "_"), str)
        options[name] = _read(name, words, hint)
    return options


def _read(name: str, words: str, hint: Any) -> Any:
    """What words mean to an option; where several readings fit, the first of the hint's."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        kinds = [kind for kind in inner if kind is not NoneType]
        return _read(name, words, kinds[0])
    if origin is tuple:
        return [_read(name, word, inner[0]) for word in words.split()]
    if hint is bool:
        if words.lower() not in ("true", "false"):
            raise ValueError(f"{name} must be true or false, got {words!r}")
        return words.lower() == "true"
    if hint in (int, float):
        # Many countries write .5 as 0,5.
        plain = words.replace(",", ".") if hint is float and words.count(",") == 1 and "." not in words else words
        try:
            return hint(plain)
        except ValueError:
            raise ValueError(
                f"{name} must be {'a whole number' if hint is int else 'a number'}, got {words!r}"
            ) from None
    assert hint in (str, Path) or origin is Literal, hint
    return words


def _placed(options: Mapping[str, Any], hints: Mapping[str, Any], base: Path) -> dict[str, Any]:
    """Options whose paths start from `base`; of those that may be something else, such as a colour, only files do."""

    def placed(name: str, value: Any) -> Any:
        if isinstance(value, list):
            return [placed(name, item) for item in value]
        if not isinstance(value, str):
            return value
        path = _is_path(hints.get(name)) or (
            name in MAYBE_PATHS and value not in (*NAMES, *BUILT_IN, *KNOWN) and (base / value).exists()
        )
        return str(base / value) if path else value

    return {name: placed(name, value) for name, value in options.items()}


def _is_path(hint: Any) -> bool:
    return hint is Path or any(_is_path(inner) for inner in get_args(hint))
