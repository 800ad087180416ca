"""STL files, text or binary: triangles without an index, with the colours of VisCAM, SolidView and Magics."""

import re

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.mesh_files.polygons import MOST, Paint, Polygons, counted
from diff3ds.formats.mesh_files.text_numbers import numbers

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84
_SOLID = re.compile(rb"^[ \t]*(?:end)?solid\b[^\r\n]*", re.IGNORECASE | re.MULTILINE)
_VERTEX = re.compile(rb"\bvertex\s+(\S+\s+\S+\s+\S+)", re.IGNORECASE)
_LOOP = re.compile(rb"\bendloop\b", re.IGNORECASE)


def read_stl(content: bytes, colors: bool) -> Polygons:
    """The triangles of a file; solids of a text are objects.

    Raises:
        ValueError: neither a text with facets nor as many bytes as its count says, or broken.
    """
    said = int.from_bytes(content[_HEADER - 4 : _HEADER], "little")
    whole = len(content) == _HEADER + said * _FACET.itemsize
    # Some programs begin the header of binary files with "solid".
    if not whole and re.match(rb"\s*solid\b", content, re.IGNORECASE) and _is_text(content):
        return _text(content, colors)
    there = (len(content) - _HEADER) // _FACET.itemsize
    if there < 1:
        raise ValueError("neither a text that begins with solid and has facets nor a binary STL file")
    left_out = []
    if said > there and (len(content) - _HEADER) % _FACET.itemsize:
        raise ValueError(f"it is cut off: it says that it has {counted(said, 'triangle')}, and has {there}")
    count = there if said > there or said == 0 else said
    if count != said:
        left_out = [f"left out: its count, {said}: it has {counted(there, 'triangle')}"]
    elif not whole:
        extra = len(content) - _HEADER - count * _FACET.itemsize
        left_out = [f"left out: {counted(extra, 'byte')} behind the last of {counted(count, 'triangle')}"]
    if count > MOST:
        raise ValueError(f"{count} faces are more than the {MOST} that are read")
    facets = np.frombuffer(content, _FACET, count, _HEADER)
    paint = _paint(content[: _HEADER - 4], facets["attribute"].astype(np.int64)) if colors else None
    return _soup(facets["corners"].reshape(-1, 3), np.full(count, 3), np.zeros(count, np.int64), paint, left_out)


def _is_text(content: bytes) -> bool:
    return b"\0" not in content or re.search(rb"\bfacet\s+normal\b", content[:4096], re.IGNORECASE) is not None


def _soup(
    vertices: Float[Array, "V 3"],
    sizes: Int[Index, " P"],
    part: Int[Index, " P"],
    paint: Paint | None,
    left_out: list[str],
) -> Polygons:
    """Faces that share no vertex."""
    corners = np.arange(len(vertices))
    return Polygons(np.asarray(vertices, np.float64), corners, sizes, part, paint, tuple(left_out))


def _text(content: bytes, colors: bool) -> Polygons:
    """Loops of any number of vertices, whatever their lines."""
    solids = [_loops(chunk) for chunk in _SOLID.split(content)]
    solids = [solid for solid in solids if len(solid[1])] or [(np.zeros((0, 3)), np.zeros(0, np.int64))]
    sizes = np.concatenate([sizes for _, sizes in solids])
    part = np.repeat(np.arange(len(solids)), [len(sizes) for _, sizes in solids])
    vertices = np.concatenate([points for points, _ in solids])
    return _soup(vertices, sizes, part, Paint.none(len(vertices), len(sizes)) if colors else None, [])


def _loops(text: bytes) -> tuple[Float[Array, "V 3"], Int[Index, " P"]]:
    """The vertices of a solid, and how many each loop has."""
    found = numbers(b" ".join(_VERTEX.findall(text))).reshape(-1, 3)
    loops = len(_LOOP.findall(text))
    if len(found) == 3 * loops:
        return found, np.full(loops, 3)
    pieces = _LOOP.split(text)
    sizes = np.array([len(_VERTEX.findall(piece)) for piece in pieces], np.int64)
    if sizes[-1]:
        raise ValueError("it is cut off: a loop has no end")
    return found, sizes[:-1]


def _paint(header: bytes, attribute: Int[Index, " P"]) -> Paint:
    """Five bits a channel: VisCAM and SolidView have blue in the lowest and set the 16th bit where there is a colour.

    Magics has red in the lowest, and where the 16th bit is set the colour of the whole, which its header has.
    """
    paint = Paint.none(3 * len(attribute), len(attribute))
    channels = np.stack([attribute >> 10 & 31, attribute >> 5 & 31, attribute & 31], 1) / 31
    own = attribute >> 15 == 1
    whole = re.search(rb"COLOR=(.{4})", header, re.DOTALL)
    found = np.where(own[:, None], channels, np.nan)
    if whole:
        found = np.where(own[:, None], np.frombuffer(whole[1][:3], np.uint8) / 255, channels[:, ::-1])
    paint.color[:] = np.repeat(found, 3, 0)
    return paint
