"""STL files for printers of things: strokes as tubes (`tubes.py`), binary, in the sketch's own unit and frame."""

from pathlib import Path

import numpy as np

from diff3ds._files import write_bytes
from diff3ds.formats.opening import check_sketch
from diff3ds.formats.scenes.tubes import tubes_of
from diff3ds.sketch import Sketch

# A triangle: its normal, its corners, and two bytes without a meaning.
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("free", "<u2")])


def save_stl(path: str | Path, sketch: Sketch) -> None:
    """Writes a binary STL file, whole or not at all: each stroke is closed, and where strokes meet they overlap.

    The format knows neither units, which printers take for millimetres, nor colours.

    Raises:
        ValueError: no strokes, none with a width, or values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_sketch(path, sketch, "an STL")
    corners = np.concatenate([tube.vertices[tube.faces] for tube in tubes_of(sketch)])
    if not len(corners):
        raise ValueError(f"{path}: an STL file needs at least one stroke with a width, got none of {len(sketch)}")
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    triangles = np.zeros(len(corners), _TRIANGLE)
    triangles["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    triangles["corners"] = corners
    # Files that begin with "solid" are taken for texts.
    head = b"diff3ds".ljust(80, b"\0")
    write_bytes(path, head + np.uint32(len(triangles)).astype("<u4").tobytes() + triangles.tobytes())
