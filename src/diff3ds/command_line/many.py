"""The commands for many sketches: `batch`, `eval` and `study`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from rich.progress import Progress as Bars
from tyro.conf import OmitArgPrefixes, Positional, arg

from diff3ds.command_line.console import PlainConsole, progress_on, sayer
from diff3ds.command_line.exit_codes import FAULT
from diff3ds.command_line.interrupt import importing
from diff3ds.tasks.batch.batch_options import BatchOptions
from diff3ds.tasks.evaluate.evaluate_options import EvaluateOptions, JudgeOptions


@dataclass(frozen=True)
class Batch:
    """Do many jobs of text, image, views, mesh and points: each once, several at a time, on one machine or many.

    JOBS is a TOML, JSON lines or CSV file with the options of a command for each job; docs/howto/batch.md shows them.
    Each has a folder in OUT, and summary.csv, summary.md and sheet.png say what became of all. A job that fails stops
    no other. Whatever is stopped or killed, the same command goes on from there; several may share OUT. The exit code
    is 0 when all jobs are done.
    """

    batch: OmitArgPrefixes[BatchOptions]
    # The file of jobs.
    jobs: Positional[Path]
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("batch")
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.batch.batch import run_batch
            from diff3ds.tasks.batch.summary import counted

        console = PlainConsole(stderr=True, quiet=self.quiet)
        with progress_on(console) as report:
            states = run_batch(self.jobs, self.out, self.batch, report, sayer(console))
        sayer(console)(f"{counted(states)}: {self.out / 'summary.md'}, .csv, sheet.png")
        if any(state.state != "done" for state in states):
            sys.exit(FAULT)


@dataclass(frozen=True)
class Eval:
    """Score a folder of runs of "diff3ds text", "image" and "views": one table as CSV, Markdown and JSON.

    Runs lie in FOLDER/METHOD/NAME or FOLDER/NAME. Scores: CLIP, BLIP (phrases), LPIPS, HED (pictures), by networks that
    you name; of posed pictures, without networks, distances to the curves of the scene's ground_truth.json, PSNR and
    SSIM. docs/howto/evaluate.md says more.
    """

    networks: OmitArgPrefixes[JudgeOptions]
    eval: OmitArgPrefixes[EvaluateOptions]
    # Folder of the runs.
    folder: Positional[Path]
    # Folder of the tables.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("evaluation")
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.evaluate.evaluate import evaluate

        console = PlainConsole(stderr=True, quiet=self.quiet)
        with Bars(console=console, disable=self.quiet) as bars:
            task = bars.add_task("runs", total=None)

            def report(done: int, total: int, name: str) -> None:
                bars.update(task, description=name or "runs", total=total, completed=done)

            rows = evaluate(self.folder, self.out, self.networks, self.eval, report)
        sayer(console)(f"{len(rows)} runs: {self.out / 'evaluation.md'}, .csv, .json")


@dataclass(frozen=True)
class Study:
    """Ask people about sketches: "make" writes a page for participants, "analyse" says what they answered.

    "diff3ds study make ours=out/ours theirs=out/theirs -o study" writes study/study.html, which asks two questions
    about each sketch, in an order of each participant's own, without a network. Their files of answers go to
    study/answers; "diff3ds study analyse study" writes means with confidence intervals, paired tests, the agreement of
    participants, and a plot.
    """

    action: Positional[Literal["make", "analyse"]]
    # make: METHOD=FOLDER for each method, with its runs. analyse: the folder of the study.
    what: Positional[tuple[str, ...]]
    # Folder of the study that is made.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("study")
    # Of the page.
    title: str = "3D sketches"
    # Say nothing, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        say = sayer(PlainConsole(stderr=True, quiet=self.quiet))
        if self.action == "make":
            with importing():
                from diff3ds.tasks.study.make_study import make_study, named_folders

            count = make_study(named_folders(self.what), self.out, self.title)
            say(f"{count} sketches: {self.out / 'study.html'}; answers go to {self.out / 'answers'}")
            return
        if len(self.what) != 1:
            raise ValueError(f"analyse takes the folder of one study, got {len(self.what)}")
        with importing():
            from diff3ds.tasks.study.analyse_study import analyse_study

        folder = Path(self.what[0])
        _, count = analyse_study(folder)
        say(f"{count} participants: {folder / 'analysis.md'}, .json, .svg")
