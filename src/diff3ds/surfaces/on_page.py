"""A surface as the page of .html files takes it: its triangles in few bytes, and the creases that no stroke draws."""

import base64
from dataclasses import dataclass
from typing import Any

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.framing import ball_of
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hidden.lines_of_mesh import RINGS, chords_in_space, creases_along, least_run
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Triangles that a page takes: 4 MB, and in software rendering some frames a second. Empirical.
MOST_TRIANGLES = 200_000
# Steps of coordinates along the longest side: 16 bits, 250 times finer than what counts as on the surface.
STEPS = (1 << 16) - 1


@dataclass(frozen=True, eq=False)
class SurfaceOnPage:
    """A mesh as `sketch_page` takes it.

    Attributes:
        mesh: in the sketch's frame.

    Raises:
        TypeError: another surface.
        ValueError: a mesh of more than 200,000 triangles.
    """

    mesh: TriangleMesh

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, TriangleMesh):
            raise TypeError(f"surface must be a TriangleMesh on a page, got {type(self.mesh).__name__}")
        if len(self.mesh) > MOST_TRIANGLES:
            raise ValueError(
                f"a page takes surfaces of up to {MOST_TRIANGLES} triangles, this one has {len(self.mesh)}: give one "
                "with fewer, simplified by a program for meshes"
            )

    @staticmethod
    def of(surface: TriangleMesh | None) -> "SurfaceOnPage | None":
        """A mesh, where there is one."""
        return None if surface is None else SurfaceOnPage(surface)

    def data(self, sketch: Sketch) -> dict[str, Any]:
        """What a page that shows this sketch knows of it, as JSON; arrays are base64 of little-endian numbers.

        `points` (uint16, S x 3) times `step` plus `low` are corners in world units, of which those at creases are there
        once for each side, so that normals are smooth around each; `faces` (F x 3, uint32 or, where that is enough,
        uint16) number them. Then `bare_creases`. What is nearer than `near` lies on it. Fewer than `least_run` steps
        along a contour are noise, and faces within `rings` rings of one do not hide it.
        """
        mesh = self.mesh
        fan, fans = mesh.fans
        corners = np.zeros((fans, 3))
        corners[fan] = mesh.vertices[mesh.faces.ravel()]
        low, step = mesh.bounds[0], (mesh.size or 1.0) / STEPS
        return {
            "low": low.tolist(),
            "step": step,
            "points": _packed(np.rint((corners - low) / step), "<u2"),
            "faces": _packed(fan.reshape(-1, 3), "<u2" if fans <= STEPS + 1 else "<u4"),
            "wide": bool(fans > STEPS + 1),
            **self.bare_creases(sketch),
            "closed": mesh.is_closed,
            "least_run": least_run(mesh),
            "rings": RINGS,
            "near": mesh.near,
        }

    def bare_creases(self, sketch: Sketch) -> dict[str, Any]:
        """Of `data` what is another for another sketch: creases that no stroke runs along, and how many are convex.

        `creases` (uint32, C x 4) are both ends on one side, and the same on the other, convex ones first, of which
        there are `convex`.
        """
        mesh = self.mesh
        edge = np.flatnonzero(mesh.is_crease & ~creases_along(mesh, chords_in_space(sketch, mesh.near / 4)))
        edge = edge[np.argsort(mesh.turns[edge] <= 0, kind="stable")]
        sides = mesh.edge_faces[edge]
        place = (mesh.faces[sides][:, :, None] == mesh.edges[edge][:, None, :, None]).argmax(3)
        corners = mesh.fans[0].reshape(-1, 3)[sides[..., None], place].reshape(-1, 4)
        return {"creases": _packed(corners, "<u4"), "convex": int((mesh.turns[edge] > 0).sum())}

    def reach(self, *sketches: Sketch) -> float:
        """How far the mesh reaches from the middle of sketches, in radii of their ball."""
        middle, radius = ball_of(*sketches)
        return float(np.linalg.norm(self.mesh.vertices - middle.numpy(), axis=1).max()) / radius


def _packed(values: Float[Array, "..."] | Int[Index, "..."], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values.astype(kind)).tobytes()).decode()
