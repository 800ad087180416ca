"""Wavefront OBJ: polygons, with colours at vertices and materials of MTL files."""

from dataclasses import dataclass, field

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.files_beside import FilesBeside
from diff3ds.formats.mesh_colors import NO_TEXTURE, Pictures
from diff3ds.formats.mesh_files.polygons import Paint, Polygons, check_corners, counted, shares
from diff3ds.formats.mesh_files.read_mtl import Material, read_mtl
from diff3ds.formats.mesh_files.text_numbers import table, whole_numbers, widths

# Curves and surfaces, and the patches of old files.
_FREE_FORM = (b"curv", b"curv2", b"surf", b"bsp", b"bzp", b"cdc", b"cdp", b"res")
# Commands of the shell, and other files in the place of this line.
_RUNS = (b"csh", b"call")


@dataclass
class _Read:
    """The lines of a file, sorted: of faces also how many vertices there were, their object and their material."""

    v: list[bytes] = field(default_factory=list)
    vt: list[bytes] = field(default_factory=list)
    f: list[bytes] = field(default_factory=list)
    before: list[tuple[int, int]] = field(default_factory=list)
    part: list[int] = field(default_factory=list)
    material: list[int] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    flat: int = 0


def read_obj(content: bytes, beside: FilesBeside | None) -> Polygons:
    """The faces of a file; groups and objects are its objects.

    Args:
        content: of the file.
        beside: where the files that it names are; None leaves colours out.

    Raises:
        ValueError: free-form curves or surfaces, other files or commands in it, or broken.
    """
    read = _sorted(content)
    count = widths(read.v)
    if ((count < 3) | (count == 5)).any():
        raise ValueError(f"{read.v[int(((count < 3) | (count == 5)).argmax())][:60]!r} is no vertex of three numbers")
    values = table(read.v, count, 6)
    vertices = values[:, :3].copy()
    sizes = widths(read.f)
    indices = _indices(b" ".join(read.f), int(sizes.sum()))
    before = np.repeat(np.array(read.before, np.int64).reshape(-1, 2), sizes, 0)
    corners = _counted_on(indices[:, 0], before[:, 0])
    check_corners(corners, len(vertices))
    left_out = []
    if (values[count == 4, 3] != 1).any():
        left_out.append("left out: weights of vertices, which are those of free-form curves")
    if read.flat:
        left_out.append(f"left out: {counted(read.flat, 'line or point', 'lines and points')}")
    paint = None
    if beside is not None:
        own = np.where(count[:, None] >= 6, values[:, 3:6], np.nan)
        places = _counted_on(indices[:, 1], before[:, 1]) if indices.shape[1] > 1 else np.full(len(corners), -1)
        paint = _paint(read, beside, sizes, shares(own)[corners], places)
    return Polygons(vertices, corners, sizes, np.array(read.part, np.int64), paint, tuple(left_out))


def _sorted(content: bytes) -> _Read:
    read = _Read()
    part = material = -1
    content = content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    numbers: dict[str, int] = {}
    for line in content.splitlines():
        word, _, rest = line.strip().replace(b"\t", b" ").partition(b" ")
        if b"#" in rest and word not in (b"usemtl", b"mtllib"):
            rest = rest.split(b"#", 1)[0]
        if word == b"v":
            read.v.append(rest)
        elif word in (b"f", b"fo"):
            read.f.append(rest)
            read.before.append((len(read.v), len(read.vt)))
            read.part.append(part)
            read.material.append(material)
        elif word == b"vt":
            read.vt.append(rest)
        elif word in (b"o", b"g"):
            part += 1
        elif word == b"usemtl":
            material = numbers.setdefault(_name(rest), len(numbers))
        elif word == b"mtllib":
            read.libraries.append(_name(rest))
        elif word in (b"l", b"p"):
            read.flat += 1
        elif word in _FREE_FORM:
            raise ValueError(
                f"it has free-form curves or surfaces ({word.decode()}), which are not read: export meshes"
            )
        elif word in _RUNS:
            raise ValueError(f"it runs commands or takes in other files ({word.decode()}), which is not done")
    read.names = list(numbers)
    return read


def _name(rest: bytes) -> str:
    """A name, in UTF-8 or as old programs of Windows write it."""
    try:
        return rest.strip().decode()
    except UnicodeDecodeError:
        return rest.strip().decode("latin-1")


def _indices(text: bytes, count: int) -> Int[Index, "C W"]:
    """The vertex of each corner, and its texture coordinate where there is one; 0 where there is none, or no column."""
    letters = np.frombuffer(text, np.uint8)
    slash = np.flatnonzero(letters == ord("/"))
    if not len(slash):
        return whole_numbers(text).reshape(count, 1)
    # Mostly all corners are written alike, and the slashes can go.
    each = np.bincount(np.searchsorted(np.flatnonzero(letters == ord(" ")), slash))
    each = each[each > 0]
    doubled = np.diff(slash) == 1
    if len(each) == count and (each == each[0]).all():
        columns = each[0] + 1 - int(doubled.any())
        found = whole_numbers(text.replace(b"/", b" "))
        if len(found) == columns * count and (not doubled.any() or doubled[::2].all()):
            return found.reshape(count, columns)[:, : 1 if doubled.any() else 2]
    parts = [(*word.split(b"/"), b"")[:2] for word in text.split()]
    return whole_numbers(b" ".join(part or b"0" for pair in parts for part in pair)).reshape(count, 2)


def _counted_on(index: Int[Index, " C"], before: Int[Index, " C"]) -> Int[Index, " C"]:
    """Indices from 0 of such from 1, or backwards from those before; -1 for none, beyond all where it is wrong."""
    return np.where(index < 0, np.where(index + before < 0, np.iinfo(np.int64).max, index + before), index - 1)


def _paint(
    read: _Read, beside: FilesBeside, sizes: Int[Index, " P"], own: Float[Array, "C 3"], places: Int[Index, " C"]
) -> Paint:
    """Colours of corners, which hold where they are given, of materials otherwise; textures where there are any."""
    materials: dict[str, Material] = {}
    for library in read.libraries:
        materials |= _library(library, beside)
    pictures, numbers, missing = Pictures(), [], []
    color = np.full((len(read.names) + 1, 3), np.nan)
    moved = np.tile([1.0, 1.0, 0.0, 0.0], (len(read.names) + 1, 1))
    for k, name in enumerate(read.names):
        found = materials.get(name)
        if found is None and read.libraries and not beside.missing:
            missing.append(f"the material {name}")
        number = NO_TEXTURE
        if found is not None:
            color[k] = np.nan if found.color is None else found.color
            moved[k] = found.moved
            number = _texture(found, beside, pictures)
        numbers.append(number)
    material = np.array(read.material, np.int64)
    texture = np.array([*numbers, NO_TEXTURE], np.int64)[material]
    count = widths(read.vt)
    given = table(read.vt, count, 2)[:, :2]
    # One number is a place along the texture's lower edge.
    given[count == 1, 1] = 0
    if places.max(initial=-1) >= len(given):
        missing.append(f"{counted(int((places >= len(given)).sum()), 'texture coordinate')} of faces")
        places = np.where(places < len(given), places, -1)
    uv = np.concatenate([given, np.full((1, 2), np.nan)])[places]
    row = np.repeat(material, sizes)
    uv = uv * moved[row, :2] + moved[row, 2:]
    mixed = np.where(np.isfinite(own), own, color[row])
    return Paint(mixed, uv, texture, tuple(pictures.textures), False, (*beside.missing, *missing))


def _library(name: str, beside: FilesBeside) -> dict[str, Material]:
    """The materials of a file; where none has the name, several may be meant, with spaces between."""
    known = len(beside.missing)
    content = beside.find(name)
    if content is not None:
        return read_mtl(content)
    several = name.split()
    if len(several) < 2:
        return {}
    del beside.missing[known:]
    found: dict[str, Material] = {}
    for one in several:
        found |= read_mtl(beside.find(one) or b"")
    return found


def _texture(material: Material, beside: FilesBeside, pictures: Pictures) -> int:
    if material.picture is None:
        return NO_TEXTURE
    content = beside.find(material.picture)
    if content is None:
        return NO_TEXTURE
    number = pictures.number(material.picture, content, material.wrap)
    if number == NO_TEXTURE:
        beside.missing.append(material.picture)
    return number
