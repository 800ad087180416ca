"""Clouds of points from files, with normals where there are some: PLY, XYZ and other texts, NPY, PCD, LAS and LAZ."""

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError

import numpy as np

from diff3ds._files import check_there
from diff3ds._shapes import Array, Float
from diff3ds.formats.mesh_files.read_ply import ply_columns
from diff3ds.formats.mesh_files.text_numbers import numbers

TEXTS = (".xyz", ".txt", ".asc", ".pts", ".csv")
CLOUDS = (".ply", *TEXTS, ".npy", ".pcd", ".las", ".laz")
# Five million points of eight numbers in a text; more is taken for a mistake.
MAX_CLOUD_BYTES = 1 << 30
# Normals are numbers of unit length, give or take what a text rounds.
_UNIT = 0.01


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points in the units of the file, and unit normals where the file has some for all of them."""

    points: Float[Array, "N 3"]
    normals: Float[Array, "N 3"] | None


def read_cloud(path: str | Path) -> Cloud:
    """The points of a file that are finite, each place once.

    A text has three numbers a line and more, of which the last three of six are normals where all have unit length.

    Raises:
        ValueError: another suffix, larger than a gigabyte, broken, or without points.
        ImportError: LAS or LAZ, and laspy is not there.
        OSError: the file cannot be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in CLOUDS:
        raise ValueError(
            f"{path}: cannot load {suffix!r} as a cloud of points, only {', '.join(CLOUDS)}: diff3ds mesh draws the "
            "lines of a mesh"
        )
    check_there(path, "a cloud of points, a file such as scan.ply", MAX_CLOUD_BYTES)
    try:
        table = _las(path) if suffix in (".las", ".laz") else _table(suffix, path)
    except (ValueError, EOFError) as error:
        raise ValueError(f"{path}: {error}") from error
    except (ArithmeticError, AttributeError, LookupError, SyntaxError, TokenError, TypeError) as error:
        # Anything may stand where a number, a name or a header should.
        raise ValueError(f"{path}: not a cloud that can be read ({type(error).__name__}: {error})") from error
    table = table[np.isfinite(table).all(1)]
    if not len(table):
        raise ValueError(f"{path}: a cloud needs points, there is none with finite coordinates")
    table = table[np.sort(np.unique(table[:, :3], axis=0, return_index=True)[1])]
    points, normals = table[:, :3], table[:, 3:6]
    unit = len(normals.T) == 3 and bool((np.abs(np.linalg.norm(normals, axis=1) - 1) < _UNIT).all())
    return Cloud(np.ascontiguousarray(points), np.ascontiguousarray(normals) if unit else None)


def _table(suffix: str, path: Path) -> Float[Array, "N C"]:
    """Three or six numbers a point."""
    if suffix == ".ply":
        columns, faces = ply_columns(path.read_bytes())
        if faces:
            warnings.warn("the faces of the file are left out: diff3ds mesh draws the lines of a mesh", stacklevel=2)
        return _columns(columns, ("nx", "ny", "nz"))
    if suffix == ".pcd":
        return _columns(_pcd(path.read_bytes()), ("normal_x", "normal_y", "normal_z"))
    if suffix == ".npy":
        # Mapped, so that no more is set aside than the file has, whatever its header says.
        found = np.load(path, mmap_mode="r", allow_pickle=False)
        if found.ndim != 2 or found.shape[1] < 3 or found.dtype.kind not in "fiu":
            raise ValueError(f"expected numbers of shape (N, 3) or (N, 6), got {found.dtype} of shape {found.shape}")
    else:
        found = _text(path.read_bytes())
    return np.asarray(found[:, :6] if found.shape[1] >= 6 else found[:, :3], np.float64)


def _columns(columns: dict[str, Array], normals: tuple[str, str, str]) -> Float[Array, "N C"]:
    names = ["x", "y", "z", *(normals if all(name in columns for name in normals) else ())]
    if not all(name in columns for name in names):
        raise ValueError(f"its points have no x, y and z, only {', '.join(columns) or 'nothing'}")
    return np.stack([columns[name] for name in names], 1)


def _text(content: bytes) -> Float[Array, "N C"]:
    """Lines of equally many numbers, apart by blanks, commas or semicolons; a title and comments are passed over."""
    lines = [line for line in re.split(rb"[\r\n]+", re.sub(rb"[,;\t]", b" ", content)) if line.strip()]
    lines = [line for line in lines if not line.lstrip().startswith((b"#", b"//"))]
    # A title, or the count of the points that .pts files begin with.
    while lines and (len(lines[0].split()) < 3 or not any(_is_number(word) for word in lines[0].split())):
        del lines[0]
    if not lines:
        raise ValueError("no line has three numbers")
    width = len(lines[0].split())
    found = numbers(b"\n".join(lines))
    if len(found) != width * len(lines):
        raise ValueError(f"its lines have not all the {width} numbers of the first one")
    return found.reshape(-1, width)


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _pcd(content: bytes) -> dict[str, Array]:
    """The fields of a file of PCL that have one number a point."""
    found = re.search(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", content, re.MULTILINE)
    if found is None:
        raise ValueError("it has no header of PCD that says what its DATA are")
    words = (line.split() for line in content[: found.start()].decode("latin-1").splitlines())
    header = {line[0]: line[1:] for line in words if line and line[0] != "#"}
    names = header["FIELDS"]
    counts = [int(n) for n in header.get("COUNT", ["1"] * len(names))]
    letters = {"F": "f", "I": "i", "U": "u"}
    kinds = [f"<{letters[t]}{int(s)}" for t, s in zip(header["TYPE"], header["SIZE"], strict=True)]
    count, body = int(header["POINTS"][0]), content[found.end() :]
    if found[1] == b"ascii":
        table = numbers(body)
        if len(table) != count * sum(counts):
            raise ValueError(f"it has not the {count} points of {sum(counts)} numbers that its header says")
        starts = np.cumsum([0, *counts])
        return {n: table.reshape(count, -1)[:, s] for n, s, c in zip(names, starts, counts, strict=False) if c == 1}
    if found[1] != b"binary":
        raise ValueError(f"DATA {found[1].decode('latin-1')} is not read, only ascii and binary: convert it")
    fields = [(f"{k} {name}", kind, (c,)) for k, (name, kind, c) in enumerate(zip(names, kinds, counts, strict=True))]
    rows = np.frombuffer(body, np.dtype(fields), count)
    return {
        name: rows[field][:, 0].astype(np.float64)
        for name, (field, _, (c,)) in zip(names, fields, strict=True)
        if c == 1
    }


def _las(path: Path) -> Float[Array, "N 3"]:
    try:
        import laspy  # type: ignore[import-not-found]
    except ImportError as error:
        raise ImportError(f'{path.suffix} files are read with laspy: pip install "laspy[lazrs]"') from error
    return np.asarray(laspy.read(path).xyz, np.float64)
