"""Pictures of a sketch: the views that are asked for, a sheet of them, or a turntable."""

from collections.abc import Iterator
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.formats import save_pdf, save_png, save_svg, tile_images
from diff3ds.formats.drawn_paths import TOLERANCE
from diff3ds.formats.framing import framed
from diff3ds.formats.movie import save_movie
from diff3ds.render import render
from diff3ds.sketch import Sketch
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.render.blender_engine import draw_in_blender
from diff3ds.tasks.render.options import VECTORS, PictureOptions, ViewOptions, check_file, parse_size
from diff3ds.tasks.sketch_input import load_sketch
from diff3ds.transforms import load_transforms

# Pixels that are drawn in one call: some 200 MB.
PIXELS_AT_ONCE = 1 << 22


def run_render(source: Path, file: Path, view: ViewOptions, picture: PictureOptions, report: Report) -> list[Path]:
    """Draws the sketch of a file, or of the folder of a run.

    Returns:
        The files that were written: of several views that make no sheet, one a view, numbered from 1.

    Raises:
        ValueError, OSError, ImportError: as `load_sketch`, `load_transforms`, `check_file` and
            `draw_in_blender`; a turntable of cameras that a file gives.
    """
    check_file(file, picture)
    if picture.turntable is not None and (view.cameras is not None or len(view.azimuth) > 1):
        raise ValueError("a turntable goes once round from one --azimuth: give no --cameras, and one number")
    sketch = load_sketch(source).detach()
    if picture.engine == "blender":
        if len(view.azimuth) > 1 or view.height is not None or view.cameras is not None:
            raise ValueError("Blender draws one perspective view: give one --azimuth, no --height and no --cameras")
        draw_in_blender(file, sketch, views_of(sketch, view, picture), view, picture)
        return [file]
    cameras = views_of(sketch, view, picture)
    if picture.turntable is not None:
        frames = _drawn(sketch, cameras, picture, report)
        save_movie(file, frames, picture.turntable, picture.fps)
        return [file]
    if picture.sheet or len(cameras) == 1:
        _save(file, sketch, cameras, picture, report)
        return [file]
    digits = len(str(len(cameras)))
    files = [file.with_stem(f"{file.stem}-{i + 1:0{digits}}") for i in range(len(cameras))]
    for i, name in enumerate(files):
        _save(name, sketch, cameras[i], picture, lambda _: None)
        report(Progress("views", i + 1, len(files), None, 0))
    return files


def views_of(sketch: Sketch, view: ViewOptions, picture: PictureOptions) -> Cameras:
    """The cameras that are asked for: of a turntable, one a frame.

    Raises:
        ValueError, OSError: as `load_transforms`.
    """
    size = None if picture.size is None else parse_size(picture.size)
    if view.cameras is not None:
        path = view.cameras / "transforms.json" if view.cameras.is_dir() else view.cameras
        cameras, _ = load_transforms(path)
        return cameras if size is None else cameras.resize(size)
    around = view.azimuth
    if (count := picture.turntable) is not None:
        around = tuple(view.azimuth[0] + 360 * i / count for i in range(count))
    return framed(
        sketch, around, view.elevation, size=size or 512, distance=view.distance, fov=view.fov, height=view.height
    )


def _save(file: Path, sketch: Sketch, cameras: Cameras, picture: PictureOptions, report: Report) -> None:
    """One file of one view or a sheet."""
    suffix = file.suffix.lower()
    if suffix in VECTORS:
        (save_pdf if suffix == ".pdf" else save_svg)(
            file,
            sketch,
            cameras,
            background=picture.color,
            width_mm=picture.width_mm,
            layers=None if picture.layers == "none" else picture.layers,
            centerline=picture.centerline,
            tolerance=picture.tolerance or TOLERANCE,
        )
    else:
        views = torch.stack(list(_drawn(sketch, cameras, picture, report)))
        save_png(file, tile_images(views))


def _drawn(sketch: Sketch, cameras: Cameras, picture: PictureOptions, report: Report) -> Iterator[Float[Tensor, "..."]]:
    """Each view as an RGB picture, or where the background is transparent straight RGBA."""
    at_once = max(1, PIXELS_AT_ONCE // (cameras.size[0] * cameras.size[1]))
    for first in range(0, len(cameras), at_once):
        some = cameras[first : first + at_once]
        color = picture.color
        drawn = render(sketch, some, background=torch.tensor(color or (0.0, 0.0, 0.0)))
        images = drawn.color
        if color is None:
            alpha = drawn.alpha[..., None]
            images = torch.cat([images / alpha.clamp(min=1e-6), alpha], -1)
        for i, image in enumerate(images):
            yield image
            report(Progress("frames" if picture.turntable else "views", first + i + 1, len(cameras), None, 0))
