"""The commands that make sketches, `views`, `text`, `image`, `mesh` and `points`; `cameras`, which goes before."""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.console import Console
from tyro.conf import OmitArgPrefixes, Positional, arg

from diff3ds.command_line.console import PlainConsole, progress_on, run_shown, say_written, sayer, viewed
from diff3ds.command_line.interrupt import importing
from diff3ds.tasks.cameras.registration_options import RegistrationOptions
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.points.points_options import PointsOptions
from diff3ds.tasks.text_image.prior_options import BUILT_IN, FOR_PHRASES, FOR_PICTURES
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase, Picture
from diff3ds.tasks.views.views_options import DoodleOptions, ViewsOptions

if TYPE_CHECKING:
    from diff3ds.recognition.recognise import NotRecognised

Recipe = Literal["3doodle"]


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
            from diff3ds.tasks.views.run_views import run_views

        run_shown(self.out, self.view, self.quiet, lambda *told: run_views(self.source, self.out, self.fit, *told))


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
        source = self.source
        if source is None:
            raise ValueError("give a transforms.json of coloured pictures, or a folder with one")
        with importing():
            from diff3ds.tasks.views.color_fit.doodle import run_doodle

        run_shown(self.out, self.view, self.quiet, lambda report, say: run_doodle(source, self.out, self.fit, report))


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

        run_shown(self.out, self.view, self.quiet, lambda *told: run_text(self.spec, self.out, *told))


@dataclass(frozen=True)
class Image:
    """Make a 3D sketch of the object in a picture, by score distillation from a prior that knows other views of it.

    Priors: zero123 (Zero123-XL, the default where its weights and a GPU are there), stable-zero123 (weights for
    non-commercial research only); exemplar, which is built in, needs neither, and recognises nearly eighty kinds
    of things; and small, a network of forty of them. The picture has alpha, or a --mask, or a plain background. Writes
    what "diff3ds text" writes.
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
            from diff3ds.recognition.recognise import NotRecognised
            from diff3ds.tasks.text_image.guess_sheet import write_guesses
            from diff3ds.tasks.text_image.image import run_image

        console, out = PlainConsole(stderr=True, quiet=self.quiet), self.out or Path("out")

        def drawn(spec: RunSpec[Picture]) -> int:
            with progress_on(console) as report:
                return len(run_image(spec, out, report, sayer(console)))

        with viewed(self.view, out, console):
            try:
                count = drawn(self.spec)
            except NotRecognised as unsure:
                shown = f"Their pictures: {write_guesses(out, unsure.recognition)}"
                if not (sys.stdin.isatty() and console.is_terminal):
                    raise ValueError(f"{unsure}\n{shown}") from unsure
                known = replace(self.spec.subject, shows=_asked(console, unsure, shown))
                count = drawn(replace(self.spec, subject=known))
            say_written(console, count, out)

    def _print_guesses(self) -> None:
        """Prints what the picture may show."""
        subject = self.spec.subject
        for given, option in ((subject.shows, "shows"), (self.spec.prior.library, "library")):
            if given is not None:
                raise ValueError(f"--guess looks among the kinds of the built-in library: leave --{option} out")
        with importing():
            from diff3ds.tasks.functions import recognise

        found = recognise(subject.picture, mask=subject.cut.mask, background=subject.cut.background)
        console = PlainConsole(highlight=False, markup=False, soft_wrap=True)
        console.print(
            f"{found}\n{'the first is sure enough to be drawn' if found.taken else 'none is sure enough to be drawn'}"
        )
        if self.out:
            from diff3ds.tasks.text_image.guess_sheet import write_guesses

            console.print(f"their pictures: {write_guesses(self.out, found)}")


@dataclass(frozen=True)
class Mesh:
    """Draw a mesh or solids: creases and borders as strokes, and views with outlines and without hidden lines.

    Takes OBJ, STL, PLY, OFF or glTF, in their own units, and solids in STEP, IGES or BREP. Writes sketch.json,
    sketch.svg and sketch.step with strokes that are there from everywhere, of smooth things outlines from several
    sides; drawing-1.svg and .png and so on, one a view; preview.png, turntable.webp, surface.glb and run.json.
    """

    mesh: OmitArgPrefixes[MeshOptions]
    # The mesh, or the file of solids.
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

        run_shown(self.out, self.view, self.quiet, lambda *told: run_mesh(self.source, self.out, self.mesh, *told))


@dataclass(frozen=True)
class Points:
    """Find the edges in a cloud of points: where the planes, cylinders, cones, spheres and tori that explain it meet.

    Takes PLY, XYZ and other texts, NPY, PCD, LAS or LAZ, with or without normals, whole or seen from one side. Writes
    sketch.json, sketch.svg, sketch.step, preview.png and run.json, which has the forms.
    """

    points: OmitArgPrefixes[PointsOptions]
    # The cloud.
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
            from diff3ds.tasks.points.draw_points import run_points

        run_shown(self.out, self.view, self.quiet, lambda *told: run_points(self.source, self.out, self.points, *told))


@dataclass(frozen=True)
class Cameras:
    """Find where photographs were taken from, for "diff3ds views", which does it by itself where it must.

    Takes a folder of photographs, whose cameras pycolmap finds (extra "cameras"), or a project of COLMAP, Metashape and
    others, which is converted. Writes transforms.json and cameras.json, a report.
    """

    cameras: OmitArgPrefixes[RegistrationOptions]
    # Folder of photographs, or of a project.
    source: Positional[Path]
    # Folder of the results.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("cameras")
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.cameras.run_cameras import run_cameras

        console = PlainConsole(stderr=True, quiet=self.quiet)
        with progress_on(console) as report:
            path = run_cameras(self.source, self.out, self.cameras, report, sayer(console))
        sayer(console)(f'{path}: "diff3ds views {path}" goes on from here')


def _asked(console: Console, unsure: "NotRecognised", shown: str) -> str:
    """What the user says that a picture shows: one of the guesses by its number, or a phrase.

    Args:
        shown: where the guesses are shown.

    Raises:
        NotRecognised: nothing.
    """
    guesses = unsure.recognition.guesses
    choices = [str(i) for i in range(1, len(guesses) + 1)]
    sayer(console)(
        f"The picture is not recognised for sure. It may be:\n{unsure.recognition}\n{shown}\n"
        f"Which is it? {choices[0]} to {choices[-1]}, or a phrase; Enter stops."
    )
    answer = sys.stdin.readline().strip()
    if not answer:
        raise unsure
    return guesses[choices.index(answer)].caption if answer in choices else answer
