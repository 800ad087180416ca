"""OFF files of Geomview: COFF with colours, NOFF with normals, STOFF with texture coordinates, 4OFF and nOFF."""

import re

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.mesh_files.polygons import MOST, Paint, Polygons, check_corners, shares
from diff3ds.formats.mesh_files.text_numbers import numbers, table, whole_numbers, widths

_HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF(?![A-Za-z])[ \t]*(BINARY)?")


def read_off(content: bytes, colors: bool) -> Polygons:
    """The faces of a file; its header may be missing, or in one line with the counts.

    Raises:
        ValueError: a binary one, one of other than three dimensions, or broken.
    """
    lines = [line for line in (line.split(b"#", 1)[0].strip() for line in content.splitlines()) if line]
    header = _HEADER.match(lines[0]) if lines else None
    if header and header[6]:
        raise ValueError("a binary OFF file is not read: write it as a text, or as PLY")
    if header:
        lines[0] = lines[0][header.end() :].strip()
    lines = [line for line in lines if line]
    texture, colored, normals, four = (bool(header and header[k]) for k in (1, 2, 3, 4))
    if header and header[5]:
        if not lines or lines[0].split()[0] != b"3":
            raise ValueError("an nOFF file of other than three dimensions is no surface in space")
        lines[0] = lines[0].split(None, 1)[1] if len(lines[0].split()) > 1 else b""
        lines = [line for line in lines if line]
    counts = whole_numbers(lines[0]) if lines else np.zeros(0, np.int64)
    if len(counts) < 2 or counts.min() < 0 or counts[:2].max() > MOST:
        raise ValueError("an OFF file begins with OFF and the counts of its vertices, faces and edges")
    n, f = int(counts[0]), int(counts[1])
    if len(lines) < 1 + n + f:
        raise ValueError(f"it is cut off: {n} vertices and {f} faces take more lines than it has")
    size = 4 if four else 3
    rows = lines[1 : 1 + n]
    values = table(rows, widths(rows), size)
    if np.isnan(values[:, :size]).any(1).sum() > _nans(rows):
        raise ValueError(f"a vertex has fewer than {size} numbers")
    vertices = values[:, :3] / values[:, 3:4] if four else values[:, :3].copy()
    corners, sizes, shades = _faces(lines[1 + n : 1 + n + f], colors)
    check_corners(corners, n)
    paint = None
    if colors:
        paint = Paint.none(len(corners), len(sizes))
        first = size + 3 * normals
        own = values[:, first : first + 3]
        if own.shape[1] == 3 and (colored or not (normals or texture)):
            paint.color[:] = shares(own)[corners]
        painted = np.isfinite(shades).all(1)
        paint.color[np.repeat(painted, sizes)] = np.repeat(shares(shades)[painted], sizes[painted], 0)
    return Polygons(vertices, corners, sizes, np.zeros(len(sizes), np.int64), paint)


def _nans(rows: list[bytes]) -> int:
    """How many lines say themselves that they have no number."""
    return sum(b"nan" in row.lower() for row in rows)


def _faces(lines: list[bytes], colors: bool) -> tuple[Int[Index, " C"], Int[Index, " P"], Float[Array, "P 3"]]:
    """Corners, their counts, and colours of faces: three or four numbers behind them; NaN where there are others."""
    words = [line.split() for line in lines]
    sizes = whole_numbers(b" ".join(word[0] for word in words))
    if (sizes < 0).any() or any(len(word) <= size for word, size in zip(words, sizes, strict=True)):
        raise ValueError("a face has fewer vertices than it says")
    corners = whole_numbers(b" ".join(b" ".join(w[1 : s + 1]) for w, s in zip(words, sizes.tolist(), strict=True)))
    shades = np.full((len(words), 3), np.nan)
    if colors:
        rest = [word[size + 1 :] for word, size in zip(words, sizes.tolist(), strict=True)]
        painted = [k for k, word in enumerate(rest) if len(word) in (3, 4)]
        shades[painted] = numbers(b" ".join(b" ".join(rest[k][:3]) for k in painted)).reshape(-1, 3)
    return corners, sizes, shades
