"""What a command says while it works: progress, what it wrote, where to look; to stderr."""

import math
from collections.abc import Callable, Iterator, Sized
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from diff3ds.command_line.interrupt import importing
from diff3ds.tasks.progress import Lines, Progress, Report

# The rate is that of the last so many seconds, at most of the last 1000 steps. A step of a large network may take one
# minute, or ten on a CPU, and a rate needs two.
RATE_PERIOD = 1800.0
# [s; speed] A bar is drawn so often: of a stage with thousands of steps a second each would cost more than the step.
DRAWN = 0.1


class PlainConsole(Console):
    """A console that says when nobody reads it any more; rich's own ends the program as if the input were at fault."""

    def on_broken_pipe(self) -> None:
        """Raises BrokenPipeError, which ends the program without a word."""
        raise BrokenPipeError


def sayer(console: Console) -> Callable[[str], None]:
    """What says a line on a console as it is: no word of it is markup."""
    return lambda line: console.print(line, markup=False, highlight=False, soft_wrap=True)


def counted_strokes(count: int) -> str:
    """As a sentence counts strokes."""
    return "1 stroke" if count == 1 else f"{count} strokes"


def say_written(console: Console, count: int, out: Path) -> None:
    """Says what a run has written."""
    sayer(console)(f"{counted_strokes(count)}: {out / 'sketch.json'}, .svg, .step, preview.png")


@contextmanager
def viewed(wanted: bool, out: Path, console: Console) -> Iterator[None]:
    """Shows a run in a browser, where that is wanted."""
    if not wanted:
        yield
        return
    with importing():
        from diff3ds.tasks.view_sketch.view import shown_meanwhile

    with shown_meanwhile(out, partial(print, flush=True), sayer(console)):
        yield


def run_shown(out: Path, view: bool, quiet: bool, run: Callable[[Report, Callable[[str], None]], Sized]) -> None:
    """Runs what writes a sketch to a folder, with its progress and what it says on the console, or in a browser too."""
    console = PlainConsole(stderr=True, quiet=quiet)
    with viewed(view, out, console):
        with progress_on(console) as report:
            sketch = run(report, sayer(console))
        say_written(console, len(sketch), out)


@contextmanager
def progress_on(console: Console) -> Iterator[Report]:
    """What reports to a progress bar on a terminal; elsewhere, as in a file, to a line now and then; or to nobody."""
    if console.quiet:
        yield lambda progress: None
    elif console.is_terminal:
        with _bars(console) as report:
            yield report
    else:
        yield Lines(sayer(console))


@contextmanager
def _bars(console: Console) -> Iterator[Report]:
    """A progress bar with the stage, rate, time left, loss and strokes; yields what reports to it."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[steps]}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[about]}"),
    )
    bars = Bars(*columns, console=console, speed_estimate_period=RATE_PERIOD)
    task = None
    stage, due = "", -math.inf

    def report(progress: Progress) -> None:
        nonlocal task, stage, due
        if progress.stage == stage and progress.done != progress.total and console.get_time() < due:
            return
        due = console.get_time() + DRAWN
        # Not before there is something to show: an empty display leaves an empty line.
        bars.start()
        if task is None or progress.stage != stage:
            if task is not None:
                bars.update(task, total=bars.tasks[-1].completed, steps="", about="")
            stage = progress.stage
            task = bars.add_task(stage, total=progress.total, steps="", about="")
        bars.update(task, total=progress.total, completed=progress.done)
        speed = bars.tasks[-1].speed
        loss = "" if progress.loss is None else f"loss {progress.loss:.5g}  "
        steps = f"{progress.done}/{progress.total}" if progress.total else ""
        bars.update(
            task,
            steps=steps + (f"  {_rate(speed)}" if speed else ""),
            about=loss + (f"{progress.strokes} strokes  {progress.note}" if progress.strokes else ""),
        )

    try:
        yield report
    finally:
        if task is not None:
            bars.stop()


def _rate(speed: float) -> str:
    """Of a large network, a step takes seconds."""
    if speed < 1:
        return f"{1 / speed:.1f} s a step"
    return f"{speed:.{0 if speed >= 10 else 1}f} steps/s"
