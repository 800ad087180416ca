"""Mesh files with one feature each, for the tables of docs/reference/formats-read.md."""

from pathlib import Path

import numpy as np
from read_example import Example

from diff3ds.formats.mesh import MeshFile, read_mesh


def read(path: Path) -> MeshFile:
    return read_mesh(path)


def text(name: str, content: str):
    """Writes a text file."""

    def make(folder: Path) -> Path:
        (folder / name).write_text(content)
        return folder / name

    return make


def area(found: MeshFile) -> float:
    a, b, c = found.vertices[found.faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


SQUARE = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n"
EXAMPLES = {
    "Wavefront OBJ: `.obj`": {
        "faces of three and four corners": Example(
            text("a.obj", SQUARE + "v 4 0 0\nf 1 2 3 4\nf 2 5 3\n"), lambda found: area(found) == 6
        ),
        "indices that count backwards": Example(
            text("a.obj", SQUARE + "f -4 -3 -2 -1\n"), lambda found: area(found) == 4
        ),
    },
}
