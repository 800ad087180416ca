"""Views of a scene in files of drawings and pictures, and as strokes in space."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import write_bytes, write_text
from diff3ds.camera import Cameras
from diff3ds.formats import save_dxf, save_json, save_pdf, save_png, save_svg, tile_images
from diff3ds.formats.cad.layers import flat_layers
from diff3ds.formats.movie import save_movie
from diff3ds.formats.scenes.blender import FRAMES, blender_script
from diff3ds.formats.vector.hpgl import save_hpgl
from diff3ds.formats.vector.pdf import pdf_of
from diff3ds.page.drawn_paths import TOLERANCE, ink_boxes
from diff3ds.page.flat_strokes import flat_strokes
from diff3ds.page.sheet.page_layout import lay_out
from diff3ds.sketch import Sketch
from diff3ds.styles.styled_svg import Styled
from diff3ds.svg.path_ids import KEPT
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.render.drawn_scene import Scene, Shown
from diff3ds.tasks.render.page_pictures import Image
from diff3ds.tasks.render.render_options import PLOTTED

# Millimetres on paper by which lines and arcs, and polylines, of a flat file may be off: less than any machine draws.
CURVE_MM, POLYLINE_MM = 1e-4, 5e-3


def save_film(file: Path, scene: Scene, cameras: Cameras, report: Report) -> None:
    """A film of all views."""
    save_movie(file, _told(scene.images(cameras), "frames", len(cameras), report), len(cameras), scene.picture.fps)


def save_in_space(file: Path, scene: Scene, cameras: Cameras, fov: float) -> None:
    """The strokes of a view as it shows them, those that are hidden said to be; in Blender all of a turn, a frame each.

    Args:
        file: a sketch.json, or a script for Blender.
        scene: what is drawn.
        cameras: one view, or those of the turntable.
        fov: of Blender's camera, degrees.
    """
    shown, picture = scene.shown(cameras, alone=True), scene.picture
    if file.suffix.lower() == ".json":
        (view,) = shown
        save_json(file, view.sketch.replace(kinds=view.told()))
        return
    by = picture.layers or ("thing", "kind", *(() if scene.surface is None else ("visibility",)))
    views = [(each.sketch, each.layers(by) or []) for each in shown]
    frames = picture.turntable or FRAMES
    turning = views if picture.turntable else None
    sketch, layers = (scene.sketch, None) if turning else views[0]
    pencil = blender_script(
        sketch, cameras, fov, frames, picture.fps, strokes="grease-pencil", layers=layers, views=turning
    )
    write_text(file, pencil)


def save_views(file: Path, scene: Scene, cameras: Cameras, report: Report, say: Callable[[str], None]) -> None:
    """One file of one view, of a sheet of several, or with a page for each; says how far a pen goes that draws it."""
    suffix, page, picture = file.suffix.lower(), scene.page.setup, scene.picture
    if suffix == ".png" and page is not None:
        save_png(file, scene.sheet(cameras, page), pixels_per_mm=scene.page.pixels_per_mm)
        return
    if suffix == ".png":
        images = _told(scene.images(cameras), "views", len(cameras), report)
        save_png(file, tile_images(torch.stack(list(images))))
        return
    alone = suffix == ".pdf" and not picture.sheet
    shown = scene.shown(cameras, alone)
    sketches, numbers = [each.sketch for each in shown], [each.numbers for each in shown]
    layers = [named for each in shown if (named := each.layers(picture.layers)) is not None] or None
    if suffix == ".dxf":
        _save_flat(file, scene, shown, cameras)
        return
    if scene.styling is not None:
        drawing = scene.styling.drawn(sketches, cameras, picture.color, page, alone, layers, numbers)
        _save_styled(file, drawing, alone)
        return
    how: dict[str, Any] = {"layers": layers, "pen_mm": picture.pen_mm, "tolerance": picture.tolerance or TOLERANCE}
    told: dict[str, Any] = {"background": picture.color, "page": page, "centerline": picture.centerline}
    if suffix in PLOTTED:
        assert page is not None
        travel = save_hpgl(file, sketches, cameras, page, **how)
    elif suffix == ".pdf":
        travel = save_pdf(file, sketches, cameras, alone=alone, **how, **told)
    else:
        faint = scene.surface is not None and scene.hiding.hidden == "faint"
        kept = [field for field in KEPT if field != "opacity" or not faint]
        dashes = [each.dashes for each in shown if each.dashes is not None] or None
        travel = save_svg(file, sketches, cameras, numbers=numbers, kept=kept, dashes=dashes, **how, **told)
    if travel is not None:
        say(travel.told("pixels" if page is None else "mm", picture.speed))


def _save_flat(file: Path, scene: Scene, shown: list[Shown], cameras: Cameras) -> None:
    """The views as flat drawings in millimetres, hidden lines on layers of their own."""
    picture, page = scene.picture, scene.page.setup
    # A drawing of lines alone has no widths that could reach beyond them.
    lines = [each.sketch.replace(width=0.0) for each in shown]
    layout = lay_out(cameras, page, ink_boxes(lines, centerline=True))
    flat = flat_strokes(lines, layout)
    polylines = picture.dxf_polylines or picture.dxf_version == "R12"
    by = picture.layers or (() if scene.surface is None else ("visibility",))
    named = [each.layers(by) for each in shown]
    layers = [groups[row] for groups, (_, rows) in zip(named, flat, strict=True) if groups is not None for row in rows]
    save_dxf(
        file,
        Sketch.concatenate([each.sketch for each in flat]),
        layers=flat_layers(layers) if by else None,
        polylines=polylines,
        version=picture.dxf_version,
        tolerance=POLYLINE_MM if polylines else CURVE_MM,
    )


def _save_styled(file: Path, drawing: Styled, alone: bool) -> None:
    if file.suffix.lower() == ".svg":
        write_text(file, drawing.svg())
        return
    ground = [fibres.drawn() for fibres in drawing.fibres]
    write_bytes(file, pdf_of(drawing.layout, drawing.drawn(), drawing.background, alone=alone, ground=ground))


def _told(images: Iterator[Image], what: str, count: int, report: Report) -> Iterator[Image]:
    """The pictures, each of which is told of."""
    for i, image in enumerate(images):
        yield image
        report(Progress(what, i + 1, count, None, 0))
