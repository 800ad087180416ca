"""The command line: `diff3ds COMMAND`, each command a function of `diff3ds.tasks` with a dataclass of options.

Options need no torch, which takes seconds; what does the work is imported when they are read and found right.
"""

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NoReturn

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, TextColumn, TimeRemainingColumn, TransferSpeedColumn
from rich.progress import Progress as Bars
from tyro.conf import OmitArgPrefixes, Positional, arg

from diff3ds._version import __version__
from diff3ds.command_line.interrupt import STOPPED, importing
from diff3ds.command_line.read_options import as_typed, read_options
from diff3ds.tasks.batch.options import BatchOptions
from diff3ds.tasks.cameras.options import CamerasOptions
from diff3ds.tasks.evaluate.options import EvaluateOptions, JudgeOptions
from diff3ds.tasks.export.options import ExportOptions
from diff3ds.tasks.mesh.options import MeshOptions
from diff3ds.tasks.progress import Lines, Progress, Report, Stopped
from diff3ds.tasks.render.options import PictureOptions, SurfaceOptions, ViewOptions
from diff3ds.tasks.small_prior.options import TrainOptions
from diff3ds.tasks.style_options import StyleOptions
from diff3ds.tasks.text_image.prior_options import BUILT_IN, FOR_PHRASES, FOR_PICTURES
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase, Picture
from diff3ds.tasks.views.options import DoodleOptions, ViewsOptions
from diff3ds.weights.options import FetchOptions

if TYPE_CHECKING:
    from diff3ds.tasks.recognition.recognise import NotRecognised

# Exit codes: 0 done, 1 the input is at fault (2: the command line, from tyro), 130 (STOPPED) by Ctrl-C as in shells.
FAULT = 1
# The rate is that of the last so many seconds, at most of the last 1000 steps. A step of a large network may take one
# minute, or ten on a CPU, and a rate needs two.
RATE_PERIOD = 1800.0

Recipe = Literal["3doodle"]


class _Console(Console):
    """A console that says when nobody reads it any more; rich's own ends the program as if the input were at fault."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


@dataclass(frozen=True)
class Views:
    """Fit a 3D sketch to posed pictures: edge maps, line drawings, or coloured pictures.

    Writes sketch.json, sketch.svg, sketch.step, preview.png and run.json. Ctrl-C ends the fit early and writes what was
    reached; --resume goes on from there.
    """

    fit: OmitArgPrefixes[ViewsOptions]
    # A folder with cameras (transforms.json, COLMAP, Metashape, ...: docs/reference/cameras.md), or their file.
    source: Positional[Path | None] = None
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("out")
    # Fit the scene that the package generates, instead of pictures of yours.
    demo: bool = False
    # 3doodle: black strokes by the losses of 3Doodle; "diff3ds views --recipe 3doodle --help" lists its options.
    recipe: Recipe | None = None
    # Show the run in a browser, at an address that is printed, while it goes on, and then until Ctrl-C.
    view: bool = False
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        if (self.source is None) == (not self.demo):
            raise ValueError("give either a transforms.json (or a folder with one) or --demo")
        with importing():
            from diff3ds.tasks.views.run import run_views

        console = _Console(stderr=True, quiet=self.quiet)
        with _viewed(self.view, self.out, console):
            with _progress(console) as report:
                sketch = run_views(self.source, self.out, self.fit, report, _sayer(console))
            _written(console, len(sketch), self.out)


@dataclass(frozen=True)
class Cameras:
    """Find where photographs were taken from, for "diff3ds views", which does it by itself where it must.

    Takes a folder of photographs, whose cameras pycolmap finds (extra "cameras"), or a project of COLMAP, Metashape and
    others, which is converted. Writes transforms.json and cameras.json, a report.
    """

    cameras: OmitArgPrefixes[CamerasOptions]
    # Folder of photographs, or of a project.
    source: Positional[Path]
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("cameras")
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.cameras.run import run_cameras

        console = _Console(stderr=True, quiet=self.quiet)
        with _progress(console) as report:
            path = run_cameras(self.source, self.out, self.cameras, report, _sayer(console))
        _sayer(console)(f'{path}: "diff3ds views {path}" goes on from here')


@dataclass(frozen=True)
class Doodle:
    """Fit black strokes to posed coloured pictures as 3Doodle does: CLIP's RN101 and VGG16 look at both.

    Writes sketch.json, sketch.svg, sketch.step, preview.png and run.json. Ctrl-C ends the fit early and writes what was
    reached; --resume goes on from there.
    """

    fit: OmitArgPrefixes[DoodleOptions]
    recipe: Recipe
    # transforms.json, or a folder with one.
    source: Positional[Path | None] = None
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("out")
    # Show the run in a browser, at an address that is printed, while it goes on, and then until Ctrl-C.
    view: bool = False
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        if self.source is None:
            raise ValueError("give a transforms.json of coloured pictures, or a folder with one")
        with importing():
            from diff3ds.tasks.views.doodle import run_doodle

        console = _Console(stderr=True, quiet=self.quiet)
        with _viewed(self.view, self.out, console):
            with _progress(console) as report:
                sketch = run_doodle(self.source, self.out, self.fit, report)
            _written(console, len(sketch), self.out)


@dataclass(frozen=True)
class Text:
    """Make a 3D sketch of a phrase, by score distillation from a diffusion prior.

    Priors: mvdream (knows several views at once; the best, and the default where its weights and a GPU are there),
    stable-diffusion, stable-diffusion-768; exemplar, which is built in, needs neither, and knows nearly eighty kinds of
    things; and small, a network that was trained on forty of them. Weights are fetched once by "diff3ds fetch PRIOR";
    "diff3ds doctor" says what is there. Writes sketch.json, sketch.svg, sketch.step, preview.png, run.json, and
    pictures of the progress. Ctrl-C ends the run early and writes what was reached; --resume goes on from there.
    """

    spec: Annotated[OmitArgPrefixes[RunSpec[Phrase]], arg(name="")]
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("out")
    # Show the run in a browser, at an address that is printed, while it goes on, and then until Ctrl-C.
    view: bool = False
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        self.spec.prior.require((*FOR_PHRASES, *BUILT_IN))
        with importing():
            from diff3ds.tasks.text_image.text import run_text

        console = _Console(stderr=True, quiet=self.quiet)
        with _viewed(self.view, self.out, console):
            with _progress(console) as report:
                sketch = run_text(self.spec, self.out, report, _sayer(console))
            _written(console, len(sketch), self.out)


@dataclass(frozen=True)
class Image:
    """Make a 3D sketch of the object in a picture, by score distillation from a prior that knows other views of it.

    Priors: zero123 (Zero123-XL, the default where its weights and a GPU are there), stable-zero123 (weights for
    non-commercial research only); exemplar, which is built in, needs neither, recognises forty kinds of things, and
    draws nearly forty more where --shows names them; and small, a network of those forty. The picture has alpha, or a
    --mask, or a plain background. Writes what "diff3ds text" writes.
    """

    spec: Annotated[OmitArgPrefixes[RunSpec[Picture]], arg(name="")]
    # Folder of the results; by default "out".
    out: Annotated[Path | None, arg(aliases=["-o"])] = None
    # Print what the picture may show; with -o also write guesses.png, which shows it, into the folder.
    guess: bool = False
    # Show the run in a browser, at an address that is printed, while it goes on, and then until Ctrl-C.
    view: bool = False
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        self.spec.prior.require((*FOR_PICTURES, *BUILT_IN))
        if self.guess:
            self._print_guesses()
            return
        with importing():
            from diff3ds.tasks.recognition.guess_sheet import write_guesses
            from diff3ds.tasks.recognition.recognise import NotRecognised
            from diff3ds.tasks.text_image.image import run_image

        console, out = _Console(stderr=True, quiet=self.quiet), self.out or Path("out")

        def drawn(spec: RunSpec[Picture]) -> int:
            with _progress(console) as report:
                return len(run_image(spec, out, report, _sayer(console)))

        with _viewed(self.view, out, console):
            try:
                count = drawn(self.spec)
            except NotRecognised as unsure:
                shown = f"Their pictures: {write_guesses(out, unsure.recognition)}"
                if not (sys.stdin.isatty() and console.is_terminal):
                    raise ValueError(f"{unsure}\n{shown}") from unsure
                known = replace(self.spec.subject, shows=_asked(console, unsure, shown))
                count = drawn(replace(self.spec, subject=known))
            _written(console, count, out)

    def _print_guesses(self) -> None:
        """Prints what the picture may show."""
        subject = self.spec.subject
        for given, option in ((subject.shows, "shows"), (self.spec.prior.library, "library")):
            if given is not None:
                raise ValueError(f"--guess looks among the kinds of the built-in library: leave --{option} out")
        with importing():
            from diff3ds.tasks.functions import recognise

        found = recognise(subject.picture, mask=subject.cut.mask, background=subject.cut.background)
        console = _Console(highlight=False, markup=False, soft_wrap=True)
        console.print(
            f"{found}\n{'the first is sure enough to be drawn' if found.taken else 'none is sure enough to be drawn'}"
        )
        if self.out:
            from diff3ds.tasks.recognition.guess_sheet import write_guesses

            console.print(f"their pictures: {write_guesses(self.out, found)}")


@dataclass(frozen=True)
class Mesh:
    """Draw a mesh: its creases and borders as strokes, and views with its outlines and without hidden lines.

    Takes OBJ, STL, PLY, OFF or GLB, in their own units. Writes sketch.json, sketch.svg and sketch.step with the strokes
    that are there from everywhere, of smooth things outlines from several sides; drawing-1.svg and .png and so on, one
    a view; preview.png, turntable.webp, surface.glb and run.json.
    """

    mesh: OmitArgPrefixes[MeshOptions]
    # The mesh.
    source: Positional[Path]
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("out")
    # Show the run in a browser, at an address that is printed, while it goes on, and then until Ctrl-C.
    view: bool = False
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.mesh.draw_mesh import run_mesh

        console = _Console(stderr=True, quiet=self.quiet)
        with _viewed(self.view, self.out, console):
            with _progress(console) as report:
                sketch = run_mesh(self.source, self.out, self.mesh, report, _sayer(console))
            _written(console, len(sketch), self.out)


@dataclass(frozen=True)
class Render:
    """Draw a sketch: one view, several, a sheet of them, or a turntable.

    The suffix says what is written: .png, .svg or .pdf; .mp4, .webp or .gif for a turntable.
    """

    view: OmitArgPrefixes[ViewOptions]
    picture: OmitArgPrefixes[PictureOptions]
    hiding: OmitArgPrefixes[SurfaceOptions]
    styles: OmitArgPrefixes[StyleOptions]
    # sketch.json, a STEP, DXF, 3DM or USD file, or the folder of a run.
    source: Positional[Path]
    # The picture; several views that make no sheet are numbered: view-1.png, view-2.png.
    out: Annotated[Path, arg(aliases=["-o"])]
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.render.render_views import run_render

        console = _Console(stderr=True, quiet=self.quiet)
        with _progress(console) as report:
            files = run_render(self.source, self.out, self.view, self.picture, self.hiding, self.styles, report)
        _sayer(console)(str(files[0]) if len(files) == 1 else f"{files[0]} to {files[-1].name}")


@dataclass(frozen=True)
class Export:
    """Write a sketch in another format, in the size, unit and frame that another program wants.

    The suffix says which: .json, .step (.stp), .dxf, .3dm, .usd (.usda, .usdc), .glb, .ply, .obj, .py (for Blender) or
    .html (a page to turn it in a browser); .svg in a --style, of the view that "diff3ds render" takes by itself. That
    draws other pictures, and other views.
    """

    export: OmitArgPrefixes[ExportOptions]
    styles: OmitArgPrefixes[StyleOptions]
    # sketch.json, a STEP, DXF, 3DM or USD file, or the folder of a run.
    source: Positional[Path]
    # The file to write.
    file: Positional[Path]
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.export.export import run_export

        sketch = run_export(self.source, self.file, self.export, self.styles)
        _sayer(_Console(stderr=True, quiet=self.quiet))(f"{_counted(len(sketch))}: {self.file}")


@dataclass(frozen=True)
class View:
    """Show a sketch in a browser, to turn and look through: a page from this machine, for this machine alone.

    Says the address to open, and loads the page anew when the file changes. Ctrl-C ends it.
    """

    # sketch.json or another file with a sketch, or the folder of a run.
    source: Positional[Path]
    # A second one, which stands beside it and is seen by the same camera.
    beside: Positional[Path | None] = None
    # Of the address; by default any that is free.
    port: int = 0
    # Open the address in the browser of this machine.
    open: bool = False
    # Say the address alone.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.view.serve import run_view

        show = partial(print, flush=True)
        say = _sayer(_Console(stderr=True, quiet=self.quiet))
        run_view(self.source, self.port, self.open, show, say, self.beside)


@dataclass(frozen=True)
class Eval:
    """Score a folder of runs of "diff3ds text" and "diff3ds image": one table as CSV, Markdown and JSON.

    Runs lie in FOLDER/METHOD/NAME or FOLDER/NAME. Scores: CLIP, BLIP (phrases), LPIPS (pictures), each by networks that
    you name; docs/howto/evaluate.md says which.
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

        console = _Console(stderr=True, quiet=self.quiet)
        with Bars(console=console, disable=self.quiet) as bars:
            task = bars.add_task("runs", total=None)

            def report(done: int, total: int, name: str) -> None:
                bars.update(task, description=name or "runs", total=total, completed=done)

            rows = evaluate(self.folder, self.out, self.networks, self.eval, report)
        _sayer(console)(f"{len(rows)} runs: {self.out / 'evaluation.md'}, .csv, .json")


@dataclass(frozen=True)
class Batch:
    """Do many jobs of text, image, views and mesh: each once, several at a time, on one machine or many.

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

        console = _Console(stderr=True, quiet=self.quiet)
        with _progress(console) as report:
            states = run_batch(self.jobs, self.out, self.batch, report, _sayer(console))
        _sayer(console)(f"{counted(states)}: {self.out / 'summary.md'}, .csv, sheet.png")
        if any(state.state != "done" for state in states):
            sys.exit(FAULT)


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
        say = _sayer(_Console(stderr=True, quiet=self.quiet))
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

        console = _Console(stderr=True, quiet=self.quiet)
        say = _sayer(console)
        say(notice(self.name))
        columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TransferSpeedColumn())
        with Bars(*columns, TimeRemainingColumn(), console=console, disable=self.quiet) as bars:
            task = bars.add_task("weights", total=None)

            def report(transfer: Transfer) -> None:
                bars.update(task, description=transfer.name, total=transfer.total, completed=transfer.done)

            folder = fetch(self.name, self.fetch, report)
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

        console = _Console(stderr=True, quiet=self.quiet)
        with _progress(console) as report:
            path = train_prior(self.out, self.train, report, _sayer(console))
        _sayer(console)(f"use it: --prior small --weights {path}")


@dataclass(frozen=True)
class Doctor:
    """Say what is installed, which weights are here, what each prior needs, and how to get what is missing."""

    # Print JSON.
    json: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.doctor import as_json, as_tables, diagnose

        found = diagnose()
        if self.json:
            print(as_json(found))
        else:
            _Console().print(as_tables(found))


_ABOUT = '3D sketches of rational Bézier strokes. "diff3ds --version" says which version this is.'
_TOO_LARGE = "there is not enough memory. Try fewer strokes, a smaller --batch or --size"


def main(arguments: list[str] | None = None) -> None:
    """Entry point of the command `diff3ds`."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments == ["--version"]:
        print(f"diff3ds {__version__}")
        return
    # A recipe has options of its own.
    views = Doodle if any(word.startswith("--recipe") for word in arguments) else Views
    commands = {"text": Text, "image": Image, "views": views, "cameras": Cameras, "mesh": Mesh}
    commands |= {
        "render": Render,
        "export": Export,
        "view": View,
        "eval": Eval,
        "batch": Batch,
        "study": Study,
        "prior": Prior,
        "fetch": Fetch,
        "doctor": Doctor,
    }
    command = None
    try:
        command = read_options(commands, arguments, _ABOUT)
        with _plain_warnings():
            command.run()
    except KeyboardInterrupt as stop:
        _Console(stderr=True).print(_stopped(command, stop))
        sys.exit(STOPPED)
    except ValueError as error:
        _fail(as_typed(str(error), commands.get(arguments[0])))
    except BrokenPipeError:
        # Nobody reads the output: there is nobody to tell.
        raise
    except (OSError, ImportError, FloatingPointError) as error:
        _fail(str(error))
    except MemoryError:
        _fail(_TOO_LARGE)
    except RuntimeError as error:
        advice = _memory_advice(error)
        if advice is None:
            raise
        _fail(advice)


def _memory_advice(error: RuntimeError) -> str | None:
    """What to do about an error of torch that says there is not enough memory; None for all others."""
    import torch

    said = str(error)
    if isinstance(error, torch.cuda.OutOfMemoryError):
        return f"{said.partition('. ')[0]}. Try --precision float16, a smaller --batch or --size, or --device cpu"
    # Other devices than CUDA's have no error of their own for it.
    if "can't allocate memory" in said:
        return _TOO_LARGE
    return f"{said}. Try a smaller --batch or --size, or --device cpu" if "out of memory" in said else None


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Warnings as sentences, without the place in the code that they come from."""
    with warnings.catch_warnings():
        say = _sayer(Console(stderr=True))
        warnings.showwarning = lambda message, *_, **__: say(f"warning: {message}")
        yield


def _stopped(command: object, stop: KeyboardInterrupt) -> str:
    """What Ctrl-C has left."""
    if isinstance(command, Fetch | Batch):
        return "stopped; the same command goes on"
    if isinstance(stop, Stopped):
        return "stopped; what was reached is written, --resume goes on"
    return "stopped before there was anything new to keep"


def _fail(message: str) -> NoReturn:
    _Console(stderr=True).print(f"diff3ds: {message}", markup=False, highlight=False, soft_wrap=True)
    sys.exit(FAULT)


def _asked(console: Console, unsure: "NotRecognised", shown: str) -> str:
    """What the user says that a picture shows: one of the guesses by its number, or a phrase.

    Args:
        shown: where the guesses are shown.

    Raises:
        NotRecognised: nothing.
    """
    guesses = unsure.recognition.guesses
    choices = [str(i) for i in range(1, len(guesses) + 1)]
    _sayer(console)(
        f"The picture is not recognised for sure. It may be:\n{unsure.recognition}\n{shown}\n"
        f"Which is it? {choices[0]} to {choices[-1]}, or a phrase; Enter stops."
    )
    answer = sys.stdin.readline().strip()
    if not answer:
        raise unsure
    return guesses[choices.index(answer)].caption if answer in choices else answer


def _counted(count: int) -> str:
    return "1 stroke" if count == 1 else f"{count} strokes"


def _written(console: Console, count: int, out: Path) -> None:
    _sayer(console)(f"{_counted(count)}: {out / 'sketch.json'}, .svg, .step, preview.png")


@contextmanager
def _viewed(wanted: bool, out: Path, console: Console) -> Iterator[None]:
    """Shows a run in a browser, where that is wanted."""
    if not wanted:
        yield
        return
    with importing():
        from diff3ds.tasks.view.serve import shown_meanwhile

    with shown_meanwhile(out, partial(print, flush=True), _sayer(console)):
        yield


def _sayer(console: Console) -> Callable[[str], None]:
    return lambda line: console.print(line, markup=False, highlight=False, soft_wrap=True)


def _rate(speed: float) -> str:
    """Of a large network, a step takes seconds."""
    if speed < 1:
        return f"{1 / speed:.1f} s a step"
    return f"{speed:.{0 if speed >= 10 else 1}f} steps/s"


@contextmanager
def _progress(console: Console) -> Iterator[Report]:
    """What reports to a progress bar on a terminal; elsewhere, as in a file, to a line now and then."""
    if console.is_terminal or console.quiet:
        with _bars(console) as report:
            yield report
    else:
        yield Lines(_sayer(console))


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
    bars = Bars(*columns, console=console, disable=console.quiet, speed_estimate_period=RATE_PERIOD)
    task = None
    stage = ""

    def report(progress: Progress) -> None:
        nonlocal task, stage
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


if __name__ == "__main__":
    main()
