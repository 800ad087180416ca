"""Pictures of a sketch: the views that are asked for, a sheet of them, or a turntable."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import torch

from diff3ds._files import write_text
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.formats import save_pdf, save_png, save_svg, tile_images
from diff3ds.formats.framing import framed
from diff3ds.formats.movie import save_movie
from diff3ds.page.drawn_paths import TOLERANCE
from diff3ds.render import Rendering
from diff3ds.sketch import Sketch
from diff3ds.surfaces.draw import visible_lines
from diff3ds.surfaces.hatching.tones import Hatch
from diff3ds.surfaces.shape.load_surface import load_surface
from diff3ds.surfaces.shape.smooth_surface import smooth_for_pictures
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.svg.path_ids import KEPT
from diff3ds.tasks.detail_options import WHOLE, DetailOptions
from diff3ds.tasks.hatch_options import PIXELS
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.render.blender_engine import draw_in_blender
from diff3ds.tasks.render.render_options import (
    VECTORS,
    OrbitOptions,
    PictureOptions,
    SurfaceOptions,
    check_file,
    parse_size,
)
from diff3ds.tasks.render.stroke_layers import layers_by
from diff3ds.tasks.results import SURFACE
from diff3ds.tasks.sketch_input import at_level, load_sketch
from diff3ds.tasks.style_options import StyleOptions
from diff3ds.tasks.styling import Styling
from diff3ds.transforms import load_transforms
from diff3ds.with_surface import render

# Pixels that are drawn in one call: some 200 MB.
PIXELS_AT_ONCE = 1 << 22


class _Shown(NamedTuple):
    """Strokes that are drawn: their numbers, -1 for lines of the view alone, and which are visible, None for all."""

    sketch: Sketch
    numbers: list[int]
    seen: list[bool] | None

    def layers(self, picture: PictureOptions) -> list[tuple[str, ...]] | None:
        """The layers that are asked for."""
        return layers_by(self.sketch, picture.layers, self.seen)


@dataclass(frozen=True)
class _Scene:
    """A sketch, the numbers that its strokes had, what hides it, and the style that it is drawn in."""

    sketch: Sketch
    numbers: list[int]
    surface: TriangleMesh | None
    hiding: SurfaceOptions
    styling: Styling | None
    hatch: Hatch | None

    def render(self, cameras: Cameras, background: Tensor) -> Rendering:
        """Pictures of it."""
        return render(
            self.sketch,
            cameras,
            background=background,
            surface=self.surface,
            hidden=self.hiding.hidden or "drop",
            contours=self.hiding.contours,
            hatch=self.hatch,
        )

    def strokes(self, cameras: Cameras) -> _Shown:
        """What is drawn in all views, or with a surface in the one view."""
        if self.surface is None:
            return _Shown(self.sketch, self.numbers, None)
        (lines,) = visible_lines(self.sketch, cameras, self.surface, contours=self.hiding.contours, hatch=self.hatch)
        hidden = self.hiding.hidden or "drop"
        origins = lines.origins(hidden)
        given = [lines.numbers[row] for row, _ in origins]
        numbers = [-1 if number < 0 else self.numbers[number] for number in given]
        return _Shown(lines.drawn(hidden), numbers, [seen for _, seen in origins])


def run_render(
    source: Path,
    file: Path,
    view: OrbitOptions,
    picture: PictureOptions,
    hiding: SurfaceOptions,
    styles: StyleOptions,
    report: Report,
    level: DetailOptions = WHOLE,
    say: Callable[[str], None] = lambda line: None,
) -> list[Path]:
    """Draws the sketch of a file, or of the folder of a run; says how far a pen goes that draws it.

    Returns:
        The files that were written: of several views that make no sheet, one a view, numbered from 1.

    Raises:
        ValueError, OSError, ImportError: as `load_sketch`, `load_surface`, `load_transforms`, `check_file` and
            `draw_in_blender`; a turntable of cameras that a file gives; a surface in what cannot have one.
    """
    check_file(file, picture)
    if picture.turntable is not None and (view.cameras is not None or len(view.azimuth) > 1):
        raise ValueError("a turntable goes once round from one --azimuth: give no --cameras, and one number")
    if hiding.hides and (picture.engine == "blender" or (picture.sheet and _is_vector(file))):
        raise ValueError("a --surface hides lines in pictures by the kernels, and in .svg and .pdf files of one view")
    if styles.style is not None:
        _check_styled(file, picture, styles.style)
    if picture.centerline and picture.color is not None:
        warnings.warn("the --background is a filled shape: plotters and cutters draw its edge", stacklevel=2)
    sketch = load_sketch(source).detach()
    surface = _surface(source, hiding)
    drawn, numbers = at_level(sketch, level)
    if picture.engine == "blender":
        if len(view.azimuth) > 1 or view.height is not None or view.cameras is not None:
            raise ValueError("Blender draws one perspective view: give one --azimuth, no --height and no --cameras")
        draw_in_blender(file, drawn, views_of(sketch, view, picture), view, picture)
        return [file]
    # From where the whole sketch is seen well: between levels nothing moves.
    cameras = views_of(sketch, view, picture)
    if surface is not None:
        surface = smooth_for_pictures(surface, max(cameras.size))
    per_mm = PIXELS if picture.width_mm is None else cameras.size[1] / picture.width_mm
    styling = None if styles.style is None else Styling(styles)
    scene = _Scene(drawn, numbers, surface, hiding, styling, hiding.tone.made(per_mm))
    if picture.turntable is not None:
        frames = _drawn(scene, cameras, picture, report)
        save_movie(file, frames, picture.turntable, picture.fps)
        return [file]
    if picture.sheet or len(cameras) == 1:
        _save(file, scene, cameras, picture, report, say)
        return [file]
    digits = len(str(len(cameras)))
    files = [file.with_stem(f"{file.stem}-{i + 1:0{digits}}") for i in range(len(cameras))]
    for i, name in enumerate(files):
        _save(name, scene, cameras[i], picture, lambda _: None, say)
        report(Progress("views", i + 1, len(files), None, 0))
    return files


def _surface(source: Path, hiding: SurfaceOptions) -> TriangleMesh | None:
    """What hides lines: the surface in a file that is named, or in the folder of the run.

    Raises:
        ValueError, OSError, ImportError: as `load_surface`; there is none.
    """
    if not hiding.hides:
        return None
    if hiding.surface is not None:
        return load_surface(hiding.surface, up=hiding.surface_up)
    if not source.is_dir():
        raise ValueError(
            f"{source} is no folder of a run, which has a surface: give a --surface with --hidden or --hatch"
        )
    if not (source / SURFACE).exists():
        raise ValueError(
            f"{source} has no {SURFACE}: nothing is known that hides lines of this run; give a --surface with --hidden"
        )
    return load_surface(source / SURFACE)


def views_of(sketch: Sketch, view: OrbitOptions, picture: PictureOptions) -> Cameras:
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


def _save(
    file: Path,
    scene: _Scene,
    cameras: Cameras,
    picture: PictureOptions,
    report: Report,
    say: Callable[[str], None],
) -> None:
    """One file of one view or a sheet."""
    if scene.styling is not None and file.suffix.lower() == ".svg":
        shown = scene.strokes(cameras)
        which = (shown.layers(picture), shown.numbers)
        write_text(file, scene.styling.svg(shown.sketch, cameras, picture.color, picture.width_mm, *which))
    elif _is_vector(file):
        shown = scene.strokes(cameras)
        how: dict[str, Any] = {
            "background": picture.color,
            "width_mm": picture.width_mm,
            "layers": shown.layers(picture),
            "centerline": picture.centerline,
            "pen_mm": picture.pen_mm,
            "tolerance": picture.tolerance or TOLERANCE,
        }
        if file.suffix.lower() == ".pdf":
            travel = save_pdf(file, shown.sketch, cameras, **how)
        else:
            faint = scene.surface is not None and scene.hiding.hidden == "faint"
            kept = [field for field in KEPT if field != "opacity" or not faint]
            travel = save_svg(file, shown.sketch, cameras, numbers=shown.numbers, kept=kept, **how)
        if travel is not None:
            say(travel.told("pixels" if picture.width_mm is None else "mm", picture.speed))
    else:
        views = torch.stack(list(_drawn(scene, cameras, picture, report)))
        save_png(file, tile_images(views))


def _check_styled(file: Path, picture: PictureOptions, style: str) -> None:
    """Sees that a style is asked for nothing that only plain strokes have.

    Raises:
        ValueError: it is.
    """
    if file.suffix.lower() == ".pdf":
        raise ValueError(f"{file}: --style draws to .svg, .png and films: give one of these, or leave --style out")
    for name in ("centerline", "tolerance", "engine"):
        if getattr(picture, name) != getattr(PictureOptions, name):
            raise ValueError(f"--{name} is for strokes without a style: leave it out, or --style {style}")


def _is_vector(file: Path) -> bool:
    return file.suffix.lower() in VECTORS


def _drawn(scene: _Scene, cameras: Cameras, picture: PictureOptions, report: Report) -> Iterator[Float[Tensor, "..."]]:
    """Each view as an RGB picture, or where the background is transparent straight RGBA."""
    for i, image in enumerate(_rendered(scene, cameras, picture)):
        yield image
        report(Progress("frames" if picture.turntable else "views", i + 1, len(cameras), None, 0))


def _rendered(scene: _Scene, cameras: Cameras, picture: PictureOptions) -> Iterator[Float[Tensor, "..."]]:
    """The views in the style, or as the kernels draw them, a few at once."""
    if scene.styling is not None:
        for i in range(len(cameras)):
            yield scene.styling.image(scene.strokes(cameras[i]).sketch, cameras[i], picture.color)
        return
    at_once = max(1, PIXELS_AT_ONCE // (cameras.size[0] * cameras.size[1]))
    for first in range(0, len(cameras), at_once):
        some = cameras[first : first + at_once]
        color = picture.color
        drawn = scene.render(some, torch.tensor(color or (0.0, 0.0, 0.0), dtype=scene.sketch.color.dtype))
        images = drawn.color
        if color is None:
            alpha = drawn.alpha[..., None]
            images = torch.cat([images / alpha.clamp(min=1e-6), alpha], -1)
        yield from images
