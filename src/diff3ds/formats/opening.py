"""What is seen to before a file of another format is begun, and what to do about formats that are not known."""

import importlib.util
from pathlib import Path

from diff3ds._units import Unit, check_unit
from diff3ds.sketch import Sketch

_TUBES = ".stl, .ply and .glb files hold the strokes as closed tubes: write one of these; slicers read it"
_EXACT = "write .step or .3dm, which hold the exact curves, and {}"
_PATHS = "write .pdf or .svg, which hold the same paths"
_PICTURE = "write .png, and convert it"
_SAVE_AS = "save it as {} in the program that made it"

# What a format that is not written has in common with one that is, by its suffixes.
_INSTEAD = {
    (".3mf", ".amf", ".off"): _TUBES,
    (
        ".gltf",
        ".fbx",
        ".dae",
        ".wrl",
        ".x3d",
        ".3ds",
    ): "write .glb, which is binary glTF: Blender and others convert it",
    (".abc", ".blend"): "write .usdc, or .py, which builds the sketch in Blender",
    (".brep", ".sat", ".sab", ".x_t", ".x_b"): _EXACT.format("convert it in a CAD program"),
    (".sldprt", ".ipt", ".catpart", ".prt", ".f3d", ".fcstd"): _EXACT.format("open it in that program"),
    (".skp",): "write .dxf with --dxf-polylines, or .glb, and import it",
    (".dwg", ".dwt", ".dgn"): "write .dxf, which CAD programs read and save as this",
    (".svgz",): "write .svg, and compress it by gzip",
    (".eps", ".ps", ".ai", ".emf", ".wmf", ".cdr"): f"{_PATHS}, and convert it, by Inkscape for one",
    (".hpgl", ".plt"): 'that is a view: "diff3ds render --page A4"',
    (".hpg", ".gcode", ".nc", ".ngc"): "write .hpgl or .svg with --centerline, by diff3ds render, or .dxf with "
    "--dxf-polylines, which programs of plotters and cutters read",
    (".gif", ".mp4", ".webp"): 'that is for turntables: "diff3ds render --turntable"',
    (".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".avif", ".heic", ".tga", ".exr"): _PICTURE,
}
# What to do with a file that is not read.
_BEFORE = {
    (".dwg", ".dwt", ".dgn", ".dxb"): _SAVE_AS.format(".dxf"),
    (".iges", ".igs", ".brep", ".brp"): '"diff3ds mesh" draws the solids in it; of curves alone save it as .step',
    (".sat", ".sab", ".x_t", ".x_b"): _SAVE_AS.format(".step"),
    (".sldprt", ".sldasm", ".ipt", ".iam", ".catpart", ".prt", ".f3d", ".fcstd"): _SAVE_AS.format(".step"),
    (".stl", ".3mf", ".off", ".ply", ".obj", ".glb", ".gltf"): '"diff3ds mesh" draws the lines of a mesh',
    (".svgz", ".pdf", ".eps", ".ai"): _SAVE_AS.format(".dxf"),
    (".abc", ".blend", ".fbx", ".skp"): _SAVE_AS.format(".usdc or .dxf"),
    (".png", ".jpg", ".jpeg", ".webp"): '"diff3ds image" makes a sketch of a picture',
}


def check_sketch(path: Path, sketch: Sketch, kind: str) -> None:
    """Sees that there is something to be written: the formats that need it say one sentence.

    Args:
        path: of the file, for messages.
        sketch: what is to be written.
        kind: of the file, such as "a DXF".

    Raises:
        ValueError: no strokes, or values that have become invalid since the sketch was made.
    """
    sketch.check_values()
    if len(sketch) == 0:
        raise ValueError(f"{path}: {kind} file needs at least one stroke, got none")


def check_writable(path: Path, sketch: Sketch, unit: Unit, kind: str, module: str, package: str, extra: str) -> None:
    """Sees that a sketch can be written by a library that comes with an extra.

    Args:
        path: of the file, for messages.
        sketch: what is to be written.
        unit: what a world unit is.
        kind: of the file, such as "DXF".
        module: that the library is imported as.
        package: that it is installed as.
        extra: that it comes with.

    Raises:
        ImportError: the library is not installed.
        ValueError: no strokes, a unit that is not known, or values that have become invalid since the sketch was made.
    """
    check_unit(unit)
    check_sketch(path, sketch, f"a {kind}")
    if importlib.util.find_spec(module) is None:
        raise ImportError(f"{path}: writing {kind} takes {package}: install it with pip install 'diff3ds[{extra}]'")


def instead_of(suffix: str) -> str:
    """What to write instead of a format that is not written, as the rest of a sentence; "" where there is none."""
    return _found(_INSTEAD, suffix)


def before_reading(suffix: str) -> str:
    """What to do with a file that is not read, as the rest of a sentence; "" where there is nothing."""
    return _found(_BEFORE, suffix)


def _found(table: dict[tuple[str, ...], str], suffix: str) -> str:
    return next((f": {what}" for suffixes, what in table.items() if suffix in suffixes), "")
