"""Bodies from STEP, IGES and BREP files: their faces as triangles, their own edges as exact strokes; through OCCT."""

import base64
import importlib.util
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._files import check_there
from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.apart import MAX_BYTES, found_apart, meet, say_of
from diff3ds.formats.assembly import ReadStroke, Segment, sketch_of
from diff3ds.formats.cad.step import check_step
from diff3ds.sketch import Sketch

SOLIDS = (".step", ".stp", ".iges", ".igs", ".brep", ".brp")
BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class SolidFile:
    """What a file of solids holds, in millimetres.

    Attributes:
        vertices: of triangles.
        normals: of the faces that they are on, outwards of solids.
        triangles: counter-clockwise as seen from outside.
        face: the face of the file that each triangle is of.
        part: and the part.
        parts: names of the parts.
        faces: names of the faces, such as "bracket/face 7": the part, and the number of the face in it.
        edges: the edges of the parts, such as "bracket/edge 12", but for seams.
        kinds: what each edge is: "crease", "border", or "tangent" between faces that go on in each other.
        deflection: how far triangles may lie off their faces.
    """

    vertices: Float[Array, "V 3"]
    normals: Float[Array, "V 3"]
    triangles: Int[Index, "F 3"]
    face: Int[Index, " F"]
    part: Int[Index, " F"]
    parts: tuple[str, ...]
    faces: tuple[str, ...]
    edges: Sketch
    kinds: tuple[str, ...]
    deflection: float


def read_solids(path: Path, told: Callable[[int, int], None] = lambda done, of: None) -> SolidFile:
    """The bodies of a file, each as often as its assembly has it, placed and named; needs the extra `cad`.

    Parts of one name are numbered. A part without a name has the file's. OCCT reads in a process of its own, in bounded
    time. What is left out is said in a warning.

    Args:
        told: how many bodies are read, and of how many.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: larger than 256 MiB, broken, or without a face.
        OSError: the file cannot be read.
    """
    check_there(path, "solids, a file such as part.step", MAX_BYTES)
    kind = path.suffix[1:].upper()
    if path.suffix.lower() in (".step", ".stp"):
        check_step(path)
    if importlib.util.find_spec("OCP") is None:
        raise ImportError(f"{path}: reading {kind} files takes OCCT: install it with pip install 'diff3ds[cad]'")
    found, said = found_apart(path, "diff3ds.formats.cad.solid_reader", "OCCT", kind, told)
    say_of(path, said)
    names = _numbered([part["name"] or path.stem for part in found["parts"]])
    bodies = [_Body.of(shape) for shape in found["shapes"]]
    placed = [bodies[part["shape"]].at(np.array(part["matrix"])) for part in found["parts"]]
    if not any(len(body.triangles) for body in placed):
        raise ValueError(f"{path}: OCCT makes no triangles of the faces in this {kind} file")
    vertices, faces = (
        np.cumsum([0, *counts]) for counts in ([len(b.points) for b in placed], [b.faces for b in placed])
    )
    edges = [(name, edge) for name, body in zip(names, placed, strict=True) for edge in body.edges]
    return SolidFile(
        np.concatenate([body.points for body in placed]),
        np.concatenate([body.normals for body in placed]),
        np.concatenate([body.triangles + first for body, first in zip(placed, vertices, strict=False)]),
        np.concatenate([body.face + first for body, first in zip(placed, faces, strict=False)]),
        np.repeat(np.arange(len(placed)), [len(body.triangles) for body in placed]),
        tuple(names),
        tuple(f"{name}/face {k + 1}" for name, body in zip(names, placed, strict=True) for k in range(body.faces)),
        _strokes(edges),
        tuple(edge["kind"] for _, edge in edges),
        found["deflection"],
    )


def _numbered(names: Sequence[str]) -> list[str]:
    """The names, those that were there before with a number."""
    seen = Counter[str]()
    made = []
    for name in names:
        seen[name] += 1
        made.append(name if seen[name] == 1 else f"{name} {seen[name]}")
    return made


def _strokes(edges: Sequence[tuple[str, dict[str, Any]]]) -> Sketch:
    """Edges and their parts' names as strokes; of a ball there are none."""
    if not edges:
        return Sketch(torch.zeros(0, 4, 3, dtype=torch.float64))
    read = []
    for _, edge in edges:
        segments: list[Segment] = edge["segments"]
        closed = len(segments) > 1 and meet(segments[-1], segments[0])
        read.append(ReadStroke(segments, closed, BLACK))
    return sketch_of(read).replace(names=[f"{name}/edge {edge['edge']}" for name, edge in edges])


@dataclass(frozen=True, eq=False)
class _Body:
    """A body as it was modelled, or placed."""

    points: Float[Array, "V 3"]
    normals: Float[Array, "V 3"]
    triangles: Int[Index, "F 3"]
    face: Int[Index, " F"]
    faces: int
    edges: list[dict[str, Any]]

    @staticmethod
    def of(shape: dict[str, Any]) -> "_Body":
        """What `solid_reader` tells."""
        points, normals = (_unpacked(shape[name], np.float64).reshape(-1, 3) for name in ("points", "normals"))
        triangles, face = (_unpacked(shape[name], np.int32).astype(np.int64) for name in ("triangles", "face"))
        return _Body(points, normals, triangles.reshape(-1, 3), face - 1, shape["faces"], shape["edges"])

    def at(self, matrix: Float[Array, "3 4"]) -> "_Body":
        """The body where it stands."""
        turn, shift = matrix[:, :3], matrix[:, 3]
        normals = self.normals @ np.linalg.inv(turn)
        edges = [
            {
                **edge,
                "segments": [
                    ((np.array(s["points"]) @ turn.T + shift).tolist(), s["weights"]) for s in edge["segments"]
                ],
            }
            for edge in self.edges
        ]
        return _Body(self.points @ turn.T + shift, normals, self.triangles, self.face, self.faces, edges)


def _unpacked(text: str, kind: type) -> NDArray[Any]:
    return np.frombuffer(base64.b64decode(text), kind)
