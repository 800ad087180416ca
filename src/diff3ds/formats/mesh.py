"""Triangle meshes from files: vertices, faces and their colours; needs the extra `mesh`."""

import importlib.util
import io
import json
import logging
import struct
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._files import write_bytes
from diff3ds._shapes import Float, Int
from diff3ds.formats.files_beside import FilesBeside
from diff3ds.formats.gltf import FLOAT, INDICES, UINT32, VERTICES, one_scene, packed
from diff3ds.formats.mesh_colors import ColorReader, MeshColors

MESHES = (".obj", ".stl", ".ply", ".off", ".glb")
# Formats that define which axis points up: their meshes come with z up.
UP_IS_KNOWN = (".glb",)
# Two million triangles in the most wordy format; more is taken for a mistake or an attack.
MAX_MESH_BYTES = 1 << 28
# Triangles and vertices; a scene that shows one mesh many times has more than are in the file.
MOST = 1 << 23


@dataclass(frozen=True, eq=False)
class MeshFile:
    """What a mesh file holds.

    Attributes:
        vertices: in the file's units.
        faces: triangles.
        part: which object of the file each triangle is of.
        colors: of the triangles, where they were asked for.
    """

    vertices: Float[NDArray[np.float64], "V 3"]
    faces: Int[NDArray[np.int64], "F 3"]
    part: Int[NDArray[np.int64], " F"]
    colors: MeshColors | None


def load_mesh(path: str | Path) -> tuple[Float[NDArray[np.float64], "V 3"], Int[NDArray[np.int64], "F 3"]]:
    """The vertices and triangles of a mesh, as `read_mesh`."""
    read = read_mesh(path)
    return read.vertices, read.faces


def read_mesh(path: str | Path, colors: bool = False) -> MeshFile:
    """The vertices and triangles of a mesh, and which object of its file each triangle is of.

    Larger faces are cut into triangles, scenes joined into one mesh. glTF has y up and z in front, and comes with z up
    and x in front; files of other formats as they are. Only this file is read, but for the materials and textures that
    it names, in its folder, where colours are asked for.

    Args:
        colors: whether colours of vertices, faces, materials and textures are read too.

    Raises:
        ImportError: the extra `mesh` is not installed.
        ValueError: another suffix; larger than 256 MiB or 8 million triangles, broken, or without triangles; colours
            are asked for and a texture is broken or too large.
        OSError: the file cannot be read.
    """
    path = Path(path)
    if path.suffix.lower() not in MESHES:
        raise ValueError(f"{path}: cannot load {path.suffix.lower()!r} as a mesh, only {', '.join(MESHES)}")
    size = path.stat().st_size
    if size > MAX_MESH_BYTES:
        raise ValueError(f"{path}: {size} bytes are more than the {MAX_MESH_BYTES} that are read")
    if importlib.util.find_spec("trimesh") is None:
        raise ImportError(f"{path}: reading meshes takes trimesh: install it with pip install 'diff3ds[mesh]'")
    try:
        mesh = _read(path, colors)
    except OSError:
        raise
    except Exception as error:
        # What trimesh raises for broken files is of any type.
        raise ValueError(f"{path}: not a mesh that can be read ({type(error).__name__}: {error})") from error
    vertices, faces = mesh.vertices, mesh.faces
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices) or not np.isfinite(vertices[faces]).all():
        raise ValueError(f"{path}: a mesh needs triangles between finite vertices")
    if path.suffix.lower() in UP_IS_KNOWN:
        return MeshFile(vertices[:, [2, 0, 1]], faces, mesh.part, mesh.colors)
    return mesh


def _read(path: Path, colors: bool) -> MeshFile:
    import trimesh

    content, kind = path.read_bytes(), path.suffix.lower()[1:]
    if kind == "glb":
        _check_counts(content)
    beside = FilesBeside(path, MAX_MESH_BYTES) if colors else None
    # What is missing is said here; trimesh's log would print a traceback.
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        # Pillow warns of large pictures below the bound of ours.
        warnings.simplefilter("ignore")
        scene: Any = trimesh.load(io.BytesIO(content), kind, resolver=beside, force="scene", process=False)
        _check_instances(scene)
        reader = ColorReader(kind == "glb") if colors else None
        vertices, faces, part = _joined(scene, reader)
    if reader is None or beside is None or not len(faces):
        return MeshFile(vertices, faces, part, None)
    missing = [*beside.missing, *(_lost_textures(content, scene) if kind == "glb" else ())]
    return MeshFile(vertices, faces, part, reader.colors(tuple(missing)))


def _joined(
    scene: Any, reader: ColorReader | None
) -> tuple[Float[NDArray[np.float64], "V 3"], Int[NDArray[np.int64], "F 3"], Int[NDArray[np.int64], " F"]]:
    """All meshes of a scene where it shows them, as one, and which of them each face is of."""
    points: list[NDArray[np.float64]] = [np.zeros((0, 3))]
    corners: list[NDArray[np.int64]] = [np.zeros((0, 3), np.int64)]
    before = 0
    for node in scene.graph.nodes_geometry:
        place, name = scene.graph[node]
        mesh = scene.geometry[name]
        # Points and lines are no meshes.
        if not len(getattr(mesh, "faces", ())):
            continue
        flipped = bool(np.linalg.det(place[:3, :3]) < 0)
        faces = np.array(mesh.faces, np.int64) + before
        points.append(np.array(mesh.vertices, np.float64) @ place[:3, :3].T + place[:3, 3])
        corners.append(faces[:, ::-1] if flipped else faces)
        before += len(mesh.vertices)
        if reader is not None:
            reader.add(mesh, flipped)
    counts = [len(faces) for faces in corners[1:]]
    return np.concatenate(points), np.concatenate(corners), np.repeat(np.arange(len(counts)), counts)


def _lost_textures(content: bytes, scene: Any) -> list[str]:
    """Materials of a binary glTF whose texture trimesh could not open, which it passes over without a word."""
    wanted = {
        material.get("name")
        for material in _header(content).get("materials", [])
        if "baseColorTexture" in material.get("pbrMetallicRoughness", {})
    }
    materials = [getattr(getattr(mesh, "visual", None), "material", None) for mesh in scene.geometry.values()]
    return sorted(
        {
            f"the texture of material {material.name!r}"
            for material in materials
            if material is not None and material.name in wanted and material.baseColorTexture is None
        }
    )


def _header(content: bytes) -> dict[str, Any]:
    """The JSON of a binary glTF."""
    length, _ = struct.unpack_from("<II", content, 12)
    header: dict[str, Any] = json.loads(content[20 : 20 + length])
    return header


def _check_counts(content: bytes) -> None:
    """Raises ValueError for a binary glTF that says it has more of something than is read: memory is taken for it."""
    accessors = _header(content).get("accessors", [])
    counts = [accessor.get("count", 0) for accessor in accessors]
    if not all(type(count) is int and count >= 0 for count in counts) or sum(counts) > 4 * MOST:
        raise ValueError(f"more than the {4 * MOST} numbers that are read")


def _check_instances(scene: Any) -> None:
    """Raises ValueError for a scene that shows more than is read, counted as often as it is shown."""
    shown = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
    for what in ("faces", "vertices"):
        count = sum(len(getattr(mesh, what, ())) for mesh in shown)
        if count > MOST:
            raise ValueError(f"{count} {what} are more than the {MOST} that are read")


def save_surface(
    path: str | Path, vertices: Float[NDArray[np.float64], "V 3"], faces: Int[NDArray[np.int64], "F 3"]
) -> None:
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
