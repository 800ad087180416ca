"""Binary glTF 2.0 (GLB): one file of a scene in JSON and a buffer of numbers."""

import json
import struct
from typing import Any

from diff3ds._version import __version__

# Of the glTF standard: numbers for float, unsigned int, vertices, indices; for primitives of lines, of triangles.
FLOAT, UINT32, VERTICES, INDICES = 5126, 5125, 34962, 34963
LINES, TRIANGLES = 1, 4
# More is not a GLB file: lengths have 32 bits.
MOST_BYTES = (1 << 32) - 1
_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"


def one_scene(nodes: list[dict[str, Any]], meshes: list[dict[str, Any]]) -> dict[str, Any]:
    """The part of the JSON that says what is shown: the last node, with those that are its children."""
    return {
        "asset": {"version": "2.0", "generator": f"diff3ds {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": meshes,
    }


def packed(content: dict[str, Any], buffer: bytes) -> bytes:
    """The bytes of a file; of more than `MOST_BYTES` no reader knows the length."""
    text = json.dumps({**content, "buffers": [{"byteLength": len(buffer)}]}, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(buffer)
    header = _MAGIC + struct.pack("<II", 2, length & MOST_BYTES) + struct.pack("<I", len(text)) + _JSON
    return b"".join([header, text, struct.pack("<I", len(buffer) & MOST_BYTES) + _BINARY, buffer])
