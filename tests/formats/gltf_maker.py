"""Small glTF files for tests, put together by hand from the standard: JSON, and a buffer of arrays."""

import base64
import io
import json
import struct
from pathlib import Path

import numpy as np
from PIL import Image

KINDS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
# A square of 2 x 2 in glTF's plane z = 0, which is our x = 0; its triangles have the area 4.
SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], np.float32)
FACES = np.array([0, 1, 2, 0, 2, 3], np.uint16)
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)


class Gltf:
    """A file that is being made: `json` is its JSON; a square is shown by a node where nothing else is said."""

    def __init__(self) -> None:
        self.buffer = b""
        self.json: dict = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": [], "nodes": [{"mesh": 0}]}

    def add(self, values, normalized: bool = False, stride: int = 0, **more) -> int:
        """An accessor of an array, and its number."""
        values = np.ascontiguousarray(values)
        size = 1 if values.ndim == 1 else values.shape[1]
        rows = values.reshape(len(values), -1)
        content = b"".join(row.tobytes().ljust(stride, b"\xaa") for row in rows)
        view = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(content)}
        self.json["bufferViews"].append(view | ({"byteStride": stride} if stride else {}))
        accessor = {"bufferView": len(self.json["bufferViews"]) - 1, "componentType": KINDS[str(values.dtype)]}
        accessor |= {"count": len(values), "type": SHAPES[size]} | ({"normalized": True} if normalized else {})
        self.json["accessors"].append(accessor | more)
        self.buffer += content + b"\0" * (-len(content) % 4)
        return len(self.json["accessors"]) - 1

    def square(self, positions=SQUARE, normalized=False, stride=0, mode=None, faces=FACES, uv=None, **attributes):
        """The mesh of the square, or of other positions."""
        primitive: dict = {"attributes": {"POSITION": self.add(positions, normalized, stride), **attributes}}
        if uv is not None:
            primitive["attributes"]["TEXCOORD_0"] = self.add(uv)
        if faces is not None:
            primitive["indices"] = self.add(faces)
        if mode is not None:
            primitive["mode"] = mode
        self.json.setdefault("meshes", []).append({"primitives": [primitive]})
        return primitive

    def picture(self, pixels, kind: str = "PNG", **sampler) -> dict:
        """The information of a texture of these pixels."""
        content = io.BytesIO()
        Image.fromarray(np.array(pixels, np.uint8)).save(
            content, kind, **({"lossless": True} if kind == "WEBP" else {})
        )
        data = content.getvalue()
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(data)})
        self.buffer += data + b"\0" * (-len(data) % 4)
        view = len(self.json["bufferViews"]) - 1
        self.json["images"] = [{"bufferView": view, "mimeType": f"image/{kind.lower()}"}]
        self.json["textures"] = [{"source": 0} | ({"sampler": 0} if sampler else {})]
        if sampler:
            self.json["samplers"] = [sampler]
        return {"index": 0}

    def require(self, *names: str) -> None:
        self.json["extensionsUsed"] = self.json["extensionsRequired"] = list(names)

    def write(self, folder: Path, how: str = "glb") -> Path:
        """As a.glb, or as a.gltf with its buffer "beside" or in "data"."""
        buffers = [{"byteLength": len(self.buffer)}]
        if how == "glb":
            text = json.dumps({**self.json, "buffers": self.json.get("buffers", buffers)}).encode()
            text += b" " * (-len(text) % 4)
            chunks = struct.pack("<I4s", len(text), b"JSON") + text
            chunks += struct.pack("<I4s", len(self.buffer), b"BIN\0") + self.buffer
            (folder / "a.glb").write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
            return folder / "a.glb"
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.buffer).decode()
        if how == "beside":
            (folder / "the buffer.bin").write_bytes(self.buffer)
            uri = "the%20buffer.bin"
        buffers[0]["uri"] = uri
        (folder / "a.gltf").write_text(json.dumps({**self.json, "buffers": buffers}))
        return folder / "a.gltf"
