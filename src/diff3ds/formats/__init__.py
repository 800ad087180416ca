"""Sketches to files and back; the suffix of the name says which format."""

from collections.abc import Callable
from pathlib import Path

from diff3ds._files import check_there
from diff3ds._units import Unit, check_unit
from diff3ds.camera import Cameras
from diff3ds.formats.cad.dxf import load_dxf, save_dxf
from diff3ds.formats.cad.iges import save_iges
from diff3ds.formats.cad.rhino import load_3dm, save_3dm
from diff3ds.formats.cad.step import load_step, save_step
from diff3ds.formats.opening import before_reading, instead_of
from diff3ds.formats.png import load_image, save_png, tile_images
from diff3ds.formats.scenes.blender import save_blender
from diff3ds.formats.scenes.glb import save_glb
from diff3ds.formats.scenes.html import PageSurface, save_html
from diff3ds.formats.scenes.obj import save_obj
from diff3ds.formats.scenes.ply import save_ply
from diff3ds.formats.scenes.stl import save_stl
from diff3ds.formats.scenes.usd import load_usd, save_usd
from diff3ds.formats.sketch_json import load_json, save_json
from diff3ds.formats.vector.pdf import save_pdf
from diff3ds.formats.vector.svg import save_svg
from diff3ds.formats.vector.svg_strokes import load_svg
from diff3ds.render import render
from diff3ds.sketch import Sketch

__all__ = [
    "load",
    "load_3dm",
    "load_dxf",
    "load_image",
    "load_json",
    "load_step",
    "load_svg",
    "load_usd",
    "save",
    "save_3dm",
    "save_blender",
    "save_dxf",
    "save_glb",
    "save_html",
    "save_json",
    "save_obj",
    "save_pdf",
    "save_ply",
    "save_png",
    "save_step",
    "save_svg",
    "save_usd",
    "tile_images",
]

_GEOMETRY: dict[str, Callable[..., None]] = {
    ".json": save_json,
    ".step": save_step,
    ".stp": save_step,
    ".dxf": save_dxf,
    ".3dm": save_3dm,
    ".glb": save_glb,
    ".ply": save_ply,
    ".obj": save_obj,
    ".usd": save_usd,
    ".usda": save_usd,
    ".usdc": save_usd,
    ".usdz": save_usd,
    ".iges": save_iges,
    ".igs": save_iges,
    ".stl": save_stl,
    ".py": save_blender,
    ".html": save_html,
}
# Formats whose files say in which unit of length they are.
_WITH_UNITS = (".step", ".stp", ".iges", ".igs", ".dxf", ".3dm", ".glb", ".usd", ".usda", ".usdc", ".usdz", ".py")
# Those of scenes, in which a surface hides lines.
WITH_SURFACE = (".html", ".py")
PICTURES = (".svg", ".pdf", ".png")
_READERS = {
    ".json": load_json,
    ".step": load_step,
    ".stp": load_step,
    ".dxf": load_dxf,
    ".3dm": load_3dm,
    ".usd": load_usd,
    ".usda": load_usd,
    ".usdc": load_usd,
    ".usdz": load_usd,
    ".svg": load_svg,
}


def save(
    path: str | Path,
    sketch: Sketch,
    cameras: Cameras | None = None,
    *,
    unit: Unit | None = None,
    surface: PageSurface | None = None,
) -> None:
    """Writes a sketch, whole or not at all, in the format of the suffix: `ds.save`, which says more, takes a mesh.

    Args:
        surface: what hides lines on a `.html` page, or in Blender.

    Raises:
        TypeError, ValueError, ImportError, OSError: as `ds.save`.
    """
    path = Path(path)
    if not isinstance(sketch, Sketch):
        raise TypeError(f"save writes a Sketch, got {type(sketch).__name__}")
    sketch.check_values()
    suffix = path.suffix.lower()
    if unit is not None:
        check_unit(unit)
        if suffix in (*_GEOMETRY, *PICTURES) and suffix not in _WITH_UNITS:
            raise ValueError(f"{path}: a {suffix} file says no unit of length: scale the sketch instead")
    if surface is not None and suffix not in WITH_SURFACE:
        raise ValueError(f"{path}: a surface goes into .html and .py files: leave it out, or draw with it by ds.render")
    if suffix == ".py":
        save_blender(path, sketch, unit=unit, surface=surface)
    elif surface is not None:
        save_html(path, sketch, surface=surface)
    elif suffix in _WITH_UNITS and unit is not None:
        _GEOMETRY[suffix](path, sketch, unit=unit)
    elif suffix in _GEOMETRY:
        _GEOMETRY[suffix](path, sketch)
    elif suffix not in PICTURES:
        known = ", ".join([*_GEOMETRY, *PICTURES])
        raise ValueError(f"{path}: cannot save as {suffix!r}, only as {known}{instead_of(suffix)}")
    elif not isinstance(cameras, Cameras):
        raise ValueError(f"{path}: a picture needs cameras=Cameras, got {type(cameras).__name__}: try ds.orbit(30, 20)")
    elif suffix == ".svg":
        save_svg(path, sketch, cameras)
    elif suffix == ".pdf":
        save_pdf(path, sketch, cameras)
    else:
        save_png(path, tile_images(render(sketch.detach(), cameras).color))


def load(path: str | Path) -> Sketch:
    """Reads a sketch from a `.json`, `.step`, `.stp`, `.dxf`, `.3dm`, `.usd`, `.usda`, `.usdc`, `.usdz` or `.svg` file.

    Of the folder of a run it reads the sketch.json in it.

    STEP, DXF and 3DM need the extra `cad` (see `load_step`, `load_dxf`, `load_3dm`), USD the extra `usd` (`load_usd`).
    Of an SVG drawing its strokes are read, flat, in its own pixels (`load_svg`); `ds.sheet` sees it as it is drawn.

    Raises:
        ValueError: another suffix; not such a file, or a broken, too large or unsupported one; a folder without
            sketch.json.
        OSError: the file cannot be read.
        ImportError: the extra that reads this format is not installed.
    """
    path = Path(path)
    wanted = "the folder of a run, or a file with a sketch"
    if path.is_dir():
        path /= "sketch.json"
        if not path.is_file():
            raise ValueError(f"{path.parent} has no sketch.json: give the folder of a run, or a file with a sketch")
    suffix = path.suffix.lower()
    reader = _READERS.get(suffix)
    if not suffix:
        check_there(path, wanted)
    if reader is None:
        raise ValueError(f"{path}: cannot load {suffix!r}, only {', '.join(_READERS)}{before_reading(suffix)}")
    check_there(path, wanted)
    return reader(path)
