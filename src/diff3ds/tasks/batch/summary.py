"""What became of all jobs: a table as CSV and Markdown, and a sheet of pictures."""

import csv
import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff3ds._files import write_text
from diff3ds.tasks.batch.claims import Claims, shortened
from diff3ds.tasks.batch.commands import SUBJECTS
from diff3ds.tasks.batch.finished import run_record
from diff3ds.tasks.batch.job_file import Job
from diff3ds.tasks.evaluate.score_table import Row, columns_of, mean_and_spread, summaries, table

# A result of so few strokes is worth a look: little of what was asked for, or nothing. Empirical.
FEW = 3


@dataclass(frozen=True)
class JobState:
    """Where a job is.

    Attributes:
        job: which.
        state: done; failed, killed or timeout (the last try); stopped, or waiting (no try has ended).
        tries: that were begun.
        message: why the last one failed, or what is odd about the result.
        strokes: of the result.
        seconds: that all tries took: the last one as run.json has it.
        scores: of the result, from run.json.
    """

    job: Job
    state: str
    tries: int
    message: str = ""
    strokes: int | None = None
    seconds: float | None = None
    scores: dict[str, float] | None = None


def states_of(jobs: Sequence[Job], out: Path, claims: Claims, done: Mapping[str, JobState]) -> list[JobState]:
    """Looks where each job is, but for those of which it is known that they are done."""
    return [done.get(job.name) or _state(job, out, claims) for job in jobs]


def done_state(job: Job, record: Mapping[str, Any], claims: Claims) -> JobState:
    """Where a job is whose run.json says this."""
    tries = claims.tries(job.name)
    seconds = round(_seconds(job, claims, tries - 1) + math.fsum(record.get("seconds", {}).values()), 3)
    strokes, scores = record.get("strokes_left"), record.get("scores", {})
    few = isinstance(strokes, int) and strokes <= FEW
    message = f"nearly empty: {strokes} stroke{'' if strokes == 1 else 's'}" if few else ""
    return JobState(job, "done", tries, message, strokes, seconds, scores)


def _seconds(job: Job, claims: Claims, tries: int) -> float:
    """What the first so many tries of a job took, as far as they have ended."""
    outcomes = (claims.outcome(job.name, number) for number in range(1, tries + 1))
    return math.fsum(outcome.seconds for outcome in outcomes if outcome)


def counted(states: Sequence[JobState]) -> str:
    """How many jobs are done, and what became of the others."""
    count = Counter(state.state for state in states)
    others = [f"{number} {state}" for state, number in count.items() if state != "done"]
    return ", ".join([f"{count['done']} of {len(states)} jobs done", *others])


def write_summary(out: Path, states: Sequence[JobState]) -> None:
    """Writes summary.csv and summary.md: a line a job, with the options in which jobs differ."""
    swept = _differing([state.job for state in states])
    scores = list(dict.fromkeys(name for state in states for name in state.scores or {}))
    about, found = ["job", "state", "command", "subject"], ["strokes", "seconds", "tries", *scores, "message"]
    # An option called as what was found, such as strokes, is told apart as on the command line.
    head = [*about, *(f"--{name}" if name in (*about, *found) else name for name in swept), *found]
    lines = [_line(state, swept, scores) for state in states]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(lines)
    write_text(out / "summary.csv", text.getvalue())
    parts = ["# Batch", f"{counted(states)}.", *_means(states), "## Jobs", table(head, lines)]
    write_text(out / "summary.md", "\n\n".join(parts) + "\n")


def _state(job: Job, out: Path, claims: Claims) -> JobState:
    tries = claims.tries(job.name)
    record = run_record(out / job.name)
    if record is not None:
        return done_state(job, record, claims)
    outcome = claims.outcome(job.name, tries) if tries else None
    seconds = round(_seconds(job, claims, tries), 3) if tries else None
    if outcome is None:
        return JobState(job, "waiting", tries, seconds=seconds)
    state = outcome.state if outcome.state != "done" else "waiting"
    return JobState(job, state, tries, shortened(outcome.message), seconds=seconds)


def _differing(jobs: Sequence[Job]) -> list[str]:
    """The options that not all jobs share, but for what they are about."""
    names = dict.fromkeys(name for job in jobs for name in job.options if name != SUBJECTS[job.command])
    return [name for name in names if len({repr(job.options.get(name)) for job in jobs}) > 1]


def _line(state: JobState, swept: Sequence[str], scores: Sequence[str]) -> list[str]:
    job, found = state.job, state.scores or {}
    cells: list[Any] = [job.name, state.state, job.command, job.options[SUBJECTS[job.command]]]
    cells += [job.options.get(name) for name in swept]
    cells += [state.strokes, state.seconds, state.tries, *(found.get(name) for name in scores), state.message]
    return ["" if cell is None else " ".join(str(cell).split()) for cell in cells]


def _means(states: Sequence[JobState]) -> list[str]:
    """A table of methods, where jobs have one."""
    done = [state for state in states if state.state == "done" and state.job.method]
    if not done:
        return []
    rows = [Row(state.job.method, state.job.name, "", state.strokes or 0, _numbers(state)) for state in done]
    names = columns_of(rows)
    lines = [
        [method, str(max(s.runs for s in some.values())), *(mean_and_spread(some.get(name)) for name in names)]
        for method, some in summaries(rows).items()
    ]
    about = "Mean ± sample standard deviation over the jobs of a method that are done."
    return ["## Methods", about, table(["method", "jobs", *names], lines)]


def _numbers(state: JobState) -> dict[str, float]:
    return {"strokes": float(state.strokes or 0), "seconds": state.seconds or 0.0, **(state.scores or {})}
