"""PLY files (binary): strokes as tubes (`tubes.py`), one mesh with the strokes' colours at its vertices; z up."""

from pathlib import Path

import numpy as np

from diff3ds._files import write_bytes
from diff3ds.formats.opening import check_sketch
from diff3ds.formats.scenes.tubes import tubes_of
from diff3ds.sketch import Sketch

_HEADER = """ply
format binary_little_endian 1.0
element vertex {vertices}
property double x
property double y
property double z
property float nx
property float ny
property float nz
property uchar red
property uchar green
property uchar blue
property uchar alpha
element face {faces}
property list uchar int vertex_indices
end_header
"""
_VERTEX = np.dtype([("place", "<f8", 3), ("normal", "<f4", 3), ("color", "u1", 4)])
_FACE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def save_ply(path: str | Path, sketch: Sketch) -> None:
    """Writes a PLY file, whole or not at all; alpha is the opacity.

    Raises:
        ValueError: no strokes, none with a width, or values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_sketch(path, sketch, "a PLY")
    tubes = tubes_of(sketch)
    counts = [len(tube.vertices) for tube in tubes]
    if not sum(counts):
        raise ValueError(f"{path}: a PLY file needs at least one stroke with a width, got none of {len(sketch)}")
    looks = np.concatenate([sketch.color.detach().cpu().double(), sketch.opacity.detach().cpu().double()[:, None]], 1)
    vertices = np.zeros(sum(counts), _VERTEX)
    vertices["place"] = np.concatenate([tube.vertices for tube in tubes])
    vertices["normal"] = np.concatenate([tube.normals for tube in tubes])
    vertices["color"] = (looks.clip(0, 1) * 255).round().repeat(counts, 0)
    offsets = np.cumsum([0, *counts[:-1]])
    indices = np.concatenate([tube.faces + offset for tube, offset in zip(tubes, offsets, strict=True)])
    faces = np.zeros(len(indices), _FACE)
    faces["count"], faces["vertices"] = 3, indices
    header = _HEADER.format(vertices=len(vertices), faces=len(faces)).encode()
    write_bytes(path, header + vertices.tobytes() + faces.tobytes())
