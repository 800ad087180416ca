"""PLY files, text or binary: polygons or strips, with colours of vertices or faces, and textures that comments name."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.files_beside import FilesBeside
from diff3ds.formats.mesh_colors import NO_TEXTURE, Pictures
from diff3ds.formats.mesh_files.polygons import MOST, Paint, Polygons, check_corners, counted, shares
from diff3ds.formats.mesh_files.text_numbers import numbers, widths

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_CORNERS = ("vertex_indices", "vertex_index", "vertex_indexes")
_RGB = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_TEXTURE = re.compile(rb"^comment\s+TextureFile\s+(.+?)\s*$", re.IGNORECASE | re.MULTILINE)


@dataclass(frozen=True)
class _Property:
    """A number, or a list of them whose count has a type as well."""

    name: str
    kind: str
    count: str | None


@dataclass(frozen=True)
class _List:
    """Lists of a property: all their numbers, one after the other, and how many each has."""

    values: NDArray[Any]
    sizes: Int[Index, " N"]


# Arrays of numbers, and lists.
_Columns = dict[str, NDArray[Any] | _List]


def read_ply(content: bytes, beside: FilesBeside | None) -> Polygons:
    """The faces of a file.

    Args:
        content: of the file.
        beside: where the textures that it names are; None leaves colours out.

    Raises:
        ValueError: a cloud of points, or broken.
    """
    header, data = _read(content)
    if "range_grid" in data:
        raise ValueError("a range image of a scanner, which has no faces, is no mesh: diff3ds points finds its edges")
    if "vertex" not in data or not all(isinstance(data["vertex"].get(k), np.ndarray) for k in "xyz"):
        raise ValueError("it has no element vertex with x, y and z")
    vertices = np.stack([_array(data["vertex"][k]) for k in "xyz"], 1).astype(np.float64)
    faces, strips = data.get("face", {}), data.get("tristrips", {})
    corners, sizes = _lists(faces)
    if strips:
        more = _of_strips(*_lists(strips))
        corners, sizes = np.concatenate([corners, more.ravel()]), np.concatenate([sizes, np.full(len(more), 3)])
    if not len(sizes):
        raise ValueError(
            f"a cloud of {counted(len(vertices), 'point')} without faces is no mesh: diff3ds points finds its edges"
        )
    check_corners(corners, len(vertices))
    paint = None if beside is None else _paint(data, corners, sizes, _TEXTURE.findall(header), beside)
    return Polygons(vertices, corners, sizes, np.zeros(len(sizes), np.int64), paint)


def ply_columns(content: bytes) -> tuple[dict[str, Array], bool]:
    """The numbers of each vertex of a file by their names, such as x, y, z and nx, ny, nz; and whether it has faces.

    Raises:
        ValueError: broken.
    """
    data = _read(content)[1]
    columns = data.get("vertex", {})
    numbers = {name: column.astype(np.float64) for name, column in columns.items() if isinstance(column, np.ndarray)}
    return numbers, "face" in data and len(_lists(data["face"])[1]) > 0


def _read(content: bytes) -> tuple[bytes, dict[str, _Columns]]:
    """The header of a file, and its elements."""
    end = re.search(rb"^end_header[ \t]*(?:\r\n|\r|\n)", content, re.MULTILINE)
    if not re.match(rb"ply\s", content) or end is None:
        raise ValueError("it has no header of PLY")
    header = content[: end.start()].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    kind, elements = _header(header.decode("latin-1").split("\n"))
    return header, _elements(kind, elements, content, end.end())


def _header(lines: list[str]) -> tuple[str, list[tuple[str, int, list[_Property]]]]:
    """The format, and the elements with their counts and properties."""
    kind = ""
    elements: list[tuple[str, int, list[_Property]]] = []
    for line in lines[1:]:
        match line.split():
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as kind, *_]:
                pass
            case ["element", name, count] if count.isdigit():
                if int(count) > 3 * MOST:
                    raise ValueError(f"{count[:20]} of {name} are more than are read")
                elements.append((name.lower(), int(count), []))
            case ["property", "list", count, of, name] if {count, of} <= _TYPES.keys() and elements:
                if count.startswith(("float", "double")):
                    raise ValueError(f"a list cannot have {count} things")
                elements[-1][2].append(_Property(name.lower(), _TYPES[of], _TYPES[count]))
            case ["property", of, name] if of in _TYPES and elements:
                elements[-1][2].append(_Property(name.lower(), _TYPES[of], None))
            case ["format" | "element" | "property", *_]:
                raise ValueError(f"a line of its header is not understood: {line[:60]!r}")
    if not kind:
        raise ValueError("its header does not say its format")
    return kind, elements


def _elements(
    kind: str, elements: list[tuple[str, int, list[_Property]]], content: bytes, at: int
) -> dict[str, _Columns]:
    """All elements; of a name that is there twice the last one."""
    data: dict[str, _Columns] = {}
    flat = np.frombuffer(content, np.uint8)
    order = {"binary_big_endian": ">"}.get(kind, "<")
    lines = [line for line in content[at:].splitlines() if line.strip()] if kind == "ascii" else []
    row = 0
    for name, count, properties in elements:
        written, length = properties, None
        try:
            if kind == "ascii":
                # A text is as one of numbers of one type; what more a line has is passed over.
                block = lines[row : row + count]
                flat, length, at = numbers(b"\n".join(block)).view(np.uint8), 8 * widths(block), 0
                if len(block) < count or length.sum() != len(flat):
                    raise ValueError("the file ends before")
                written = [_Property(p.name, "f8", p.count and "f8") for p in properties]
                row += count
            columns, at = _columns(flat, at, count, written, order, length)
            data[name] = {p.name: _typed(columns[p.name], p.kind) for p in properties}
        except (IndexError, ValueError) as error:
            raise ValueError(f"it is cut off or broken: its {count} of {name} are not there ({error})") from error
    return data


def _typed(column: NDArray[Any] | _List, kind: str) -> NDArray[Any] | _List:
    """Whole numbers in their own type, also of a text, where they came as float64."""
    if isinstance(column, _List):
        return _List(np.asarray(_typed(column.values, kind)), column.sizes)
    if kind[0] == "f" or column.dtype.kind != "f":
        return column
    range_ = np.iinfo(kind)
    return np.asarray(np.clip(np.nan_to_num(column), range_.min, range_.max), kind)


def _columns(
    flat: NDArray[np.uint8], at: int, count: int, properties: list[_Property], order: str, length: Index | None
) -> tuple[_Columns, int]:
    """The properties of an element whose first row begins at a byte, and where what follows begins.

    Args:
        length: bytes of each row, where the file tells it.
    """
    fixed = _alike(flat, at, count, properties, order, length)
    if fixed is not None:
        return fixed
    starts: list[list[int]] = [[] for _ in properties]
    sizes: list[list[int]] = [[] for _ in properties]
    width = [np.dtype(p.kind).itemsize for p in properties]
    kinds = [np.dtype(order + p.count) if p.count else None for p in properties]
    raw = flat.tobytes()
    ends = [len(raw)] * count if length is None else np.cumsum(length).tolist()
    for row in range(count):
        at = at if length is None else ends[row] - int(length[row])
        for k, kind in enumerate(kinds):
            number = 1
            if kind is not None:
                number = int(np.frombuffer(raw, kind, 1, at)[0])
                at += kind.itemsize
            if number < 0 or at + number * width[k] > ends[row]:
                raise ValueError("a list is longer than the file, or its line")
            starts[k].append(at)
            sizes[k].append(number)
            at += number * width[k]
    found: _Columns = {}
    for k, p in enumerate(properties):
        each = np.array(sizes[k], np.int64)
        before = np.repeat(np.cumsum(each) - each, each)
        rows = np.repeat(np.array(starts[k], np.int64), each) + (np.arange(int(each.sum())) - before) * width[k]
        values = flat[rows[:, None] + np.arange(width[k])].reshape(-1).view(np.dtype(order + p.kind))
        found[p.name] = values if p.count is None else _List(values, each)
    return found, at


def _alike(
    flat: NDArray[np.uint8], at: int, count: int, properties: list[_Property], order: str, length: Index | None
) -> tuple[_Columns, int] | None:
    """The same for rows that are all as long as the first one; None where they are not."""
    fields: list[tuple[str, str, int]] = []
    end = at
    for k, p in enumerate(properties):
        number = 1
        if p.count and count:
            size = np.dtype(p.count).itemsize
            if end + size > len(flat):
                raise ValueError("the file ends before")
            number = int(flat[end : end + size].view(order + p.count)[0])
            fields.append((f"count {k}", order + p.count, 1))
            end += size
        width = number * np.dtype(p.kind).itemsize
        if count and not 0 <= width <= len(flat) - end:
            raise ValueError("a row is longer than the file")
        fields.append((f"value {k}", order + p.kind, number))
        end += width
    if length is not None and count:
        if (length != length[0]).any():
            return None
        if at + length[0] < end:
            raise ValueError("its lines have fewer numbers")
        fields.append(("more", "u1", at + int(length[0]) - end))
    kind = np.dtype([(name, of, (number,)) for name, of, number in fields])
    if not count or not kind.itemsize:
        return {
            p.name: _List(np.zeros(0, p.kind), np.zeros(0, np.int64)) if p.count else np.zeros(count)
            for p in properties
        }, at
    if at + count * kind.itemsize > len(flat):
        if any(p.count for p in properties):
            return None
        raise ValueError("the file ends before")
    rows = np.frombuffer(flat, kind, count, at)
    found: _Columns = {}
    for k, p in enumerate(properties):
        values = rows[f"value {k}"]
        if p.count is None:
            found[p.name] = values[:, 0]
            continue
        if (rows[f"count {k}"] != values.shape[1]).any():
            return None
        found[p.name] = _List(values.reshape(-1), np.full(count, values.shape[1]))
    return found, at + count * kind.itemsize


def _array(column: NDArray[Any] | _List) -> NDArray[Any]:
    assert isinstance(column, np.ndarray)
    return column


def _lists(columns: _Columns) -> tuple[Int[Index, " C"], Int[Index, " P"]]:
    """The corners of faces or strips, and how many each has."""
    found = next((columns[name] for name in _CORNERS if name in columns), None)
    if not isinstance(found, _List):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    with np.errstate(invalid="ignore"):
        return found.values.astype(np.int64), found.sizes


def _of_strips(corners: Int[Index, " C"], sizes: Int[Index, " S"]) -> Int[Index, "T 3"]:
    """The triangles of strips, which end where their list does and at -1; every other one is wound the other way."""
    strip = np.repeat(np.arange(len(sizes)), sizes)
    ends = corners == -1
    strip = strip + np.cumsum(ends)
    first = np.flatnonzero(np.append(True, strip[1:] != strip[:-1]) | np.append(False, ends[:-1]))
    start = np.repeat(first, np.diff(np.append(first, len(corners))))
    k = np.arange(max(len(corners) - 2, 0))
    whole = (start[k] == start[k + 2]) & ~(ends[k] | ends[k + 1] | ends[k + 2])
    k = k[whole]
    odd = (k - start[k]) % 2
    return np.stack([corners[k], corners[k + 1 + odd], corners[k + 2 - odd]], 1)


def _rgb(columns: _Columns) -> Float[Array, "N 3"] | None:
    """Colours in [0, 1]."""
    for names in _RGB:
        found = [columns.get(name) for name in names]
        if all(isinstance(column, np.ndarray) for column in found):
            values = np.stack([_array(column) for column in found if column is not None], 1)
            return shares(values)
    return None


def _paint(
    data: dict[str, _Columns],
    corners: Int[Index, " C"],
    sizes: Int[Index, " P"],
    files: list[bytes],
    beside: FilesBeside,
) -> Paint:
    paint = Paint.none(len(corners), len(sizes))
    vertex, face = data["vertex"], data.get("face", {})
    of_vertices, of_faces = _rgb(vertex), _rgb(face)
    if of_vertices is not None:
        paint.color[:] = of_vertices[corners]
    if of_faces is not None and of_vertices is None:
        count = int(sizes[: len(of_faces)].sum())
        paint.color[:count] = np.repeat(of_faces, sizes[: len(of_faces)], 0)
    for names in _UV:
        if all(isinstance(vertex.get(name), np.ndarray) for name in names):
            paint.uv[:] = np.stack([_array(vertex[name]) for name in names], 1)[corners]
    own = face.get("texcoord")
    if isinstance(own, _List) and (own.sizes == 2 * sizes[: len(own.sizes)]).all():
        paint.uv[: len(own.values) // 2] = own.values.reshape(-1, 2)
    pictures = Pictures()
    found = [_texture(name.decode("utf-8", "replace"), beside, pictures) for name in files]
    number = face.get("texnumber")
    which = np.zeros(len(sizes), np.int64)
    if isinstance(number, np.ndarray):
        which[: len(number)] = np.clip(np.nan_to_num(number), 0, max(len(found) - 1, 0))
    texture = np.array([*found, NO_TEXTURE], np.int64)[which]
    return Paint(paint.color, paint.uv, texture, tuple(pictures.textures), False, tuple(beside.missing))


def _texture(name: str, beside: FilesBeside, pictures: Pictures) -> int:
    content = beside.find(name)
    if content is None:
        return NO_TEXTURE
    number = pictures.number(name, content)
    if number == NO_TEXTURE:
        beside.missing.append(name)
    return number
