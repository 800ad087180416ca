"""GLB files (binary glTF 2.0) for viewers and scenes: strokes as tubes (`tubes.py`) or lines; an own small writer.

One node a stroke, called "stroke 0", "stroke 1" and so on, within nodes of layers where there are some, and one
material a colour and opacity. glTF is in metres with y up and z in front: x, y and z of a sketch become z, x and y, as
`formats.mesh` reads them back. Numbers are float32, relative to the middle of the sketch, whose place is that of the
root node.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diff3ds._files import write_bytes
from diff3ds._shapes import Float, Int
from diff3ds._units import MILLIMETRES, Unit, check_unit
from diff3ds.formats.framing import ball_of
from diff3ds.formats.gltf import FLOAT, INDICES, LINES, MOST_BYTES, TRIANGLES, UINT32, VERTICES, one_scene, packed
from diff3ds.formats.opening import check_sketch
from diff3ds.formats.scenes.polylines import polylines_of
from diff3ds.formats.scenes.tubes import tubes_of
from diff3ds.sketch import Sketch
from diff3ds.svg.layer_groups import Group, check_layers, grouped, outermost


class _Shape(NamedTuple):
    """What stands for a stroke: vertices (world units), normals of surfaces, and which vertices make its parts."""

    vertices: Float[NDArray[np.float64], "V 3"]
    normals: Float[NDArray[np.float64], "V 3"] | None
    indices: Int[NDArray[np.int64], "P K"]


def save_glb(
    path: str | Path,
    sketch: Sketch,
    *,
    unit: Unit = "m",
    lines: bool = False,
    layers: Sequence[str | Group] | None = None,
) -> None:
    """Writes a GLB file, whole or not at all.

    Args:
        unit: what a world unit is; the file is in metres.
        lines: strokes as lines, which viewers draw a pixel wide however near one comes, in place of tubes; they are off
            by 1e-4 of the sketch's radius at most.
        layers: of each stroke, its layer, or layers within layers from the outermost on: nodes of these names.

    Raises:
        ValueError: another number of layers than of strokes, no strokes, for tubes none with a width; a unit that is
            not known, values that have become invalid since the sketch was made, or more than the 4 GiB that the format
            can hold.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_unit(unit)
    check_sketch(path, sketch, "a GLB")
    check_layers(layers, len(sketch))
    shapes = _lines(sketch) if lines else _tubes(sketch)
    if not shapes:
        raise ValueError(f"{path}: a GLB file needs at least one stroke with a width, got none of {len(sketch)}")
    middle, _ = ball_of(sketch)
    metres = MILLIMETRES[unit] / 1000
    buffer = bytearray()
    content = _scene(sketch, shapes, layers, middle.numpy(), metres, buffer)
    file = packed(content, bytes(buffer))
    if len(file) > MOST_BYTES:
        raise ValueError(f"{path}: {len(file)} bytes are more than the 4 GiB of a GLB file: export parts of the sketch")
    write_bytes(path, file)


def _tubes(sketch: Sketch) -> dict[int, _Shape]:
    """Of each stroke with a width."""
    tubes = enumerate(tubes_of(sketch))
    return {i: _Shape(tube.vertices, tube.normals, tube.faces) for i, tube in tubes if len(tube.faces)}


def _lines(sketch: Sketch) -> dict[int, _Shape]:
    """Of each stroke. A closed one ends in a second vertex where it begins: some readers take vertices as they come."""
    shapes = {}
    for stroke, (vertices, closed) in enumerate(polylines_of(sketch)):
        path = np.concatenate([vertices, vertices[:1]]) if closed else vertices
        pairs = np.arange(len(path) - 1)[:, None] + np.arange(2)
        shapes[stroke] = _Shape(path, None, pairs)
    return shapes


def _scene(
    sketch: Sketch,
    shapes: dict[int, _Shape],
    layers: Sequence[str | Group] | None,
    middle: Any,
    metres: float,
    buffer: bytearray,
) -> dict[str, Any]:
    """What the file says in JSON; numbers go to the buffer."""
    accessors: list[dict[str, Any]] = []
    views: list[dict[str, Any]] = []
    meshes = []
    nodes: list[dict[str, Any]] = []
    materials: dict[tuple[float, ...], int] = {}

    def stored(values: Any, kind: str, component: int, target: int, **more: Any) -> int:
        content = values.tobytes()
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": len(content), "target": target})
        buffer.extend(content)
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": component,
                "count": values.size // (3 if kind == "VEC3" else 1),
            }
            | {"type": kind, **more}
        )
        return len(accessors) - 1

    for stroke, (places, normals, indices) in shapes.items():
        vertices = ((places - middle) * metres)[:, [1, 2, 0]].astype("<f4")
        bounds = {"min": vertices.min(0).tolist(), "max": vertices.max(0).tolist()}
        attributes = {"POSITION": stored(vertices, "VEC3", FLOAT, VERTICES, **bounds)}
        if normals is not None:
            attributes["NORMAL"] = stored(normals[:, [1, 2, 0]].astype("<f4"), "VEC3", FLOAT, VERTICES)
        look = (*sketch.color[stroke].tolist(), float(sketch.opacity[stroke]))
        material = materials.setdefault(look, len(materials))
        primitive = {
            "attributes": attributes,
            "indices": stored(indices.astype("<u4"), "SCALAR", UINT32, INDICES),
            "material": material,
            "mode": LINES if indices.shape[1] == 2 else TRIANGLES,
        }
        meshes.append({"name": f"stroke {stroke}", "primitives": [primitive]})
        nodes.append({"name": f"stroke {stroke}", "mesh": len(meshes) - 1})
    place = (np.asarray(middle)[[1, 2, 0]] * metres).tolist()
    number = {stroke: node for node, stroke in enumerate(shapes)}
    children = _within(grouped(layers, list(shapes)), number, nodes)
    root = {"name": "sketch", "translation": place, "children": children}
    return {
        **one_scene([*nodes, root], meshes),
        "materials": [_material(*look) for look in materials],
        "accessors": accessors,
        "bufferViews": views,
    }


def _within(groups: Mapping[Group, list[int]], number: dict[int, int], nodes: list[dict[str, Any]]) -> list[int]:
    """The numbers of the nodes in a layer: of strokes, and of the layers within it, whose nodes are added."""
    found = []
    for label, inner in outermost(groups).items():
        if not label:
            found += [number[stroke] for stroke in inner[()]]
            continue
        nodes.append({"name": label, "children": _within(inner, number, nodes)})
        found.append(len(nodes) - 1)
    return found


def _material(r: float, g: float, b: float, opacity: float) -> dict[str, Any]:
    """A matt colour; glTF's are linear, those of sketches are sRGB (IEC 61966-2-1)."""
    clamped = [min(max(c, 0.0), 1.0) for c in (r, g, b)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in clamped]
    surface = {"baseColorFactor": [*linear, opacity], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    blend = {"alphaMode": "BLEND"} if opacity < 1 else {}
    name = "#" + "".join(f"{round(c * 255):02x}" for c in clamped)
    return {"name": name, "pbrMetallicRoughness": surface, **blend}
