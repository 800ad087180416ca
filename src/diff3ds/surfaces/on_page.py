"""A surface as the page of .html files takes it: its triangles in few bytes, and the creases that no stroke draws."""

import base64
from typing import Any

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.framing import ball_of
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hidden.mesh_seen import RINGS, creases_along, least_run
from diff3ds.surfaces.shape.nearest import ON_SURFACE
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Triangles that a page takes: 4 MB, and in software rendering some frames a second. Empirical.
MOST_TRIANGLES = 200_000
# Steps of coordinates along the longest side: 16 bits, 250 times finer than what counts as on the surface.
STEPS = (1 << 16) - 1


def surface_on_page(surface: object, sketch: Sketch) -> dict[str, Any]:
    """What a page knows of a surface, as JSON has it; arrays are base64 of little-endian numbers.

    `points` (uint16, S x 3) times `step` plus `low` are corners in world units, of which those at creases are there
    once for each side, so that normals are smooth around each; `faces` (F x 3, uint32 or, where that is enough,
    uint16) number them. `creases` (uint32, C x 4) are those that no stroke of the sketch draws: both ends on one side,
    and the same on the other, convex ones first, of which there are `convex`. What is nearer than `near` lies on it.
    Fewer than `least_run` steps along a contour are noise, and faces within `rings` rings of one do not hide it.

    Args:
        surface: a `TriangleMesh` in the sketch's frame.
        sketch: what is shown with it.

    Raises:
        TypeError: another surface.
        ValueError: a mesh of more than 200,000 triangles.
    """
    if not isinstance(surface, TriangleMesh):
        raise TypeError(f"surface must be a TriangleMesh on a page, got {type(surface).__name__}")
    check_size(surface)
    fan, fans = surface.fans
    corners = np.zeros((fans, 3))
    corners[fan] = surface.vertices[surface.faces.ravel()]
    faces = fan.reshape(-1, 3)
    low, step = surface.bounds[0], (surface.size or 1.0) / STEPS
    return {
        "low": low.tolist(),
        "step": step,
        "points": _packed(np.rint((corners - low) / step), "<u2"),
        "faces": _packed(faces, "<u2" if fans <= STEPS + 1 else "<u4"),
        "wide": bool(fans > STEPS + 1),
        **_bare_creases(surface, faces, sketch),
        "closed": surface.is_closed,
        "least_run": least_run(surface),
        "rings": RINGS,
        "near": ON_SURFACE * surface.size,
    }


def bare_creases(surface: TriangleMesh, sketch: Sketch) -> dict[str, Any]:
    """Of `surface_on_page` what is another for another sketch."""
    return _bare_creases(surface, surface.fans[0].reshape(-1, 3), sketch)


def check_size(surface: TriangleMesh) -> None:
    """Sees that a page takes so large a surface.

    Raises:
        ValueError: it does not.
    """
    if len(surface) > MOST_TRIANGLES:
        raise ValueError(
            f"a page takes surfaces of up to {MOST_TRIANGLES} triangles, this one has {len(surface)}: give one with "
            "fewer, simplified by a program for meshes"
        )


def reach_of(surface: TriangleMesh, *sketches: Sketch) -> float:
    """How far a surface reaches from the middle of sketches, in radii of their ball."""
    middle, radius = ball_of(*sketches)
    return float(np.linalg.norm(surface.vertices - middle.numpy(), axis=1).max()) / radius


def _bare_creases(mesh: TriangleMesh, faces: Int[Index, "F 3"], sketch: Sketch) -> dict[str, Any]:
    """Creases that no stroke runs along, as corners of both sides, the convex ones first, and how many these are."""
    edge = np.flatnonzero(mesh.is_crease & ~creases_along(mesh, sketch))
    edge = edge[np.argsort(mesh.turns[edge] <= 0, kind="stable")]
    sides = mesh.edge_faces[edge]
    place = (mesh.faces[sides][:, :, None] == mesh.edges[edge][:, None, :, None]).argmax(3)
    corners = faces[sides[..., None], place].reshape(-1, 4)
    return {"creases": _packed(corners, "<u4"), "convex": int((mesh.turns[edge] > 0).sum())}


def _packed(values: Float[Array, "..."] | Int[Index, "..."], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values.astype(kind)).tobytes()).decode()
