"""Triangle meshes from files: vertices, faces and their colours."""

import codecs
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from diff3ds._files import check_there, write_bytes
from diff3ds._shapes import Bool, Float, Index, Int, Mask
from diff3ds.formats.clouds.read_cloud import CLOUDS
from diff3ds.formats.files_beside import FilesBeside
from diff3ds.formats.gltf import FLOAT, INDICES, UINT32, VERTICES, one_scene, packed
from diff3ds.formats.mesh_colors import NO_TEXTURE, MeshColors
from diff3ds.formats.mesh_files.polygons import MOST, Paint, Polygons, counted, numbered_places
from diff3ds.formats.mesh_files.read_gltf import read_gltf
from diff3ds.formats.mesh_files.read_obj import read_obj
from diff3ds.formats.mesh_files.read_off import read_off
from diff3ds.formats.mesh_files.read_ply import read_ply
from diff3ds.formats.mesh_files.read_stl import read_stl
from diff3ds.formats.mesh_files.triangulation import triangulated

MESHES = (".obj", ".stl", ".ply", ".off", ".glb", ".gltf")
# Formats that define which axis points up: their meshes come with z up.
UP_IS_KNOWN = (".glb", ".gltf")
# Two million triangles in the most wordy format; more is taken for a mistake or an attack.
MAX_MESH_BYTES = 1 << 28
# Coordinates beyond are no numbers of anything: their squares' squares would overflow.
FARTHEST = 1e60
# Of places in textures: beyond, float64 does not tell texels apart.
FARTHEST_UV = 1e12


@dataclass(frozen=True, eq=False)
class MeshFile:
    """What a mesh file holds.

    Attributes:
        vertices: in the file's units.
        faces: triangles.
        polygon: which face of the file each triangle is of: edges between two of one face are no edges of the file.
        part: which object of the file each triangle is of.
        colors: of the triangles, where they were asked for.
    """

    vertices: Float[NDArray[np.float64], "V 3"]
    faces: Int[Index, "F 3"]
    polygon: Int[Index, " F"]
    part: Int[Index, " F"]
    colors: MeshColors | None


def load_mesh(path: str | Path) -> tuple[Float[NDArray[np.float64], "V 3"], Int[Index, "F 3"]]:
    """The vertices and triangles of a mesh, as `read_mesh`."""
    read = read_mesh(path)
    return read.vertices, read.faces


def read_mesh(path: str | Path, colors: bool = False) -> MeshFile:
    """The vertices and triangles of a mesh, and which object of its file each triangle is of.

    Larger faces are cut into triangles, each in its own plane; scenes are joined into one mesh. glTF has y up and z in
    front, and comes with z up and x in front; files of other formats as they are. Only this file is read, but for
    buffers of glTF, and for the materials and textures that it names, in its folder, where colours are asked for.
    What of a file is left out is said in a warning (docs/reference/formats-read.md lists it).

    Args:
        colors: whether colours of vertices, faces, materials and textures are read too.

    Raises:
        ValueError: another suffix; larger than 256 MiB or 8 million triangles, broken, without triangles, or with what
            is not read; colours are asked for and a texture is broken or too large.
        OSError: the file cannot be read.
    """
    path = Path(path)
    if path.suffix.lower() not in MESHES:
        hint = ": of a cloud of points diff3ds points finds the edges" if path.suffix.lower() in CLOUDS else ""
        raise ValueError(f"{path}: cannot load {path.suffix.lower()!r} as a mesh, only {', '.join(MESHES)}{hint}")
    check_there(path, "a mesh, a file such as part.stl", MAX_MESH_BYTES)
    content = path.read_bytes()
    try:
        # Numbers of broken files may be of any size; what is too large is left out below.
        with np.errstate(all="ignore"):
            read = _read(path, _plain(content), colors)
            mesh, left_out = _triangles(read)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError) as error:
        # Anything may stand where a number, a list or a name should.
        raise ValueError(f"{path}: not a mesh that can be read ({type(error).__name__}: {error})") from error
    for what in (*read.left_out, *left_out):
        warnings.warn(f"{path}: {what}", stacklevel=2)
    if path.suffix.lower() in UP_IS_KNOWN:
        return MeshFile(mesh.vertices[:, [2, 0, 1]], mesh.faces, mesh.polygon, mesh.part, mesh.colors)
    return mesh


def _plain(content: bytes) -> bytes:
    """A text without a byte order mark, in UTF-8 where it was in UTF-16; other files as they are."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", "replace").encode()
    return content.removeprefix(codecs.BOM_UTF8)


def _read(path: Path, content: bytes, colors: bool) -> Polygons:
    beside = FilesBeside(path, MAX_MESH_BYTES)
    painted = beside if colors else None
    match path.suffix.lower():
        case ".obj":
            return read_obj(content, painted)
        case ".stl":
            return read_stl(content, colors)
        case ".ply":
            return read_ply(content, painted)
        case ".off":
            return read_off(content, colors)
        case _:
            return read_gltf(content, beside, colors)


def _triangles(read: Polygons) -> tuple[MeshFile, list[str]]:
    """The faces in triangles, and what of them is left out."""
    points, sizes = read.vertices, read.sizes
    if not len(sizes):
        raise ValueError(
            f"{counted(len(points), 'vertex', 'vertices')} and no face: a mesh needs triangles; of a cloud of points, "
            "saved as PLY, diff3ds points finds the edges"
        )
    finite = np.asarray((np.abs(points) < FARTHEST).all(1))
    first = np.cumsum(sizes) - sizes
    of = np.repeat(np.arange(len(sizes)), sizes)
    short = sizes < 3
    broken = ~short & (np.bincount(of, ~finite[read.corners], len(sizes)) > 0)
    twice = _twice(read, first) & ~broken
    kept = np.where(short | broken | twice, 0, sizes)
    row = np.flatnonzero(kept[of] > 0)
    cut = triangulated(points[read.corners[row]], kept)
    faces, polygon = read.corners[row[cut.rows]], cut.polygon
    if len(faces) > MOST:
        raise ValueError(f"{len(faces)} faces are more than the {MOST} that are read")
    left_out = [
        f"left out: {counted(int(count), 'face')} {what}"
        for count, what in (
            (short.sum(), "of fewer than three corners"),
            (broken.sum(), "with coordinates that are no numbers, or far too large"),
        )
        if count and len(faces)
    ]
    if not len(faces):
        raise ValueError("a mesh needs triangles between finite vertices")
    if cut.crossed:
        crossed = "crosses itself" if cut.crossed == 1 else "cross themselves"
        left_out.append(f"{counted(cut.crossed, 'face')} {crossed}: no triangles cover what it encloses just once")
    colors = None if read.paint is None else _colors(read.paint, row[cut.rows], polygon)
    return MeshFile(points, faces, polygon, read.part[polygon], colors), left_out


def _twice(read: Polygons, first: Int[Index, " P"]) -> Bool[Mask, " P"]:
    """Faces of more than three corners that were there before: cut otherwise, their triangles would not be the same."""
    twice = np.zeros(len(read.sizes), bool)
    large = read.sizes[read.sizes > 3]
    if not len(large):
        return twice
    place = numbered_places(read.vertices)
    for size in np.unique(large):
        rows = np.flatnonzero(read.sizes == size)
        corners = np.sort(place[read.corners[first[rows][:, None] + np.arange(size)]], 1)
        _, kept = np.unique(corners, axis=0, return_index=True)
        again = np.ones(len(rows), bool)
        again[kept] = False
        twice[rows] = again
    return twice


def _colors(paint: Paint, rows: Int[Index, "F 3"], polygon: Int[Index, " F"]) -> MeshColors:
    """Colours of triangles; textures where all corners have a place in them."""
    corners, uv = paint.color[rows], paint.uv[rows]
    corners[~np.isfinite(corners).all(2)] = np.nan
    texture = np.where((np.abs(uv) < FARTHEST_UV).all((1, 2)), paint.texture[polygon], NO_TEXTURE)
    return MeshColors(corners, uv, texture, paint.textures, paint.multiplied, paint.missing)


def save_surface(path: str | Path, vertices: Float[NDArray[np.float64], "V 3"], faces: Int[Index, "F 3"]) -> None:
    """Writes a mesh with z up and x in front as a GLB file, whole or not at all; numbers become float32.

    Raises:
        OSError: the file cannot be written.
    """
    points, corners = vertices[:, [1, 2, 0]].astype("<f4"), faces.astype("<u4")
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes, "target": VERTICES},
        {"buffer": 0, "byteOffset": points.nbytes, "byteLength": corners.nbytes, "target": INDICES},
    ]
    bounds = {"min": points.min(0).tolist(), "max": points.max(0).tolist()}
    accessors = [
        {"bufferView": 0, "componentType": FLOAT, "count": len(points), "type": "VEC3", **bounds},
        {"bufferView": 1, "componentType": UINT32, "count": corners.size, "type": "SCALAR"},
    ]
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    scene = one_scene([{"name": "surface", "mesh": 0}], [{"name": "surface", "primitives": [primitive]}])
    buffer = points.tobytes() + corners.tobytes()
    write_bytes(Path(path), packed({**scene, "accessors": accessors, "bufferViews": views}, buffer))
