"""Which constants of edges matter: each made smaller and larger, and what that does to the F-score.

    python benchmarks/sensitivity.py OUT FOLDER... [--every 1] [--jobs 2] [--chosen measured,empirical] [--only TEXT]

A folder is one of those of `views.py`. Every constant that `constants.py` finds is multiplied by 0.7 and by 1.4 in a
run of `diff3ds views` on every folder, with all that follows from it: the number is changed in the source as it is
imported. Fractions stay at 1 or below, of cosines the angle is multiplied, and whole numbers change by one at least.
Writes OUT/sensitivity.json after each run, and goes on from there when it is started again.
"""

import argparse
import ast
import contextlib
import importlib.abc
import importlib.util
import io
import json
import math
import multiprocessing
import os
import platform
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from constants import PACKAGE, Constant, constants
from curve_scores import score
from damage import thinned_out

FACTORS = (0.7, 1.4)
ROOMS = ("diff3ds.edges", "diff3ds.curves", "diff3ds.tasks.views")
# What a run imports that no constant changes.
PRELOADED = [
    "torch",
    "scipy.ndimage",
    "scipy.spatial",
    "PIL.Image",
    "safetensors.torch",
    "diff3ds.tasks.views.run_views",
]
# How many constants the report names.
NAMED = 10


def main() -> None:
    """Runs what the command line asks for, as far as it has not been run, and prints which constants matter."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--every", type=int, default=1, help="use every so manieth view")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="so many runs at once, of one thread each"
    )
    parser.add_argument("--chosen", default="measured,empirical", help="constants that were chosen on these")
    parser.add_argument("--only", default="", help="constants whose module.NAME contains this")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    wanted = [c for c in constants() if c.chosen in options.chosen.split(",") and options.only in name_of(c)]
    path = options.out / "sensitivity.json"
    known = json.loads(path.read_text()) if path.exists() else {}
    about = {"constants": len(wanted), "every": options.every, "commit": _commit(), "machine": _machine()}
    # Results of several sources or several views do not go together.
    if known and any(known[name] != about[name] for name in ("every", "commit")):
        raise SystemExit(f"{path} is of commit {known['commit']}, every {known['every']}: give another folder")
    scores: dict[str, dict[str, float]] = known.get("F5", {})
    for name, folder, value in _run_all(wanted, options, scores):
        scores.setdefault(name, {})[folder] = value
        _write(path, {"command": " ".join(["python", *sys.argv]), **about, "F5": scores})
        print(f"{name:50} {folder:10} F5 {value:.3f}", flush=True)
    print(report(scores))


def name_of(constant: Constant) -> str:
    """The constant's name with its module."""
    return f"{constant.module}.{constant.name}"


def report(scores: dict[str, dict[str, float]]) -> str:
    """The constants that change the F-score most, on average over the folders that all of their runs are known of."""
    rows = changes(scores)
    lines = [f"{len(rows)} constants with both factors, baseline {scores.get('', {})}"]
    lines += [
        f"{name:45} x {FACTORS[0]}: {less:+.4f}   x {FACTORS[1]}: {more:+.4f}" for name, less, more in rows[:NAMED]
    ]
    still = sum(less == more == 0 for _, less, more in rows)
    return "\n".join([*lines, f"{still} change nothing"])


def changes(scores: dict[str, dict[str, float]]) -> list[tuple[str, float, float]]:
    """Name and mean changes of the F-score by both factors, of the constants that have both; the largest first.

    Runs that failed are left out: that a constant cannot have a value says nothing of how much it matters.
    """
    base = scores.get("", {})
    rows = []
    for name in sorted({key.rpartition(" x ")[0] for key in scores if key}):
        pair = [scores.get(f"{name} x {factor}", {}) for factor in FACTORS]
        folders = {folder for folder in set(base).intersection(*pair) if all(one[folder] for one in pair)}
        if folders:
            less, more = (sum(one[f] - base[f] for f in folders) / len(folders) for one in pair)
            rows.append((name, less, more))
    return sorted(rows, key=lambda row: -max(abs(row[1]), abs(row[2])))


def _run_all(
    wanted: Sequence[Constant], options: argparse.Namespace, known: dict[str, dict[str, float]]
) -> Iterator[tuple[str, str, float]]:
    """Runs what is not known, and yields the name of each run, its folder and its score as they come."""
    jobs: list[tuple[str, Constant | None, float]] = [("", None, 1.0)]
    # If there is no time for all, those that there was time for are a fair sample; one folder after the other.
    shuffled = random.Random(0).sample(wanted, len(wanted))
    jobs += [(f"{name_of(c)} x {factor}", c, factor) for c in shuffled for factor in FACTORS]
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    with ProcessPoolExecutor(options.jobs, mp_context=context, max_tasks_per_child=1) as pool:
        runs = {}
        for folder in options.folders:
            source = thinned_out(folder, "edges", options.every, options.out / "views" / folder.name)
            for name, constant, factor in jobs:
                if folder.name not in known.get(name, {}):
                    runs[pool.submit(_scored, constant, factor, source, folder)] = name, folder.name
        for run in as_completed(runs):
            yield *runs[run], run.result()


def _scored(constant: Constant | None, factor: float, source: Path, folder: Path) -> float:
    """The F-score at 5 mm of one run; 0 if it fails, as it does when a constant makes it find nothing."""
    import torch

    torch.set_num_threads(1)
    for name in [name for name in sys.modules if name.startswith(ROOMS)]:
        del sys.modules[name]
    if constant is not None:
        sys.meta_path.insert(0, _Changed(constant, factor))
    from diff3ds.cli import main as command

    with tempfile.TemporaryDirectory() as out, contextlib.redirect_stderr(io.StringIO()):
        try:
            command(["views", str(source), "-o", str(Path(out) / "run"), "--quiet"])
        except SystemExit as end:
            if end.code:
                return 0.0
        truth = json.loads((folder / "ground_truth.json").read_text())
        return float(score(json.loads((Path(out) / "run/sketch.json").read_text()), truth)["F5"])


class _Changed(importlib.abc.MetaPathFinder):
    """Imports the module of a constant with the constant changed."""

    def __init__(self, constant: Constant, factor: float) -> None:
        self.constant, self.factor = constant, factor

    def find_spec(self, name: str, path: Any, target: ModuleType | None = None) -> ModuleSpec | None:
        """The module of the constant, from changed source; no other."""
        if name != f"diff3ds.{self.constant.module}":
            return None
        file = PACKAGE / (self.constant.module.replace(".", "/") + ".py")
        return importlib.util.spec_from_file_location(name, file, loader=_Loader(name, str(file), self))


class _Loader(SourceFileLoader):
    def __init__(self, name: str, path: str, changed: _Changed) -> None:
        super().__init__(name, path)
        self.changed = changed

    def get_code(self, fullname: str) -> CodeType:
        """The code of the changed source; what is compiled already is of the source as it is."""
        source = changed_source(Path(self.path).read_text(), self.changed.constant, self.changed.factor)
        return compile(source, self.path, "exec")


def changed_source(source: str, constant: Constant, factor: float) -> str:
    """The source with the constant's number multiplied."""
    lines = source.splitlines(keepends=True)
    line = lines[constant.line - 1]
    number = line[constant.start : constant.stop]
    # Of `np.cos(np.deg2rad(20.0))` the number is the angle already.
    written = constant.value == number or constant.value == repr(ast.literal_eval(number))
    new = scaled(ast.literal_eval(number), constant.unit if written else "", factor)
    lines[constant.line - 1] = f"{line[: constant.start]}{new!r}{line[constant.stop :]}"
    return "".join(lines)


def scaled(value: float, unit: str, factor: float) -> float:
    """The value multiplied: of a cosine the angle, parts at most to the whole, a whole number by one at least."""
    if unit == "cosine":
        return math.cos(min(factor * math.acos(value), math.pi))
    if unit == "%":
        return min(100, round(value * factor))
    if isinstance(value, int):
        new = round(value * factor)
        return new if new != value else value + (1 if factor > 1 else -1)
    return min(1.0, value * factor) if unit == "fraction" else value * factor


def _write(path: Path, content: dict[str, Any]) -> None:
    """Writes the file whole or not at all."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(content, indent=1, sort_keys=True))
    part.replace(path)


def _commit() -> str:
    done = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    return done.stdout.strip()


def _machine() -> str:
    return f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores"


if __name__ == "__main__":
    main()
