"""How the benchmarks show figures: tables on the terminal, and JSON with the machine and the commit they belong to."""

import datetime
import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.table import Table

import diff3ds as ds
from diff3ds.render.backends import kernels

_CONSOLE = Console(width=150, highlight=False, markup=False)


def show(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Prints a table; numbers with four significant digits."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    for row in rows:
        table.add_row(*(_text(cell) for cell in row))
    _CONSOLE.print(table)


def say(text: str) -> None:
    """Prints a line, however long: a command must stay one."""
    _CONSOLE.print(text, soft_wrap=True)


def _text(cell: Any) -> str:
    if isinstance(cell, float):
        return f"{cell:.4g}"
    return "" if cell is None else str(cell)


def environment() -> dict[str, Any]:
    """Machine, versions, commit, command and date."""
    module = kernels()
    return {
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "instruction_set": module.instruction_set() if module else None,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "diff3ds": ds.__version__,
        "commit": _git("describe", "--always", "--dirty", "--abbrev=12"),
        # Only names of files: where they lie says nothing about the figures.
        "command": shlex.join(["python", *(Path(a).name if os.sep in a else a for a in sys.argv)]),
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def write_json(path: Path, environment: dict[str, Any], figures: dict[str, Any]) -> None:
    """Writes the figures with the environment that they were measured in."""
    path.write_text(json.dumps({"environment": environment, "figures": figures}, indent=1) + "\n", encoding="utf-8")


def _cpu_model() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _git(*arguments: str) -> str | None:
    folder = Path(__file__).parent
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
