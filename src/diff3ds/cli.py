"""The command line: `diff3ds COMMAND`, each command a function of `diff3ds.tasks` with a dataclass of options."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from diff3ds.tasks.plan import ViewsOptions
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.views import fit_views

# Exit codes: 0 done, 1 the input is at fault (2: the command line, from tyro), 130 stopped by Ctrl-C as in shells.
FAULT, STOPPED = 1, 130


@dataclass(frozen=True)
class Views:
    """Fit a 3D sketch to posed pictures: edge maps, line drawings, or coloured pictures.

    Writes sketch.json, sketch.svg, sketch.step, preview.png and run.json. Ctrl-C ends the fit early and writes what was
    reached; --resume goes on from there.
    """

    fit: OmitArgPrefixes[ViewsOptions]
    # transforms.json (instant-ngp, nerfstudio, NeRF), or a folder with one.
    source: Positional[Path | None] = None
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("out")
    # Fit the scene that the package generates, instead of pictures of yours.
    demo: bool = False
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        if (self.source is None) == (not self.demo):
            raise ValueError("give either a transforms.json (or a folder with one) or --demo")
        console = Console(stderr=True, quiet=self.quiet)
        with _progress(console) as report:
            sketch = fit_views(self.source, self.out, self.fit, report)
        console.print(f"{len(sketch)} strokes: {self.out / 'sketch.json'}, .svg, .step, preview.png")


def main(arguments: list[str] | None = None) -> None:
    """Entry point of the command `diff3ds`."""
    command = tyro.extras.subcommand_cli_from_dict(
        {"views": Views},
        prog="diff3ds",
        description="3D sketches of rational Bézier strokes.",
        args=arguments,
        config=(FlagCreatePairsOff,),
    )
    try:
        command.run()
    except KeyboardInterrupt:
        Console(stderr=True).print("stopped; what was reached is written, --resume goes on")
        sys.exit(STOPPED)
    except (ValueError, OSError, ImportError, FloatingPointError) as error:
        Console(stderr=True).print(f"diff3ds: {error}", markup=False, highlight=False, soft_wrap=True)
        sys.exit(FAULT)


@contextmanager
def _progress(console: Console) -> Iterator[Report]:
    """A progress bar with the stage, rate, time left, loss and strokes; yields what reports to it."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[steps]}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[about]}"),
    )
    with Bars(*columns, console=console, disable=console.quiet) as bars:
        task = None
        stage = ""

        def report(progress: Progress) -> None:
            nonlocal task, stage
            if task is None or progress.stage != stage:
                if task is not None:
                    bars.update(task, total=bars.tasks[-1].completed, steps="", about="")
                stage = progress.stage
                task = bars.add_task(stage, total=progress.total, steps="", about="")
            speed = bars.tasks[-1].speed
            loss = "" if progress.loss is None else f"loss {progress.loss:.5g}  "
            steps = f"{progress.done}/{progress.total}" if progress.total else ""
            bars.update(
                task,
                total=progress.total,
                completed=progress.done,
                steps=steps + (f"  {speed:.0f} steps/s" if speed else ""),
                about=f"{loss}{progress.strokes} strokes  {progress.note}" if progress.strokes else "",
            )

        yield report


if __name__ == "__main__":
    main()
