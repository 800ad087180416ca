"""Scores of runs as a table: means and spread by method; CSV, Markdown and JSON."""

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from diff3ds._files import write_text


@dataclass(frozen=True)
class Row:
    """The scores of one run.

    Attributes:
        method: what it is compared as.
        run: its folder.
        subject: its phrase, or the name of its picture.
        strokes: of its sketch.
        scores: by column.
    """

    method: str
    run: str
    subject: str
    strokes: int
    scores: dict[str, float]


@dataclass(frozen=True)
class Summary:
    """One method and one column: mean and sample standard deviation (None for a single run) over so many runs."""

    mean: float
    spread: float | None
    runs: int


def columns_of(rows: Sequence[Row]) -> list[str]:
    """All columns, in the order in which they first come."""
    return list(dict.fromkeys(name for row in rows for name in row.scores))


def summaries(rows: Sequence[Row]) -> dict[str, dict[str, Summary]]:
    """Mean and spread by method and column; columns that no run of a method has are left out there."""
    found: dict[str, dict[str, Summary]] = {}
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        found[method] = {name: _summary([r.scores[name] for r in own if name in r.scores]) for name in columns_of(own)}
    return found


def write_tables(out: Path, rows: Sequence[Row], about: dict[str, Any]) -> None:
    """Writes evaluation.csv (a line for each run), evaluation.md and evaluation.json.

    Args:
        about: how the scores came about: views, networks, versions.
    """
    methods = {method: {n: asdict(s) for n, s in some.items()} for method, some in summaries(rows).items()}
    content = {"about": about, "methods": methods, "runs": [asdict(row) for row in rows]}
    write_text(out / "evaluation.csv", _csv(rows))
    write_text(out / "evaluation.md", markdown(rows, about))
    write_text(out / "evaluation.json", json.dumps(content, indent=1))


def markdown(rows: Sequence[Row], about: dict[str, Any]) -> str:
    """A table of methods, a table of runs, and how the scores came about."""
    names = columns_of(rows)
    methods = [
        [method, str(max(s.runs for s in some.values())), *(mean_and_spread(some.get(name)) for name in names)]
        for method, some in summaries(rows).items()
    ]
    runs = [
        [row.method, row.subject, str(row.strokes), *(f"{row.scores[n]:.4f}" if n in row.scores else "" for n in names)]
        for row in rows
    ]
    notes = [f"- {name}: {value}" for name, value in about.items()]
    parts = (
        "# Evaluation",
        "Mean ± sample standard deviation over the runs of a method.",
        table(["method", "runs", *names], methods),
        "## Runs",
        table(["method", "subject", "strokes", *names], runs),
        "## How",
        "\n".join(notes),
    )
    return "\n\n".join(parts) + "\n"


def _summary(values: Sequence[float]) -> Summary:
    mean = math.fsum(values) / len(values)
    spread = math.sqrt(math.fsum((v - mean) ** 2 for v in values) / (len(values) - 1)) if len(values) > 1 else None
    return Summary(mean, spread, len(values))


def mean_and_spread(summary: Summary | None) -> str:
    """A mean and its sample standard deviation, as a cell."""
    if summary is None:
        return ""
    return f"{summary.mean:.4f}" + ("" if summary.spread is None else f" ± {summary.spread:.4f}")


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    cells = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in cells)


def _csv(rows: Sequence[Row]) -> str:
    names = columns_of(rows)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["method", "run", "subject", "strokes", *names])
    for row in rows:
        writer.writerow([row.method, row.run, row.subject, row.strokes, *(row.scores.get(name, "") for name in names)])
    return text.getvalue()
