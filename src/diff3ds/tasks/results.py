"""The folder that a run writes: sketch.json, .svg, .step, preview.png, run.json, and surface.glb if one is known."""

import json
import platform
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import existing_folder, write_text
from diff3ds._shapes import Float, Tensor
from diff3ds._version import __version__
from diff3ds.camera import Cameras, evenly_spaced
from diff3ds.formats import save, save_png, save_svg, tile_images
from diff3ds.formats.cad.step import save_step
from diff3ds.formats.framing import framed
from diff3ds.formats.mesh import save_surface
from diff3ds.parallel.in_copies import in_copies
from diff3ds.render import available_backends, get_num_threads
from diff3ds.sketch import Sketch
from diff3ds.surfaces.seen_around import ranked_around
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.render.drawn_scene import Scene
from diff3ds.tasks.render.page_options import NO_PAGE, PageOptions
from diff3ds.tasks.render.render_options import PictureOptions, SurfaceOptions
from diff3ds.with_surface import render as render_with_surface

SVG_VIEWS = 4
# What hides lines of the sketch, in its frame.
SURFACE = "surface.glb"
# Bytes that a run writes at most: checkpoints and results of some thousand strokes, pictures of the progress; and with
# a checkpoint of a network, twice while one takes the place of another.
ROOM, ROOM_FOR_NETWORKS = 1 << 26, 1 << 28
# Strokes for which a copy of the process that writes them is worth its start. Empirical.
WORTH_COPY = 200
# Losses in run.json: enough for a plot.
MOST_LOSSES = 500

# What a preview shows: all around, seen a little from above.
PREVIEWS, PREVIEW_ELEVATION, PREVIEW_SIZE = 8, 15.0, 256


@dataclass(frozen=True)
class RunInfo:
    """What run.json says about a run.

    Attributes:
        options: as the user gave them.
        chosen: what was found out or filled in.
        seconds: wall time by part.
        losses: of every step.
        scores: of the result.
        stopped: whether it was ended early.
    """

    options: dict[str, Any]
    chosen: dict[str, Any]
    seconds: dict[str, float]
    losses: list[float]
    scores: dict[str, float]
    stopped: bool


def write_results(
    out: Path,
    sketch: Sketch,
    cameras: Cameras,
    preview: Float[Tensor, "H W 3"] | None,
    info: RunInfo,
    surface: TriangleMesh | None = None,
    layers: Sequence[str] | None = None,
    sort: bool = True,
    page: PageOptions = NO_PAGE,
) -> Sketch:
    """Writes all files of a run, each whole or not at all.

    Args:
        sketch: its strokes are written by their importance, which is found where they have none yet.
        cameras: some of which the SVG file shows.
        preview: the picture in preview.png; None for one of the views of the SVG file on the page.
        surface: what hides lines of the sketch; of a run before this one nothing is left.
        layers: of the strokes in sketch.step; by default there is one a colour.
        sort: whether strokes whose importance is not known yet come in its order, which those of a user do not.
        page: that the views of sketch.svg lie on, and those of preview.png.

    Returns:
        The sketch as it was written.
    """
    if sketch.importance is None:
        sketch, strokes = ranked_around(sketch, surface, sort=sort)
        layers = None if layers is None else [layers[stroke] for stroke in strokes]

    def written(job: int) -> None:
        if job == 0:
            write_pictures(out, sketch, cameras, preview, surface, page)
            return
        if surface is not None:
            save_surface(out / SURFACE, surface.vertices, surface.faces)
        save(out / "sketch.json", sketch)
        save_step(out / "sketch.step", sketch, layers=layers)

    in_copies(written, 2, 1 + len(sketch) // WORTH_COPY)
    every = -(-len(info.losses) // MOST_LOSSES) or 1
    content = {
        "options": {k: str(v) if isinstance(v, Path) else v for k, v in info.options.items()},
        **info.chosen,
        "strokes_left": len(sketch),
        "steps_done": len(info.losses),
        "stopped_early": info.stopped,
        "scores": info.scores,
        "seconds": {name: round(value, 3) for name, value in info.seconds.items()},
        "versions": {
            "diff3ds": __version__,
            "torch": torch.__version__,
            "python": platform.python_version(),
            "machine": platform.machine(),
            "threads": get_num_threads(),
            "backends": available_backends(),
        },
        "loss": {"every": every, "values": info.losses[::every]},
    }
    write_text(out / "run.json", json.dumps(content, indent=1))
    if surface is None:
        (out / SURFACE).unlink(missing_ok=True)
    return sketch


def write_pictures(
    out: Path,
    sketch: Sketch,
    cameras: Cameras,
    preview: Float[Tensor, "H W 3"] | None,
    surface: TriangleMesh | None,
    page: PageOptions = NO_PAGE,
) -> None:
    """Writes sketch.svg and preview.png; the arguments are those of `write_results`."""
    views = cameras[evenly_spaced(len(cameras), SVG_VIEWS)]
    save_svg(out / "sketch.svg", sketch, views, page=page.setup)
    if preview is None:
        preview = _sheet(sketch, views, surface, page)
    save_png(out / "preview.png", preview, pixels_per_mm=page.picture_per_mm)


def turntable(sketch: Sketch) -> Cameras:
    """Eight views all around, in which the sketch is whole."""
    azimuths = [360 * i / PREVIEWS for i in range(PREVIEWS)]
    return framed(sketch, azimuths, PREVIEW_ELEVATION, size=PREVIEW_SIZE)


def seen_around(sketch: Sketch, cameras: Cameras, surface: TriangleMesh | None) -> Float[Tensor, "H W 3"]:
    """The preview: a view beside the other, without the lines that the surface hides, and with its contours."""
    return tile_images(render_with_surface(sketch, cameras, surface=surface).color, columns=4)


def _sheet(sketch: Sketch, cameras: Cameras, surface: TriangleMesh | None, page: PageOptions) -> Float[Tensor, "H W 3"]:
    """A picture of views on a page, without the lines that a surface hides."""
    assert page.setup is not None
    scene = Scene(sketch, list(range(len(sketch))), surface, SurfaceOptions(), None, PictureOptions(), page)
    return scene.sheet(cameras, page.setup)


def check_output_folder(out: Path, checkpoint: Path, resume: bool, overwrite: bool, room: int = ROOM) -> None:
    """Sees that a run may have this folder, before any work.

    Args:
        checkpoint: of the run.
        resume: whether a run that is there goes on.
        overwrite: whether a run that is there may be lost.
        room: bytes that it may need.

    Raises:
        ValueError: it holds a run that is neither to be resumed nor overwritten; there is nothing to resume.
        OSError: it cannot be a folder, or there is no room for results.
    """
    if resume and not checkpoint.exists():
        raise ValueError(f"{out} has no checkpoint to resume from: leave --resume out to start a run")
    held = [path for path in (checkpoint, out / "run.json") if path.exists()]
    if held and not resume and not overwrite:
        raise ValueError(f"{out} holds a run: give another folder (-o), --resume to go on, or --overwrite")
    free = shutil.disk_usage(existing_folder(out)).free
    if free < room:
        raise OSError(
            f"{out}: {free >> 20} MiB are free, and a run may need {room >> 20}: make room or give another -o"
        )


@contextmanager
def output_folder(out: Path) -> Iterator[None]:
    """The folder of a run is there from its start; where the run ends before anything is in it, it goes again.

    Raises:
        OSError: it cannot be made.
    """
    existing_folder(out)
    made = [path for path in (out, *out.parents) if not path.exists()]
    out.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with suppress(OSError):
            for path in made:
                path.rmdir()
        raise
