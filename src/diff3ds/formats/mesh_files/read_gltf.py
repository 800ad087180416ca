"""glTF 2.0, .glb and .gltf: the triangles that its scene shows, at rest, where nodes, skins and morphs put them."""

from typing import Any

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.files_beside import FilesBeside
from diff3ds.formats.mesh_files.gltf_file import GltfFile, listed
from diff3ds.formats.mesh_files.gltf_materials import GltfMaterials
from diff3ds.formats.mesh_files.gltf_scene import Scene
from diff3ds.formats.mesh_files.polygons import MOST, Paint, Polygons, counted

_POINTS, _TRIANGLES, _STRIP, _FAN = 0, 4, 5, 6
_FLAT_KINDS = (_POINTS, 1, 2, 3)


def read_gltf(content: bytes, beside: FilesBeside, colors: bool) -> Polygons:
    """The triangles of a file, y up, in metres.

    Args:
        content: of the file.
        beside: where its buffers and pictures are.
        colors: whether materials and textures are read too.

    Raises:
        ValueError: what it requires is not read, it refers to what is elsewhere, or broken.
    """
    file = GltfFile(content, beside, colors)
    scene = Scene(file)
    reader = _Reader(file, scene, GltfMaterials(file) if colors else None)
    for number in scene.shown:
        if "mesh" in file.json["nodes"][number]:
            reader.add(number)
    return reader.polygons()


class _Reader:
    """Collects what nodes show."""

    def __init__(self, file: GltfFile, scene: Scene, materials: GltfMaterials | None) -> None:
        self._file, self._scene, self._materials = file, scene, materials
        self._points: list[Float[Array, "V 3"]] = [np.zeros((0, 3))]
        self._faces: list[Int[Index, "F 3"]] = [np.zeros((0, 3), np.int64)]
        self._paints: list[Paint] = [Paint.none(0, 0)]
        self._vertices = self._triangles = self._flat = 0
        self._beyond = False

    def add(self, number: int) -> None:
        """The mesh of a node, as often as it is shown."""
        node = self._file.one("nodes", number)
        mesh = self._file.one("meshes", node["mesh"])
        # A skin says alone where it is: the place of its mesh's node counts for nothing.
        places = [np.eye(4)] if "skin" in node else self._scene.copies(number)
        weights = listed(node if "weights" in node else mesh, "weights")
        for primitive in listed(mesh, "primitives"):
            if not isinstance(primitive, dict) or not isinstance(primitive.get("attributes"), dict):
                raise ValueError("a primitive of a mesh has no attributes")
            if primitive.get("mode", _TRIANGLES) in _FLAT_KINDS:
                self._flat += 1
                continue
            attributes = primitive["attributes"]
            faces = self._faces_of(primitive)
            points = self._points_of(primitive, weights)
            if len(faces) and (faces.min() < 0 or faces.max() >= len(points)):
                raise ValueError(f"a face has vertex {faces.max()} (counted from 0) of {len(points)}")
            flipped = False
            if "skin" in node:
                points, flipped = self._scene.skinned(node["skin"], attributes, points)
            paint = self._materials.paint(primitive, faces, len(points)) if self._materials else None
            for place in places:
                turned = flipped != bool(np.linalg.det(place[:3, :3]) < 0)
                self._show(points @ place[:3, :3].T + place[:3, 3], faces, turned, paint)

    def polygons(self) -> Polygons:
        """All of them; what one primitive of one node shows is an object."""
        faces = np.concatenate(self._faces)
        if not len(faces) and self._flat:
            raise ValueError(
                "it shows points and lines alone, no triangles: it is no mesh; of a cloud of points, saved as PLY, "
                "diff3ds points finds the edges"
            )
        left_out: tuple[str, ...] = ()
        if self._flat:
            left_out = (f"left out: {counted(self._flat, 'set of points or lines', 'sets of points or lines')}",)
        if self._beyond:
            left_out += ("vertices lie outside of the bounds that the file gives for them: it may be damaged",)
        part = np.repeat(np.arange(len(self._faces)), [len(some) for some in self._faces])
        paint = self._materials.joined(self._paints) if self._materials else None
        if self._materials:
            left_out += self._materials.left_out
        sizes = np.full(len(faces), 3)
        return Polygons(np.concatenate(self._points), faces.ravel(), sizes, part, paint, left_out)

    def _show(self, points: Float[Array, "V 3"], faces: Int[Index, "F 3"], turned: bool, paint: Paint | None) -> None:
        for what, count in (("faces", self._triangles + len(faces)), ("vertices", self._vertices + len(points))):
            if count > MOST:
                raise ValueError(f"{count} {what} are more than the {MOST} that are read")
        order = [2, 1, 0] if turned else [0, 1, 2]
        self._points.append(points)
        self._faces.append(faces[:, order] + self._vertices)
        if paint is not None:
            color, uv = (of.reshape(-1, 3, of.shape[1])[:, order].reshape(of.shape) for of in (paint.color, paint.uv))
            self._paints.append(Paint(color, uv, paint.texture))
        self._vertices, self._triangles = self._vertices + len(points), self._triangles + len(faces)

    def _points_of(self, primitive: dict[str, Any], weights: list[Any]) -> Float[Array, "V 3"]:
        """The vertices at rest: with morph targets by the weights that the file has for it."""
        if "POSITION" not in primitive["attributes"]:
            if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
                raise ValueError("needs KHR_draco_mesh_compression, which is not read: export without compression")
            return np.zeros((0, 3))
        number = primitive["attributes"]["POSITION"]
        self._check_there(primitive, number)
        points = self._file.values(number, 3)
        self._beyond |= self._file.beyond_bounds(number, points)
        for weight, target in zip(weights, listed(primitive, "targets"), strict=False):
            if weight and "POSITION" in target:
                points = points + float(weight) * self._file.values(target["POSITION"], 3)
        return points

    def _faces_of(self, primitive: dict[str, Any]) -> Int[Index, "F 3"]:
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in (_TRIANGLES, _STRIP, _FAN):
            raise ValueError(f"a primitive of the mode {str(mode)[:20]} is none of glTF")
        if "indices" in primitive:
            self._check_there(primitive, primitive["indices"])
            row = self._file.accessor(primitive["indices"])
            if row.ndim != 1 or row.dtype.kind == "f":
                raise ValueError("indices must be whole numbers, one each")
            row = row.astype(np.int64)
        else:
            number = primitive["attributes"].get("POSITION")
            row = np.arange(0 if number is None else len(self._file.accessor(number)))
        if mode == _TRIANGLES:
            return row[: len(row) // 3 * 3].reshape(-1, 3)
        k = np.arange(max(len(row) - 2, 0))
        if mode == _FAN:
            return np.stack([row[k + 1], row[k + 2], row[:1].repeat(len(k))], 1)
        return np.stack([row[k], row[k + 1 + k % 2], row[k + 2 - k % 2]], 1)

    def _check_there(self, primitive: dict[str, Any], number: Any) -> None:
        """Raises ValueError for what is there in compressed form alone."""
        accessor = self._file.one("accessors", number)
        compressed = "KHR_draco_mesh_compression" in primitive.get("extensions", {})
        if compressed and "bufferView" not in accessor and "sparse" not in accessor:
            raise ValueError("needs KHR_draco_mesh_compression, which is not read: export without compression")
