"""The points that photogrammetry finds with cameras, as a PLY file that a transforms.json names (ply_file_path)."""

from pathlib import Path

import numpy as np
import torch

from diff3ds._files import write_bytes
from diff3ds._shapes import Float, Tensor

# More is taken for a mistake: 10 million points with colours and normals take 400 MB.
MAX_BYTES = 1 << 30
LONGEST_HEADER = 1 << 16
# Of PLY's types, by both of their names.
TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


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
        ValueError: not a PLY file, a damaged one, or one that does not begin with vertices.
        OSError: the file cannot be read.
    """
    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: {path.stat().st_size} bytes are more than the {MAX_BYTES} that are read")
    content = path.read_bytes()
    end = content.find(b"end_header\n", 0, LONGEST_HEADER)
    if not content.startswith(b"ply") or end < 0:
        raise ValueError(f"{path}: not a PLY file")
    order, count, kinds = _header(path, content[:end].decode("latin-1"))
    body = content[end + len(b"end_header\n") :]
    points = _ascii(path, body, count, kinds) if not order else _binary(path, body, count, kinds, order)
    found = torch.from_numpy(points)
    return found[found.isfinite().all(1)]


def _header(path: Path, text: str) -> tuple[str, int, list[tuple[str, str]]]:
    """The order of bytes ("" for text), and number and properties of the vertices."""
    lines = [words for line in text.splitlines() if (words := line.split()) and words[0] not in ("comment", "obj_info")]
    elements = [i for i, words in enumerate(lines) if words[0] == "element"]
    if len(lines) < 3 or lines[1][0] != "format" or not set(lines[1][1:2]) & set(FORMATS):
        raise ValueError(f"{path}: a PLY file of no format that is known")
    first = lines[elements[0]] if elements else []
    if len(first) != 3 or first[1] != "vertex" or not first[2].isdigit():
        raise ValueError(f"{path}: a PLY file must begin with its vertices")
    own = lines[elements[0] + 1 : elements[1] if len(elements) > 1 else len(lines)]
    kinds = [(words[-1], TYPES.get(words[1], "")) for words in own if len(words) == 3 and words[0] == "property"]
    if len(kinds) != len(own) or not all(kind for _, kind in kinds) or not {"x", "y", "z"} <= {n for n, _ in kinds}:
        raise ValueError(f"{path}: its vertices must have x, y and z, and nothing but numbers")
    return FORMATS[lines[1][1]], int(first[2]), kinds


def _binary(path: Path, body: bytes, count: int, kinds: list[tuple[str, str]], order: str) -> np.ndarray:
    row = np.dtype([(f"{i} {name}", order + kind) for i, (name, kind) in enumerate(kinds)])
    if count * row.itemsize > len(body):
        raise ValueError(f"{path}: damaged, it ends before its {count} vertices")
    names = [name for name, _ in kinds]
    table = np.frombuffer(body, row, count)
    return np.stack([table[f"{names.index(axis)} {axis}"].astype(np.float64) for axis in "xyz"], 1)


def _ascii(path: Path, body: bytes, count: int, kinds: list[tuple[str, str]]) -> np.ndarray:
    names = [name for name, _ in kinds]
    lines = body.decode("latin-1").split("\n")[:count]
    try:
        rows = [[float(line.split()[names.index(axis)]) for axis in "xyz"] for line in lines]
    except (ValueError, IndexError) as error:
        raise ValueError(f"{path}: damaged, a vertex is not {len(kinds)} numbers") from error
    if len(rows) < count:
        raise ValueError(f"{path}: damaged, it ends before its {count} vertices")
    return np.array(rows, np.float64).reshape(-1, 3)
