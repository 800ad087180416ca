"""What to do about formats that are not written or read: the nearest one that is."""

_TUBES = ".ply and .glb files hold the strokes as closed tubes: write one of these, and {}"
_MESHES = "slicers and mesh programs read it and save it as {}"
_EXACT = "write .step or .3dm, which hold the exact curves, and {}"
_PATHS = "write .pdf or .svg, which hold the same paths"
_PICTURE = "write .png, and convert it"
_SAVE_AS = "save it as {} in the program that made it"

# What a format that is not written has in common with one that is, by its suffixes.
_INSTEAD = {
    (".stl", ".3mf", ".amf", ".off"): _TUBES.format(_MESHES.format("this")),
    (
        ".gltf",
        ".fbx",
        ".dae",
        ".wrl",
        ".x3d",
        ".3ds",
    ): "write .glb, which is binary glTF: Blender and others convert it",
    (".usdz",): "write .usdc and pack it: usdzip a.usdz a.usdc. Viewers that show no curves show the tubes of .glb",
    (".abc", ".blend"): "write .usdc, or .py, which builds the sketch in Blender",
    (".iges", ".igs", ".brep", ".sat", ".sab", ".x_t", ".x_b"): _EXACT.format("convert it in a CAD program"),
    (".sldprt", ".ipt", ".catpart", ".prt", ".f3d", ".fcstd"): _EXACT.format("open it in that program"),
    (".skp",): "write .dxf with --dxf-polylines, or .glb, and import it",
    (".dwg", ".dwt", ".dgn"): "write .dxf, which CAD programs read and save as this",
    (".svgz",): "write .svg, and compress it by gzip",
    (".eps", ".ps", ".ai", ".emf", ".wmf", ".cdr"): f"{_PATHS}, and convert it, by Inkscape for one",
    (".hpgl", ".hpg", ".plt", ".gcode", ".nc", ".ngc"): "write .svg with --centerline or .dxf with --dxf-polylines, "
    "which programs of plotters and cutters read",
    (".gif", ".mp4", ".webp"): 'that is for turntables: "diff3ds render --turntable"',
    (".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".avif", ".heic", ".tga", ".exr"): _PICTURE,
}
# What to do with a file that is not read.
_BEFORE = {
    (".dwg", ".dwt", ".dgn", ".dxb"): _SAVE_AS.format(".dxf"),
    (".iges", ".igs", ".brep", ".sat", ".sab", ".x_t", ".x_b"): _SAVE_AS.format(".step"),
    (".sldprt", ".sldasm", ".ipt", ".iam", ".catpart", ".prt", ".f3d", ".fcstd"): _SAVE_AS.format(".step"),
    (".stl", ".3mf", ".off", ".ply", ".obj", ".glb", ".gltf"): '"diff3ds mesh" draws the lines of a mesh',
    (".svgz", ".svg", ".pdf", ".eps", ".ai"): _SAVE_AS.format(".dxf"),
    (".abc", ".blend", ".fbx", ".skp"): _SAVE_AS.format(".usdc or .dxf"),
    (".png", ".jpg", ".jpeg", ".webp"): '"diff3ds image" makes a sketch of a picture',
}


def instead_of(suffix: str) -> str:
    """What to write instead of a format that is not written, as the rest of a sentence; "" where there is none."""
    return _found(_INSTEAD, suffix)


def before_reading(suffix: str) -> str:
    """What to do with a file that is not read, as the rest of a sentence; "" where there is nothing."""
    return _found(_BEFORE, suffix)


def _found(table: dict[tuple[str, ...], str], suffix: str) -> str:
    return next((f": {what}" for suffixes, what in table.items() if suffix in suffixes), "")
