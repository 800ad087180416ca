"""Where the nodes of a glTF file are, which of them its scene shows, and how skins move what hangs on joints."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float
from diff3ds.formats.mesh_files.gltf_file import GltfFile, listed
from diff3ds.formats.mesh_files.polygons import MOST

# Nodes in nodes: more is taken for an attack.
DEEPEST = 4096


class Scene:
    """The nodes of a file.

    Attributes:
        shown: numbers of the nodes that are shown, each once.
    """

    def __init__(self, file: GltfFile) -> None:
        """Follows the nodes of the scene that is shown: the file's default, its first, or all where it has none.

        Raises:
            ValueError: a node that is a child twice or of itself, or is not there.
        """
        self._file = file
        nodes = file.all("nodes")
        self._parent = [-1] * len(nodes)
        for number in range(len(nodes)):
            for child in listed(file.one("nodes", number), "children"):
                file.one("nodes", child)
                if self._parent[child] != -1:
                    raise ValueError(f"node {child} is the child of two nodes")
                self._parent[child] = number
        self._places: dict[int, Float[Array, "4 4"]] = {}
        scenes = file.all("scenes")
        if scenes:
            ways = list(listed(file.one("scenes", file.json.get("scene", 0)), "nodes"))
        else:
            ways = [number for number, parent in enumerate(self._parent) if parent == -1]
        self.shown: list[int] = []
        seen = set()
        while ways:
            number = ways.pop(0)
            node = file.one("nodes", number)
            if number in seen:
                raise ValueError(f"node {number} is in the scene twice")
            seen.add(number)
            if node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible") is False:
                continue
            self.shown.append(number)
            ways += listed(node, "children")

    def place(self, number: int) -> Float[Array, "4 4"]:
        """From a node's own coordinates to the world."""
        way = []
        while number not in self._places and number != -1:
            way.append(number)
            if len(way) > DEEPEST:
                raise ValueError(f"nodes are more than {DEEPEST} deep, or go round in a circle")
            number = self._parent[number]
        place = self._places[number] if number != -1 else np.eye(4)
        for own in reversed(way):
            place = place @ _local(self._file.one("nodes", own))
            self._places[own] = place
        return place

    def copies(self, number: int) -> list[Float[Array, "4 4"]]:
        """The places at which a node shows its mesh: one, or those of its instances."""
        node = self._file.one("nodes", number)
        own = self.place(number)
        instances = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if instances is None:
            return [own]
        given = instances.get("attributes", {})
        columns = {name: self._file.accessor(given[name]).astype(np.float64) for name in _IDENTITY if name in given}
        counts = {len(values) for values in columns.values()}
        if len(counts) != 1 or max(counts) > MOST:
            raise ValueError("instances of a node must be as many in all of their attributes")
        return [
            own @ _matrix(*(columns[n][k] if n in columns else v for n, v in _IDENTITY.items())) for k in range(*counts)
        ]

    def skinned(
        self, skin: Any, attributes: dict[str, Any], points: Float[Array, "V 3"]
    ) -> tuple[Float[Array, "V 3"], bool]:
        """Where the joints of a skin move points, and whether they are turned inside out.

        Raises:
            ValueError: other joints or weights than the skin has.
        """
        skin = self._file.one("skins", skin)
        joints = listed(skin, "joints")
        for joint in joints:
            self._file.one("nodes", joint)
        matrices = np.stack([self.place(joint) for joint in joints]) if joints else np.zeros((0, 4, 4))
        if "inverseBindMatrices" in skin:
            inverse = self._file.values(skin["inverseBindMatrices"], 16).reshape(-1, 4, 4).transpose(0, 2, 1)
            if len(inverse) < len(joints):
                raise ValueError(f"a skin of {len(joints)} joints has {len(inverse)} inverse bind matrices")
            matrices = matrices @ inverse[: len(joints)]
        sets = [k for k in range(16) if f"JOINTS_{k}" in attributes]
        if not sets:
            raise ValueError("a mesh with a skin has no joints")
        which = np.concatenate([self._file.accessor(attributes[f"JOINTS_{k}"]).astype(np.int64) for k in sets], 1)
        share = np.concatenate([self._file.values(attributes.get(f"WEIGHTS_{k}"), 4) for k in sets], 1)
        if len(which) != len(points) or which.shape != share.shape or which.max(initial=0) >= len(joints):
            raise ValueError("joints of a mesh are not those of its skin")
        # What hangs on nothing is taken to hang on its first joint.
        total = share.sum(1, keepdims=True)
        share = np.where(total > 0, share / np.where(total > 0, total, 1.0), np.eye(share.shape[1])[0])
        moved = np.zeros_like(points)
        for k in range(which.shape[1]):
            matrix = matrices[which[:, k]]
            moved += share[:, k, None] * (np.einsum("vij,vj->vi", matrix[:, :3, :3], points) + matrix[:, :3, 3])
        return moved, bool(np.linalg.det(matrices[:, :3, :3]).sum() < 0)


_IDENTITY: dict[str, NDArray[np.float64]] = {
    "TRANSLATION": np.zeros(3),
    "ROTATION": np.array([0.0, 0.0, 0.0, 1.0]),
    "SCALE": np.ones(3),
}


def _local(node: dict[str, Any]) -> Float[Array, "4 4"]:
    """From a node's own coordinates to those of its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    given = (np.array(node.get(name.lower(), value), np.float64) for name, value in _IDENTITY.items())
    return _matrix(*given)


def _matrix(translation: Array, rotation: Array, scale: Array) -> Float[Array, "4 4"]:
    """Scaled, turned by a quaternion (x, y, z, w), and moved."""
    if translation.shape != (3,) or rotation.shape != (4,) or scale.shape != (3,):
        raise ValueError("a node has another translation, rotation or scale than of 3, 4 and 3 numbers")
    length = np.linalg.norm(rotation)
    x, y, z, w = rotation / length if length > 0 else _IDENTITY["ROTATION"]
    place = np.eye(4)
    place[:3, :3] = scale * np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    place[:3, 3] = translation
    return place
