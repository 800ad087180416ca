"""A glTF 2.0 file, binary or JSON: its buffers and the numbers in them, and whether it needs what is not read."""

import base64
import binascii
import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float
from diff3ds.formats.files_beside import FilesBeside
from diff3ds.formats.mesh_files.polygons import MOST

# What a file may require: it is read, or changes nothing but how light falls.
_KNOWN = {
    "EXT_lights_ies", "EXT_lights_image_based", "EXT_mesh_gpu_instancing", "EXT_texture_webp",
    "KHR_animation_pointer", "KHR_lights_punctual", "KHR_materials_anisotropy", "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission", "KHR_materials_dispersion", "KHR_materials_emissive_strength",
    "KHR_materials_ior", "KHR_materials_iridescence", "KHR_materials_pbrSpecularGlossiness", "KHR_materials_sheen",
    "KHR_materials_specular", "KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_variants",
    "KHR_materials_volume", "KHR_mesh_quantization", "KHR_node_visibility", "KHR_texture_transform", "KHR_xmp",
    "KHR_xmp_json_ld",
}  # fmt: skip
COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_TEXTURES = ("KHR_texture_basisu", "MSFT_texture_dds")
_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


# How far bounds that are written with few digits lie off, as a share of the largest. [empirical: exporters write six]
_BOUNDS_SLACK = 1e-5


class GltfFile:
    """The JSON of a file, and arrays from its buffers.

    Attributes:
        json: the file's.
        accessors: how many there are, for messages.
    """

    def __init__(self, content: bytes, beside: FilesBeside, colors: bool) -> None:
        """Reads the JSON, and buffers when they are wanted.

        Args:
            content: of the file.
            beside: where other files are.
            colors: whether textures are wanted.

        Raises:
            ValueError: no glTF 2.0, or one that requires what is not read.
        """
        text, self._binary = _chunks(content) if content[:4] == b"glTF" else (content, None)
        try:
            self.json: dict[str, Any] = json.loads(text.decode("utf-8-sig"), parse_constant=_no_number)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"its JSON cannot be read ({error})") from error
        if not isinstance(self.json, dict) or not isinstance(self.json.get("asset"), dict):
            raise ValueError("its JSON is not that of glTF")
        version = str(self.json["asset"].get("minVersion", self.json["asset"].get("version")))
        if version != "2.0" and not (version.startswith("2.") and "minVersion" not in self.json["asset"]):
            raise ValueError(f"glTF of version {version[:20]} is not read: export glTF 2.0")
        for name in self.all("extensionsRequired"):
            if name in COMPRESSED:
                raise ValueError(f"needs {name}, which is not read: export without compression")
            if name in _TEXTURES and not colors:
                continue
            if name not in _KNOWN:
                advice = "textures as PNG or JPEG" if name in _TEXTURES else "without it"
                raise ValueError(f"needs {str(name)[:80]}, which is not read: export {advice}")
        self._beside = beside
        self._buffers: dict[int, bytes] = {}

    def all(self, name: str) -> list[Any]:
        """All things of a kind."""
        return listed(self.json, name)

    def one(self, name: str, number: Any) -> Any:
        """A thing of a kind by its number.

        Raises:
            ValueError: there is none.
        """
        found = self.all(name)
        if type(number) is not int or not 0 <= number < len(found) or not isinstance(found[number], dict):
            raise ValueError(f"it has no number {str(number)[:20]} of its {len(found)} {name}")
        return found[number]

    def view(self, number: Any) -> tuple[bytes, int]:
        """The bytes of a buffer view, and its stride, 0 where it has none."""
        view = self.one("bufferViews", number)
        for name in COMPRESSED:
            buffer = self.one("buffers", view.get("buffer"))
            if name in view.get("extensions", {}) and "uri" not in buffer and view.get("buffer") != 0:
                raise ValueError(f"needs {name}, which is not read: export without compression")
        buffer = self._buffer(view.get("buffer"))
        start, size = _count(view.get("byteOffset", 0)), _count(view.get("byteLength"))
        stride = _count(view.get("byteStride", 0))
        if start + size > len(buffer):
            raise ValueError(f"buffer view {number} is longer than its buffer, of {len(buffer)} bytes: it is cut off")
        return buffer[start : start + size], stride

    def accessor(self, number: Any) -> NDArray[Any]:
        """An array as it is stored, (count,) or (count, components); normalised ones as float64.

        Raises:
            ValueError: it is not there, or more than is read.
        """
        accessor = self.one("accessors", number)
        size, count = _SIZES.get(accessor.get("type", ""), 0), _count(accessor.get("count"))
        kind = _kind(accessor.get("componentType"))
        if not size or count * size > 16 * MOST:
            raise ValueError(f"accessor {number} is of an unknown type, or has more than is read")
        if "bufferView" in accessor:
            found = self._strided(accessor["bufferView"], _count(accessor.get("byteOffset", 0)), kind, size, count)
        else:
            found = np.zeros((count, size), kind)
        if "sparse" in accessor:
            found = self._sparse(accessor["sparse"], found)
        if accessor.get("normalized") is True and kind.kind != "f":
            found = np.maximum(found / np.iinfo(kind).max, -1.0)
        return found[:, 0] if size == 1 else found

    def values(self, number: Any, components: int) -> Float[Array, "N C"]:
        """An array of numbers of so many components."""
        found = self.accessor(number).astype(np.float64)
        if found.ndim != 2 or found.shape[1] != components:
            raise ValueError(f"accessor {number} must be of {components} components")
        return found

    def beyond_bounds(self, number: Any, values: Float[Array, "N C"]) -> bool:
        """Whether values lie outside of the `min` and `max` that their accessor gives, where it gives some."""
        accessor = self.one("accessors", number)
        bounds = [accessor.get(name) for name in ("min", "max")]
        # Those of normalised values are of what is stored, and nobody needs them there.
        if not len(values) or accessor.get("normalized") or not all(map(_is_point, bounds)):
            return False
        low, high = np.array(bounds, np.float64)
        if low.shape != values.shape[1:]:
            return False
        slack = _BOUNDS_SLACK * max(np.abs(values).max(), np.abs(low).max(), np.abs(high).max())
        return bool((values.min(0) < low - slack).any() or (values.max(0) > high + slack).any())

    def resource(self, uri: Any) -> bytes:
        """What a URI means: data in the URI itself, or a file beside.

        Raises:
            ValueError: neither.
        """
        if not isinstance(uri, str):
            raise ValueError("a buffer or an image has no URI")
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.split(",", 1)[1], validate=True)
            except (IndexError, binascii.Error) as error:
                raise ValueError("data in a URI are not in base 64") from error
        return self._beside.at(uri)

    def _buffer(self, number: Any) -> bytes:
        buffer = self.one("buffers", number)
        if number not in self._buffers:
            size = _count(buffer.get("byteLength"))
            if "uri" in buffer:
                content = self.resource(buffer["uri"])
            elif number == 0 and self._binary is not None:
                content = self._binary
            else:
                raise ValueError(f"buffer {number} is not there")
            if len(content) < size:
                raise ValueError(f"buffer {number} should have {size} bytes and has {len(content)}: it is cut off")
            self._buffers[number] = content[:size]
        return self._buffers[number]

    def _strided(self, view: Any, offset: int, kind: np.dtype, size: int, count: int) -> NDArray[Any]:
        content, stride = self.view(view)
        width = size * kind.itemsize
        stride = stride or width
        if stride < width or (count and offset + (count - 1) * stride + width > len(content)):
            raise ValueError(f"numbers lie beyond the end of buffer view {view}")
        if not count:
            return np.zeros((0, size), kind)
        return np.ndarray((count, size), kind, content, offset, (stride, kind.itemsize)).copy()

    def _sparse(self, sparse: dict[str, Any], found: NDArray[Any]) -> NDArray[Any]:
        count = _count(sparse.get("count"))
        where, what = sparse["indices"], sparse["values"]
        kind = _kind(where.get("componentType"))
        rows = self._strided(where.get("bufferView"), _count(where.get("byteOffset", 0)), kind, 1, count)[:, 0]
        if count and (kind.kind == "f" or rows.max() >= len(found)):
            raise ValueError("a sparse accessor replaces what is not there")
        offset = _count(what.get("byteOffset", 0))
        found[rows] = self._strided(what.get("bufferView"), offset, found.dtype, found.shape[1], count)
        return found


def listed(thing: dict[str, Any], name: str) -> list[Any]:
    """What a thing has under a name, nothing where it has none.

    Raises:
        ValueError: no list.
    """
    found = thing.get(name, [])
    if not isinstance(found, list):
        raise ValueError(f"its {name} are no list")
    return found


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def _is_point(value: Any) -> bool:
    """Whether a value is a list of numbers."""
    return isinstance(value, list) and all(isinstance(x, int | float) and np.isfinite(x) for x in value)


def _count(value: Any) -> int:
    """A whole number from 0 on; JSON may write it with a point."""
    if isinstance(value, bool) or not isinstance(value, int | float) or value != value // 1 or not 0 <= value < 1 << 53:
        raise ValueError(f"{str(value)[:20]!r} is no count")
    return int(value)


def _kind(number: Any) -> np.dtype:
    if number not in _TYPES:
        raise ValueError(f"{str(number)[:20]} is no component type")
    return np.dtype(_TYPES[number])


def _chunks(content: bytes) -> tuple[bytes, bytes | None]:
    """The JSON of a binary file, and its buffer."""
    if len(content) < 20:
        raise ValueError("it is cut off: a GLB file has a header of 20 bytes")
    version, length = struct.unpack_from("<II", content, 4)
    if version != 2:
        raise ValueError(f"glTF of version {version} is not read: export glTF 2.0")
    if length > len(content):
        raise ValueError(f"it is cut off: it says that it has {length} bytes, and has {len(content)}")
    at, chunks = 12, []
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", content, at)
        if at + 8 + size > length:
            raise ValueError("it is cut off: a chunk is longer than the file")
        chunks.append((kind, content[at + 8 : at + 8 + size]))
        at += 8 + size
    if not chunks or chunks[0][0] != b"JSON":
        raise ValueError("its first chunk is no JSON")
    return chunks[0][1], next((chunk for kind, chunk in chunks[1:] if kind == b"BIN\0"), None)
