"""A sketch in one file to another format, in the unit, the size and the frame that another program wants."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import write_text
from diff3ds.formats import PICTURES, WITH_SURFACE, save, save_3dm, save_blender, save_dxf, save_glb, save_step
from diff3ds.formats.cad.iges import save_iges
from diff3ds.formats.cad.layers import flat_layers
from diff3ds.formats.scenes.html import sketch_page
from diff3ds.formats.scenes.usd import save_usd
from diff3ds.sketch import Sketch
from diff3ds.surfaces.on_page import SurfaceOnPage
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.detail_options import WHOLE, DetailOptions
from diff3ds.tasks.export.export_options import ExportOptions
from diff3ds.tasks.render.render_options import OrbitOptions, PictureOptions
from diff3ds.tasks.render.render_views import views_of
from diff3ds.tasks.render.stroke_layers import layers_by
from diff3ds.tasks.sketch_input import at_level, load_sketch, name_of
from diff3ds.tasks.style_options import StyleOptions
from diff3ds.tasks.styling import Styling
from diff3ds.tasks.surface_input import SurfaceInput

USD = (".usd", ".usda", ".usdc", ".usdz")
# Formats that tell lines and arcs from other curves, and those that have layers.
WITH_TOLERANCE = (".step", ".stp", ".iges", ".igs", ".dxf", ".3dm")
WITH_LAYERS = (".step", ".stp", ".dxf", ".3dm", ".glb", *USD, ".py")


def run_export(
    source: Path,
    file: Path,
    options: ExportOptions,
    styles: StyleOptions,
    say: Callable[[str], None] = lambda line: None,
    level: DetailOptions = WHOLE,
) -> Sketch:
    """Writes the sketch of a file, or of the folder of a run, in the format of the suffix of `file`.

    In a style it is a drawing of the view that `diff3ds render` takes by itself. What hides lines goes on pages too.

    Args:
        source: where the sketch is.
        file: what is written.
        options: how.
        styles: of a drawing.
        level: which strokes.
        say: told what is wrong with the surface of a run, whose page then has none.

    Returns:
        The sketch as it was written.

    Raises:
        ValueError, OSError, ImportError: as `load_sketch`, `load_surface`, `save` and `Styling`; a suffix of pictures
            without a style, or another one with one.
    """
    _check(source, file, options, styles)
    whole = _placed(load_sketch(source), options)
    sketch = at_level(whole, level).sketch
    if styles.style is not None:
        write_text(file, Styling(styles).drawn(sketch, views_of(whole, OrbitOptions(), PictureOptions())).svg())
    elif file.suffix.lower() == ".html":
        write_text(file, _page(source, file, sketch, options, say))
    elif file.suffix.lower() == ".py":
        surface = _solid(SurfaceInput(source, options.surface, options.surface_up, say), options)
        layers = layers_by(sketch, options.layers)
        save_blender(file, sketch, strokes=options.built, unit=options.unit, layers=layers, surface=surface)
    else:
        _save(file, sketch, options)
    return sketch


def _save(file: Path, sketch: Sketch, options: ExportOptions) -> None:
    """Writes a sketch in a format that needs no view."""
    suffix, unit = file.suffix.lower(), options.unit
    layers, tolerance = layers_by(sketch, options.layers), options.tolerance
    if suffix == ".dxf":
        how: dict[str, Any] = {"polylines": options.dxf_polylines, "version": options.dxf_version}
        save_dxf(file, sketch, unit=unit or "mm", tolerance=tolerance, layers=flat_layers(layers), **how)
    elif suffix == ".3dm":
        save_3dm(file, sketch, unit=unit or "mm", tolerance=tolerance, layers=layers)
    elif suffix in (".step", ".stp"):
        save_step(file, sketch, unit=unit or "mm", tolerance=tolerance, layers=flat_layers(layers))
    elif suffix in (".iges", ".igs"):
        save_iges(file, sketch, unit=unit or "mm", tolerance=tolerance)
    elif suffix == ".glb":
        save_glb(file, sketch, unit=unit or "m", lines=options.lines, layers=layers)
    elif suffix in USD:
        save_usd(file, sketch, unit=unit or "m", layers=layers)
    else:
        save(file, sketch, unit=unit)


def _check(source: Path, file: Path, options: ExportOptions, styles: StyleOptions) -> None:
    """Sees that the format of a file takes the options.

    Raises:
        ValueError: it does not.
    """
    if styles.style is not None and file.suffix.lower() != ".svg":
        drawn = f"diff3ds render {source} -o {file} --style {styles.style}" if file.suffix.lower() in PICTURES else ""
        said = f'draw it by "{drawn}"' if drawn else "leave --style out, or write .svg"
        raise ValueError(f"{file}: --style draws .svg files here: {said}")
    if styles.style is None and file.suffix.lower() in PICTURES:
        raise ValueError(f'{file}: a picture is drawn by "diff3ds render {source} -o {file}", which asks for the view')
    for name in ("dxf_polylines", "dxf_version"):
        if getattr(options, name) != getattr(ExportOptions, name) and file.suffix.lower() != ".dxf":
            raise ValueError(f"{file}: --{name.replace('_', '-')} is for .dxf files")
    if options.tolerance is not None and file.suffix.lower() not in WITH_TOLERANCE:
        raise ValueError(f"{file}: --tolerance is for {', '.join(WITH_TOLERANCE)} files")
    if options.layers and file.suffix.lower() not in WITH_LAYERS:
        raise ValueError(f"{file}: --layers is for {', '.join(WITH_LAYERS)} files, and for drawings by diff3ds render")
    if options.built != "curves" and file.suffix.lower() != ".py":
        raise ValueError(f"{file}: --as is for .py files, which build the sketch in Blender")
    if options.lines and file.suffix.lower() != ".glb":
        raise ValueError(f"{file}: --lines is for .glb files")
    if options.up == "y" and file.suffix.lower() == ".glb":
        raise ValueError(f"{file}: GLB files have y up by themselves: leave --up out")
    if options.up == "y" and file.suffix.lower() == ".html":
        raise ValueError(f"{file}: pages show sketches with z up: leave --up out")
    if options.unit is not None and file.suffix.lower() == ".html":
        raise ValueError(f"{file}: a .html file says no unit of length: leave --unit out")
    for name, suffixes in {"beside": (".html",), "surface": WITH_SURFACE}.items():
        if getattr(options, name) is not None and file.suffix.lower() not in suffixes:
            raise ValueError(f"{file}: --{name} is for {' and '.join(suffixes)} files")


def _page(source: Path, file: Path, sketch: Sketch, options: ExportOptions, say: Callable[[str], None]) -> str:
    """The page of a sketch, with what hides its lines, and with another one beside it."""
    surface = _solid(SurfaceInput(source, options.surface, options.surface_up, say), options)
    if options.beside is None:
        return sketch_page(file.stem, sketch, surface=surface)
    other = _placed(load_sketch(options.beside), options)
    behind = _solid(SurfaceInput(options.beside, None, "z", say), options)
    beside = (name_of(options.beside), other)
    return sketch_page(file.stem, sketch, beside=beside, surface=surface, surface_beside=behind)


def _solid(given: SurfaceInput, options: ExportOptions) -> SurfaceOnPage | None:
    """A surface in the size that the sketch gets."""
    _, mesh = given.now()
    if mesh is not None and options.scale != 1:
        mesh = TriangleMesh(mesh.vertices * options.scale, mesh.faces, mesh.part, mesh.crease, mesh.polygon)
    return SurfaceOnPage.of(mesh)


def _placed(sketch: Sketch, options: ExportOptions) -> Sketch:
    if options.scale == 1 and options.up == "z":
        return sketch
    return sketch.transform(_placement(options).to(sketch.points))


def _placement(options: ExportOptions) -> torch.Tensor:
    """The similarity from the sketch to the file: (x, y, z) with z up is (x, z, -y) with y up."""
    matrix = torch.eye(4, dtype=torch.float64)
    if options.up == "y":
        matrix[:3, :3] = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    matrix[:3] *= options.scale
    return matrix
