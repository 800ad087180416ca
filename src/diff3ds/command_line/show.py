"""The commands that show sketches, `render`, `export`, `view`, `studio`; `apply`: an edited drawing comes back."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, arg

from diff3ds.command_line.console import PlainConsole, counted_strokes, progress_on, sayer
from diff3ds.command_line.interrupt import importing
from diff3ds.tasks.detail_options import DetailOptions
from diff3ds.tasks.export.export_options import ExportOptions
from diff3ds.tasks.render.page_options import PageOptions
from diff3ds.tasks.render.render_options import OrbitOptions, PictureOptions, SurfaceOptions
from diff3ds.tasks.style_options import StyleOptions


@dataclass(frozen=True)
class Render:
    """Draw a sketch: one view, several, a sheet of them, or a turntable.

    The suffix says what is written: .png, .svg, .pdf, a flat .dxf or .hpgl for plotters; .mp4, .webp or .gif for a
    turntable; .json for the strokes that a view shows, in space; .py for these in Blender's Grease Pencil, a frame each
    of a turntable.
    """

    view: OmitArgPrefixes[OrbitOptions]
    picture: OmitArgPrefixes[PictureOptions]
    level: OmitArgPrefixes[DetailOptions]
    hiding: OmitArgPrefixes[SurfaceOptions]
    styles: OmitArgPrefixes[StyleOptions]
    page: OmitArgPrefixes[PageOptions]
    # sketch.json, a STEP, DXF, 3DM or USD file, or the folder of a run.
    source: Positional[Path]
    # The picture; several views that make no sheet are numbered, view-1.png, view-2.png, or pages of one .pdf file.
    out: Annotated[Path, arg(aliases=["-o"])]
    # No progress, only errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.render.render_views import run_render

        console = PlainConsole(stderr=True, quiet=self.quiet)
        with progress_on(console) as report:
            how = (self.view, self.picture, self.hiding, self.styles)
            files = run_render(self.source, self.out, *how, report, self.level, sayer(console), self.page)
        sayer(console)(str(files[0]) if len(files) == 1 else f"{files[0]} to {files[-1].name}")


@dataclass(frozen=True)
class Export:
    """Write a sketch in another format, in the size, unit and frame that another program wants.

    The suffix says which: .json, .step (.stp), .iges, .dxf, .3dm, .usd (.usda, .usdc, .usdz), .glb, .ply, .stl, .obj,
    .py (for Blender) or .html (a page to turn it in a browser); .svg in a --style, of the view that "diff3ds render"
    takes by itself. That draws other pictures, and other views.
    """

    export: OmitArgPrefixes[ExportOptions]
    level: OmitArgPrefixes[DetailOptions]
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

        say = sayer(PlainConsole(stderr=True, quiet=self.quiet))
        sketch = run_export(self.source, self.file, self.export, self.styles, say, self.level)
        say(f"{counted_strokes(len(sketch))}: {self.file}")


@dataclass(frozen=True)
class Apply:
    """Bring the edits of an SVG drawing back onto the sketch that it shows.

    Colours, widths, opacities, names and deletions of its paths, in whatever program, are matched by their ids;
    everything else of the sketch stays as it is, to the last bit. What could not be matched is said.
    """

    # The SVG file, drawn by "diff3ds render" or a run, and edited.
    edited: Positional[Path]
    # The sketch that it was drawn of: sketch.json or another file, or the folder of a run.
    source: Positional[Path]
    # The new one: of a run a folder, else a file.
    out: Annotated[Path, arg(aliases=["-o"])]
    # What is there may be lost.
    overwrite: bool = False
    # Nothing is said but errors.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.apply.apply_edits import run_apply

        say = sayer(PlainConsole(stderr=True, quiet=self.quiet))
        sketch = run_apply(self.edited, self.source, self.out, self.overwrite, say)
        say(f"{counted_strokes(len(sketch))}: {self.out}")


@dataclass(frozen=True)
class View:
    """Show a sketch in a browser, to turn and look through: a page from this machine, for this machine alone.

    Says the address to open, and loads the page anew when the file changes. Ctrl-C ends it.
    """

    # sketch.json or another file with a sketch, or the folder of a run.
    source: Positional[Path]
    # A second one, which stands beside it and is seen by the same camera.
    beside: Positional[Path | None] = None
    # A mesh, in the sketch's frame, that hides lines: .obj, .stl, .ply, .off, .glb or .gltf; by default the surface.glb
    # of the run, where there is one.
    surface: Path | None = None
    # The axis that points up in its file; a .glb file says it itself.
    surface_up: Literal["z", "y"] = "z"
    # Of the address; by default any that is free.
    port: int = 0
    # The address of this machine that it listens on; 0.0.0.0 is all of them, as a container needs: then whoever has
    # the address of the page sees and changes the sketch.
    host: str = "127.0.0.1"
    # Other names by which your browser reaches this machine, such as that of a JupyterHub or a codespace; localhost
    # with any port, as through an SSH tunnel, needs none.
    allow_host: tuple[str, ...] = ()
    # Open the address in the browser of this machine.
    open: bool = False
    # Say the address alone.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.view_sketch.view import run_view

        show = partial(print, flush=True)
        say = sayer(PlainConsole(stderr=True, quiet=self.quiet))
        solid = (self.surface, self.surface_up)
        run_view(self.source, self.port, self.open, show, say, self.beside, *solid, self.host, self.allow_host)


@dataclass(frozen=True)
class Studio:
    """Say, draw or drop what becomes a 3D sketch, in a browser: a page from this machine, for this machine alone.

    Says the address, with its secret, and opens it. Phrases, drawings, pictures, meshes, clouds, solids and photographs
    are made into sketches one after the other; they can be stopped, and go on with the next studio of the folder. Each
    is shown to turn, edit and save. Ctrl-C ends it.
    """

    # Folder of what is made.
    out: Annotated[Path, arg(aliases=["-o"])] = Path("studio")
    # Of the address; by default any that is free.
    port: int = 0
    # The address of this machine that it listens on; 0.0.0.0 is all of them, as a container needs: then whoever has
    # the address of the page makes, sees and deletes sketches.
    host: str = "127.0.0.1"
    # Other names by which your browser reaches this machine, such as that of a JupyterHub or a codespace; localhost
    # with any port, as through an SSH tunnel, needs none.
    allow_host: tuple[str, ...] = ()
    # Open the address in the browser of this machine (--no-open: leave that to you).
    open: bool = True
    # Say the address alone.
    quiet: bool = False

    def run(self) -> None:
        """Runs the command."""
        with importing():
            from diff3ds.tasks.studio.run_studio import run_studio

        say = sayer(PlainConsole(stderr=True, quiet=self.quiet))
        run_studio(self.out, self.port, self.open, partial(print, flush=True), say, self.host, self.allow_host)
