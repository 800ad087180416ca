"""A sketch in one file to another format, in the unit, the size and the frame that another program wants."""

from pathlib import Path

import torch

from diff3ds._files import write_text
from diff3ds.formats import PICTURES, save, save_dxf, save_glb, save_html
from diff3ds.sketch import Sketch
from diff3ds.tasks.export.options import ExportOptions
from diff3ds.tasks.render.options import PictureOptions, ViewOptions
from diff3ds.tasks.render.render_views import views_of
from diff3ds.tasks.sketch_input import load_sketch, name_of
from diff3ds.tasks.style_options import StyleOptions
from diff3ds.tasks.styling import Styling


def run_export(source: Path, file: Path, options: ExportOptions, styles: StyleOptions) -> Sketch:
    """Writes the sketch of a file, or of the folder of a run, in the format of the suffix of `file`.

    In a style it is a drawing of the view that `diff3ds render` takes by itself.

    Returns:
        The sketch as it was written.

    Raises:
        ValueError, OSError, ImportError: as `load_sketch`, `save` and `Styling`; a suffix of pictures without a
            style, or another one with one.
    """
    if styles.style is not None and file.suffix.lower() != ".svg":
        raise ValueError(f"{file}: --style draws .svg files here, and pictures by diff3ds render")
    if styles.style is None and file.suffix.lower() in PICTURES:
        raise ValueError(f'{file}: a picture is drawn by "diff3ds render {source} -o {file}", which asks for the view')
    if options.dxf_polylines and file.suffix.lower() != ".dxf":
        raise ValueError(f"{file}: --dxf-polylines is for .dxf files")
    if options.lines and file.suffix.lower() != ".glb":
        raise ValueError(f"{file}: --lines is for .glb files")
    if options.up == "y" and file.suffix.lower() == ".glb":
        raise ValueError(f"{file}: GLB files have y up by themselves: leave --up out")
    if options.up == "y" and file.suffix.lower() == ".html":
        raise ValueError(f"{file}: pages show sketches with z up: leave --up out")
    if options.beside is not None and file.suffix.lower() != ".html":
        raise ValueError(f"{file}: --beside is for .html files")
    sketch = _placed(load_sketch(source), options)
    if styles.style is not None:
        write_text(file, Styling(styles).svg(sketch, views_of(sketch, ViewOptions(), PictureOptions())))
    elif options.beside is not None:
        if options.unit is not None:
            raise ValueError(f"{file}: a .html file says no unit of length: leave --unit out")
        save_html(file, sketch, (name_of(options.beside), _placed(load_sketch(options.beside), options)))
    elif options.dxf_polylines:
        save_dxf(file, sketch, unit=options.unit or "mm", polylines=True)
    elif options.lines:
        save_glb(file, sketch, unit=options.unit or "m", lines=True)
    else:
        save(file, sketch, unit=options.unit)
    return sketch


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
