"""Triangle meshes from files: vertices and faces; needs the extra `mesh`."""

import importlib.util
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._files import write_bytes
from diff3ds._shapes import Float, Int
from diff3ds.formats.gltf import FLOAT, INDICES, UINT32, VERTICES, one_scene, packed

MESHES = (".obj", ".stl", ".ply", ".off", ".glb")
# Formats that define which axis points up: their meshes come with z up.
UP_IS_KNOWN = (".glb",)
# Two million triangles in the most wordy format; more is taken for a mistake or an attack.
MAX_MESH_BYTES = 1 << 28
# Triangles and vertices; a scene that shows one mesh many times has more than are in the file.
MOST = 1 << 23


def load_mesh(path: str | Path) -> tuple[Float[NDArray[np.float64], "V 3"], Int[NDArray[np.int64], "F 3"]]:
    """The vertices and triangles of a mesh, as `load_parts` but for its objects."""
    return load_parts(path)[:2]


def load_parts(
    path: str | Path,
) -> tuple[Float[NDArray[np.float64], "V 3"], Int[NDArray[np.int64], "F 3"], Int[NDArray[np.int64], " F"]]:
    """The vertices and triangles of a mesh, and which object of its file each triangle is of.

    Larger faces are cut into triangles, scenes joined into one mesh. glTF has y up and z in front, and comes with z up
    and x in front; files of other formats as they are. Only this file is read: materials and textures that it names
    are not.

    Raises:
        ImportError: the extra `mesh` is not installed.
        ValueError: another suffix; larger than 256 MiB or 8 million triangles, broken, or without triangles.
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
    import trimesh

    try:
        content = path.read_bytes()
        if path.suffix.lower() == ".glb":
            _check_counts(content)
        scene: Any = trimesh.load(io.BytesIO(content), path.suffix.lower()[1:], force="scene", process=False)
        _check_instances(scene)
        vertices, faces, part = _joined(scene)
    except OSError:
        raise
    except Exception as error:
        # What trimesh raises for broken files is of any type.
        raise ValueError(f"{path}: not a mesh that can be read ({type(error).__name__}: {error})") from error
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices) or not np.isfinite(vertices[faces]).all():
        raise ValueError(f"{path}: a mesh needs triangles between finite vertices")
    return vertices[:, [2, 0, 1]] if path.suffix.lower() in UP_IS_KNOWN else vertices, faces, part


def _joined(
    scene: Any,
) -> tuple[Float[NDArray[np.float64], "V 3"], Int[NDArray[np.int64], "F 3"], Int[NDArray[np.int64], " F"]]:
    """All meshes of a scene where it shows them, as one, and which of them each face is of."""
    # Points and lines are no meshes.
    meshes = [mesh for mesh in scene.dump(concatenate=False) if len(getattr(mesh, "faces", ()))]
    before = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    corners = [np.array(mesh.faces, np.int64) + start for mesh, start in zip(meshes, before, strict=False)]
    counts = [len(faces) for faces in corners]
    return (
        np.concatenate([np.zeros((0, 3)), *(np.array(mesh.vertices, np.float64) for mesh in meshes)]),
        np.concatenate([np.zeros((0, 3), np.int64), *corners]),
        np.repeat(np.arange(len(counts)), counts),
    )


def _check_counts(content: bytes) -> None:
    """Raises ValueError for a binary glTF that says it has more of something than is read: memory is taken for it."""
    length, _ = struct.unpack_from("<II", content, 12)
    accessors = json.loads(content[20 : 20 + length]).get("accessors", [])
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
