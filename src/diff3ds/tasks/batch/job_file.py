"""Files of jobs: TOML, JSON lines or CSV, each job a table of options; globs and sweeps make several of one."""

import csv
import glob
import hashlib
import io
import itertools
import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff3ds._files import read_text
from diff3ds.tasks.batch.commands import PATHS, SUBJECTS, check_options, worded

# More jobs than this are a sweep that was not meant.
MOST_JOBS = 1_000_000
# Letters of a folder's name that say what its job is about, before those that make it unique.
SAYING, UNIQUE = 40, 10
_METHOD = re.compile(r"\w[\w.-]*")
# The first line by which Excel is told what separates cells.
_SEPARATOR = re.compile(r'\s*"?sep=(.)"?[^\S\r\n]*\r?\n', re.IGNORECASE)
# What a job says beside the options of its command.
_OF_JOBS = ("command", "method", "sweep")
# Where a job stands, the options of all jobs, and over them its own.
_Read = tuple[str, dict[str, Any], dict[str, Any]]
# What the batch itself writes into its folder: no method's folder, on disks that tell no capitals apart either.
TAKEN = ("attempts", "sheet.png", "summary.csv", "summary.md")


@dataclass(frozen=True)
class Job:
    """A run of a command.

    Attributes:
        name: of its folder, from its settings; below the folder of its method, where it has one.
        command: text, image, views or mesh.
        options: as the file has them, the phrase, picture or source among them.
        base: what relative paths are relative to: the folder of the file.
        method: what `diff3ds eval` compares it as, or "".
    """

    name: str
    command: str
    options: dict[str, Any]
    base: Path
    method: str = ""


def read_jobs(path: Path) -> list[Job]:
    """All jobs of a file, every option checked.

    Raises:
        ValueError: the file cannot be read, has no jobs, or one twice; a job names no command, an
            option that its command does not have, a value that it does not take, or a file that is not there.
    """
    kind = path.suffix.lower()
    if kind not in _READERS:
        raise ValueError(f"{path}: a file of jobs is .toml, .jsonl or .csv")
    if not path.is_file():
        raise ValueError(f"{path} is not there: give a file of jobs; docs/howto/batch.md shows some")
    base = path.absolute().parent
    found: dict[str, tuple[str, Job]] = {}
    for place, shared, own in _READERS[kind](path, read_text(path)):
        try:
            for job in _expanded(shared | own, base):
                if job.name in found:
                    raise ValueError(f"the same job as {found[job.name][0]}: leave one of them out")
                if len(found) == MOST_JOBS:
                    raise ValueError(f"more than {MOST_JOBS} jobs: make the sweep smaller")
                found[job.name] = place, job
        except (ValueError, TypeError, FileNotFoundError) as error:
            blamed = _misfit(shared, own, base) or f"{place}: {error}"
            raise ValueError(f"{path}, {blamed}") from error
    if not found:
        raise ValueError(f"{path}: no jobs in it")
    return [job for _, job in found.values()]


def _of_toml(path: Path, text: str) -> Iterator[_Read]:
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: not a TOML file ({error})") from error
    jobs, shared = content.pop("jobs", None), content.pop("defaults", {})
    if content or not isinstance(jobs, list) or not isinstance(shared, dict):
        named = f"; it has {next(iter(content))!r}" if content else ""
        raise ValueError(f"{path}: wants a [[jobs]] table a job, and one of [defaults] at most{named}")
    for number, job in enumerate(jobs, 1):
        if not isinstance(job, dict):
            raise ValueError(f"{path}, job {number}: not a table of options")
        try:
            yield f"job {number}", _underscored(shared), _underscored(job)
        except ValueError as error:
            raise ValueError(f"{path}, job {number}: {error}") from error


def _of_lines(path: Path, text: str) -> Iterator[_Read]:
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            job = json.loads(line, object_pairs_hook=_once)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"{path}, line {number}: not JSON ({error})") from error
        if not isinstance(job, dict):
            raise ValueError(
                f"{path}, line {number}: wants an object of options, such as " + '{"command": "text", ...}'
            )
        yield f"line {number}", {}, job


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of JSON, which would keep the last of two values in silence."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{twice} is given twice: leave one of them out")
    return found


def _of_csv(path: Path, text: str) -> Iterator[_Read]:
    """Cells are words; what they mean, the options say that they are of. Empty ones say nothing.

    Spreadsheets leave out empty cells at the ends of lines, or write them where no column is.
    """
    said = _SEPARATOR.match(text)
    text, skipped = (text[said.end() :], 1) if said else (text, 0)
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=said[1] if said else _separator(text), strict=True)
    try:
        head = _filled(next(rows, []))
        if not head or len(set(head)) < len(head) or "" in head:
            raise ValueError(f"{path}: the first line names the columns, each once: command, phrase, seed")
        for row in rows:
            cells, place = _filled(row), f"line {rows.line_num + skipped}"
            if len(cells) > len(head):
                raise ValueError(f"{path}, {place}: {len(cells)} cells for {len(head)} columns")
            given = {name: cell for name, cell in zip(head, cells, strict=False) if cell}
            if given:
                try:
                    yield place, {}, worded(given)
                except ValueError as error:
                    raise ValueError(f"{path}, {place}: {error}") from error
    except csv.Error as error:
        raise ValueError(f"{path}, line {rows.line_num + skipped}: not a CSV file ({error})") from error


def _separator(text: str) -> str:
    """What stands between the names of columns, of which one is command: spreadsheets of many countries write ;."""
    head = text.lstrip().partition("\n")[0]
    found = (mark for mark in ",;\t" if "command" in (name.strip(' "\r') for name in head.split(mark)))
    return next(found, ",")


def _filled(row: list[str]) -> list[str]:
    """The cells of a line without the empty ones at its end."""
    cells = [cell.strip() for cell in row]
    while cells and not cells[-1]:
        cells.pop()
    return cells


_READERS = {".toml": _of_toml, ".jsonl": _of_lines, ".csv": _of_csv}


def _misfit(shared: Mapping[str, Any], own: Mapping[str, Any], base: Path) -> str | None:
    """Says which of the options of all jobs the command of one does not take; None where it takes each."""
    given = {**shared, **own}
    command = given.get("command")
    subject = SUBJECTS.get(command) if isinstance(command, str) else None
    if subject is None or subject not in given:
        return None
    about = {name: value for name, value in shared.items() if name not in {*own, *_OF_JOBS, subject}}
    for name, value in about.items():
        try:
            check_options(str(command), {subject: given[subject], name: value}, base)
        except FileNotFoundError:
            return None
        except (ValueError, TypeError) as error:
            return f"[defaults]: {error}. Give {name} to the jobs of other commands than {command} alone"
    return None


def _expanded(given: Mapping[str, Any], base: Path) -> Iterator[Job]:
    """The jobs that one table stands for.

    Raises:
        ValueError, TypeError, FileNotFoundError: as `check_options`; a method or a sweep that is none; a pattern that
            no file fits.
    """
    options = _underscored(given)
    command, method, sweep = options.pop("command", None), options.pop("method", ""), options.pop("sweep", {})
    if not isinstance(command, str) or command not in SUBJECTS:
        raise ValueError(f"command must be one of {', '.join(SUBJECTS)}, got {command!r}")
    if method and not (isinstance(method, str) and _METHOD.fullmatch(method)):
        raise ValueError(f"method names a folder, of letters, digits, - and _, got {method!r}")
    if method and method.casefold() in TAKEN:
        raise ValueError(f"method {method!r} is what the batch writes itself: give the method another name")
    for values in _swept(options, sweep):
        for one in _globbed(command, options | values, base):
            check_options(command, one, base)
            name = _name(command, one)
            yield Job(f"{method}/{name}" if method else name, command, one, base, method)


def _underscored(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options by their names in Python.

    Raises:
        ValueError: one is there with - and with _.
    """
    found: dict[str, Any] = {}
    for name, value in given.items():
        plain = name.replace("-", "_")
        if plain in found:
            raise ValueError(f"{plain} is given twice, with - and with _: leave one of them out")
        found[plain] = value
    return found


def _swept(options: Mapping[str, Any], sweep: Any) -> Iterator[dict[str, Any]]:
    """All combinations of the values of a sweep."""
    if not isinstance(sweep, dict):
        raise ValueError(f"sweep gives each option a list of values: {{seed = [0, 1, 2]}}, got {sweep!r}")
    lists = _underscored(sweep)
    for name, values in lists.items():
        if not isinstance(values, list) or not values:
            raise ValueError(f"sweep gives each option a list of values, got {name} = {values!r}")
        if name in options:
            raise ValueError(f"{name} is both given and swept: leave one of them out")
    for combination in itertools.product(*lists.values()):
        yield dict(zip(lists, combination, strict=True))


def _globbed(command: str, options: dict[str, Any], base: Path) -> Iterator[dict[str, Any]]:
    """One job a file, where the subject is a pattern and no file by itself."""
    subject = SUBJECTS[command]
    pattern = options.get(subject)
    plain = subject not in PATHS or not isinstance(pattern, str) or not glob.has_magic(pattern)
    if plain or (base / str(pattern)).exists():
        yield options
        return
    files = sorted(glob.glob(str(pattern), root_dir=base, recursive=True))
    if not files:
        raise FileNotFoundError(f"no file fits {pattern!r}")
    for file in files:
        yield options | {subject: Path(file).as_posix()}


def _name(command: str, options: Mapping[str, Any]) -> str:
    """A name that says what the job is about, and is another for every other job."""
    subject = str(options[SUBJECTS[command]])
    if SUBJECTS[command] in PATHS:
        subject = Path(subject).stem
    said = re.sub(r"[^\w]+", "_", subject).strip("_")[:SAYING] or command
    settings = json.dumps([command, options], sort_keys=True, ensure_ascii=False)
    return f"{said}-{hashlib.sha256(settings.encode()).hexdigest()[:UNIQUE]}"
