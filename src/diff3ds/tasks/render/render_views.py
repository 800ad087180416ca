"""Pictures of a sketch: the views that are asked for, a sheet of them, or a turntable."""

import warnings
from collections.abc import Callable
from pathlib import Path

from diff3ds.camera import Cameras
from diff3ds.formats.framing import framed
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.load_surface import load_surface
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.detail_options import WHOLE, DetailOptions
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.render.blender_engine import draw_in_blender
from diff3ds.tasks.render.drawn_scene import Scene
from diff3ds.tasks.render.page_options import NO_PAGE, PageOptions
from diff3ds.tasks.render.render_options import (
    IN_SPACE,
    PLOTTED,
    OrbitOptions,
    PictureOptions,
    SurfaceOptions,
    check_file,
    parse_size,
)
from diff3ds.tasks.render.view_files import save_film, save_in_space, save_views
from diff3ds.tasks.results import SURFACE
from diff3ds.tasks.sketch_input import at_level, load_sketch
from diff3ds.tasks.style_options import StyleOptions
from diff3ds.tasks.styling import Styling
from diff3ds.transforms import load_transforms


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
    page: PageOptions = NO_PAGE,
) -> list[Path]:
    """Draws the sketch of a file, or of the folder of a run; says how far a pen goes that draws it.

    Returns:
        The files that were written: of several views that make no sheet, one a view, numbered from 1, but of PDF one
        with a page for each.

    Raises:
        ValueError, OSError, ImportError: as `load_sketch`, `load_surface`, `load_transforms`, `check_file` and
            `draw_in_blender`; a turntable of cameras that a file gives; a surface in what cannot have one.
    """
    check_file(file, picture, page)
    if picture.turntable is not None and (view.cameras is not None or len(view.azimuth) > 1):
        raise ValueError("a turntable goes once round from one --azimuth: give no --cameras, and one number")
    if hiding.hides and picture.engine == "blender":
        raise ValueError("a --surface hides lines in pictures by the kernels and in files of paths: leave --engine out")
    suffix = file.suffix.lower()
    if suffix in (".dxf", *PLOTTED) and (styles.style is not None or picture.background is not None):
        raise ValueError(f"{file}: a {suffix} file has lines alone: leave --style and --background out, or write .pdf")
    if styles.style is not None:
        _check_styled(picture, styles.style)
    if file.suffix.lower() in IN_SPACE and styles.style is not None:
        raise ValueError(f"{file}: strokes in space have no style: leave --style out, or write .svg")
    if file.suffix.lower() == ".py" and (len(view.azimuth) > 1 or view.height is not None or view.cameras is not None):
        raise ValueError(f"{file}: Blender gets one perspective view: give one --azimuth, no --height and no --cameras")
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
    styling = None if styles.style is None else Styling(styles)
    scene = Scene(drawn, numbers, surface, hiding, styling, picture, page)
    if file.suffix.lower() == ".py" or (file.suffix.lower() == ".json" and len(cameras) == 1):
        save_in_space(file, scene, cameras, view.fov)
        return [file]
    if picture.turntable is not None:
        save_film(file, scene, cameras, report)
        return [file]
    if picture.sheet or len(cameras) == 1 or file.suffix.lower() == ".pdf":
        save_views(file, scene, cameras, report, say)
        return [file]
    digits = len(str(len(cameras)))
    files = [file.with_stem(f"{file.stem}-{i + 1:0{digits}}") for i in range(len(cameras))]
    for i, name in enumerate(files):
        if file.suffix.lower() == ".json":
            save_in_space(name, scene, cameras[i], view.fov)
        else:
            save_views(name, scene, cameras[i], lambda _: None, say)
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


def _check_styled(picture: PictureOptions, style: str) -> None:
    """Sees that a style is asked for nothing that only plain strokes have.

    Raises:
        ValueError: it is.
    """
    for name in ("centerline", "tolerance", "engine"):
        if getattr(picture, name) != getattr(PictureOptions, name):
            raise ValueError(f"--{name} is for strokes without a style: leave it out, or --style {style}")
