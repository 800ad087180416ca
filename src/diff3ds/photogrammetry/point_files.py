"""The points that photogrammetry finds with cameras, as a PLY file that a transforms.json names (ply_file_path)."""

from pathlib import Path

import numpy as np
import torch

from diff3ds._files import write_bytes
from diff3ds._shapes import Float, Tensor
from diff3ds.formats.mesh_files.read_ply import ply_columns
from diff3ds.photogrammetry.shot import finite_points

# More is taken for a mistake: 10 million points with colours and normals take 400 MB.
MAX_BYTES = 1 << 30


def save_points(path: Path, points: Float[Tensor, "P 3"]) -> None:
    """Writes points without colours, float64.

    Raises:
        OSError: the file cannot be written.
    """
    header = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{}end_header\n"
    properties = "".join(f"property double {axis}\n" for axis in "xyz")
    content = points.double().numpy().astype("<f8").tobytes()
    write_bytes(path, header.format(len(points), properties).encode() + content)


def load_points(path: Path) -> Float[Tensor, "P 3"]:
    """The places of the vertices of a PLY file, float64, those that are finite.

    Raises:
        ValueError: not a PLY file, a damaged one, or one whose vertices have no x, y and z.
        OSError: the file cannot be read.
    """
    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: {path.stat().st_size} bytes are more than the {MAX_BYTES} that are read")
    try:
        columns = ply_columns(path.read_bytes())[0]
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    if not {"x", "y", "z"} <= columns.keys():
        raise ValueError(f"{path}: its vertices must have x, y and z")
    return finite_points(torch.from_numpy(np.stack([columns[axis] for axis in "xyz"], 1)))
