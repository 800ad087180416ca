"""Figures of benchmarks/results as Markdown: tables, and the line with machine, commit and command below them."""

import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

FILES = Path(__file__).parent / "results"


def results_of(name: str) -> dict[str, Any]:
    """What a benchmark wrote."""
    read: dict[str, Any] = json.loads((FILES / f"{name}.json").read_text(encoding="utf-8"))
    return read


def markdown(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table whose columns but the first stand to the right."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def source_of(name: str) -> str:
    """Where the figures of a file are from."""
    return about_run(results_of(name)["environment"], name)


def about_run(environment: dict[str, Any], name: str) -> str:
    """Machine, commit and command of a table."""
    given = environment["command"]
    commands = "; ".join(f"`{command(line)}`" for line in ([given] if isinstance(given, str) else given))
    machine = f"{environment['cores']} cores of an {environment['cpu']} ({environment['instruction_set']})"
    if "gpu" in environment:
        machine = f"an {environment['gpu']} beside {machine}"
    note = f"; {environment['note']}" if "note" in environment else ""
    commit = re.sub(r"\b(?=\w*\d)[0-9a-f]{7,12}(-dirty)?", r"`\g<0>`", environment["commit"])
    return f"\n*{machine}; PyTorch {environment['torch']}; commit {commit}; {commands}{note}; {link_to(name)}*\n"


def command(line: str) -> str:
    """A command without the run's own file names."""
    line = re.sub(r" --json \S+| \(as two runs.*\)", "", line)
    return line if "benchmarks/" in line else line.replace("python ", "python benchmarks/", 1)


def link_to(name: str) -> str:
    """A link from a page to a file of figures."""
    return f"[{name}.json](../../benchmarks/results/{name}.json)"


def digits(value: float) -> str:
    """Two significant digits, three from 100 on."""
    if value >= 100:
        return f"{float(f'{value:.3g}'):,.0f}"
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 1 else f"{value:.2f}"


def power(value: float) -> str:
    """Two digits and a power of ten."""
    return f"{value:.1e}".replace("e-0", "e-")


def percent(value: float) -> str:
    """Whole per cents."""
    return f"{100 * value:.0f} %"
