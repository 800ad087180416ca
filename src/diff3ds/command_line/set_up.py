"""The commands that set something up: `fetch`, `prior train` and `doctor`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from rich.progress import BarColumn, DownloadColumn, TextColumn, TimeRemainingColumn, TransferSpeedColumn
from rich.progress import Progress as Bars
from tyro.conf import OmitArgPrefixes, Positional, arg

from diff3ds.command_line.console import PlainConsole, progress_on, sayer
from diff3ds.command_line.exit_codes import FAULT
from diff3ds.command_line.interrupt import importing
from diff3ds.tasks.doctor.trial_options import TrialOptions
from diff3ds.tasks.small_prior.train_options import TrainOptions
from diff3ds.weights.weight_options import FetchOptions


@dataclass(frozen=True)
class Fetch:
    """Download the weights of a prior or judge, once; a download that stopped goes on where it did.

    Priors: mvdream, stable-diffusion, stable-diffusion-768, zero123, stable-zero123. Judges of "diff3ds eval" and
    "diff3ds views --recipe 3doodle": clip-b16, clip-b32, blip, vgg16, clip-rn101. They go to the cache of the Hugging
    Face hub.
    """

    fetch: OmitArgPrefixes[FetchOptions]
    # Name of the prior or judge.
    name: Positional[str]
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.weights.fetch import Transfer, fetch, notice

        console = PlainConsole(stderr=True, quiet=self.quiet)
        say = sayer(console)
        say(notice(self.name))
        columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TransferSpeedColumn())
        with Bars(*columns, TimeRemainingColumn(), console=console, disable=self.quiet) as bars:
            task = bars.add_task("weights", total=None)

            def report(transfer: Transfer) -> None:
                bars.update(task, description=transfer.name, total=transfer.total, completed=transfer.done)

            folder = fetch(self.name, self.fetch, report, say)
        say(f"{self.name}: {folder}")


@dataclass(frozen=True)
class Prior:
    """Train the small prior, a network for "--prior small", on the built-in library or a folder of your own.

    Writes small.safetensors, a checkpoint, a log, and pictures of what it has learned so far. Ctrl-C keeps a
    checkpoint; --resume goes on from there.
    """

    train: OmitArgPrefixes[TrainOptions]
    action: Positional[Literal["train"]]
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("prior")
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.small_prior.prior_train import train_prior

        console = PlainConsole(stderr=True, quiet=self.quiet)
        with progress_on(console) as report:
            path = train_prior(self.out, self.train, report, sayer(console))
        sayer(console)(f"use it: --prior small --weights {path}")


@dataclass(frozen=True)
class Doctor:
    """Say what is installed, which weights are here, what each prior needs, and how to get what is missing.

    With --try, whether the weights of a prior do what a prior must: its pictures come back from latents, noise is told
    from a drawing, views agree, a blurred drawing is pulled to a sharp one; and what a step of a run takes. The exit
    code is 0 if all is sound, else 1.
    """

    trial: OmitArgPrefixes[TrialOptions]
    # Print JSON.
    json: bool = False

    def run(self) -> None:
        """Runs the command."""
        if self.trial.prior is not None:
            self._try()
            return
        with importing():
            from diff3ds.tasks.doctor.diagnosis import as_json, as_tables, diagnose

        found = diagnose()
        if self.json:
            print(as_json(found))
        else:
            PlainConsole().print(as_tables(found))

    def _try(self) -> None:
        with importing():
            from diff3ds.tasks.doctor.trial import try_prior
            from diff3ds.tasks.doctor.trial_report import trial_as_json, trial_as_tables

        trial = try_prior(self.trial, sayer(PlainConsole(stderr=True)))
        if self.json:
            print(trial_as_json(trial))
        else:
            PlainConsole().print(trial_as_tables(trial))
        if not trial.sound:
            sys.exit(FAULT)
