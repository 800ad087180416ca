"""Hidden-line removal: which pieces of sharp edges, of contours of curved faces, and of smooth edges a view shows."""

from dataclasses import dataclass

import numpy as np

from cad.boundary import Edge, Mesh
from cad.raster import SAMPLES, SIDE, Buffer
from cad.views import View

SHARP, CONTOUR, SMOOTH = 0, 1, 2
# A surface hides a point when it is nearer by more than this: some times the mesh's distance from the surface (3e-4).
TOLERANCE = 2e-3
STEP = 0.005  # length of a piece; at most one pixel


@dataclass(frozen=True)
class Pieces:
    """Short straight pieces of lines in space: ends (n, 2, 3), kind (n,), and their edge (n,), -1 for contours."""

    ends: np.ndarray
    kind: np.ndarray
    edge: np.ndarray

    def choose(self, chosen: np.ndarray) -> "Pieces":
        """Those that a mask or indices pick."""
        return Pieces(self.ends[chosen], self.kind[chosen], self.edge[chosen])


def pieces_of_edges(edges: list[Edge], kind: int) -> Pieces:
    """The edges' samples, two by two."""
    ends = [np.stack([edge.points[:-1], edge.points[1:]], 1) for edge in edges]
    number = np.repeat(np.arange(len(edges)), [len(e) for e in ends])
    joined = np.concatenate(ends) if ends else np.zeros((0, 2, 3))
    return Pieces(joined, np.full(len(joined), kind), number)


def contours(mesh: Mesh, view: View) -> Pieces:
    """Where curved faces turn away from the view: zeros of (normal . direction to the eye), linear in each triangle."""
    facing = (mesh.normals * (view.eye - mesh.vertices)).sum(1)[mesh.triangles]
    crossing = (facing > 0).any(1) & (facing <= 0).any(1)
    facing, corners = facing[crossing], mesh.vertices[mesh.triangles[crossing]]
    positive = facing > 0
    # The corner whose sign is alone, then the crossings of the two sides that meet in it.
    alone = np.where(positive.sum(1) == 1, positive.argmax(1), (~positive).argmax(1))
    rows = np.arange(len(alone))
    ends = []
    for other in ((alone + 1) % 3, (alone + 2) % 3):
        f, g = facing[rows, alone], facing[rows, other]
        t = (f / (f - g))[:, None]
        ends.append(corners[rows, alone] * (1 - t) + corners[rows, other] * t)
    return _subdivided(np.stack(ends, 1))


def _subdivided(ends: np.ndarray) -> Pieces:
    """Segments (n, 2, 3) cut into pieces no longer than STEP."""
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    ends, length = ends[length > 1e-9], length[length > 1e-9]
    count = np.ceil(length / STEP).astype(int)
    index = np.repeat(np.arange(len(ends)), count)
    k = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
    start, step = ends[index, 0], (ends[index, 1] - ends[index, 0]) / count[index, None]
    pieces = np.stack([start + step * k[:, None], start + step * (k[:, None] + 1)], 1)
    return Pieces(pieces, np.full(len(pieces), CONTOUR), np.full(len(pieces), -1))


def visible(pieces: Pieces, buffer: Buffer, view: View) -> np.ndarray:
    """Whether the middle of each piece is seen: one of the four samples around it shows no surface in front of it.

    A line through a point between four samples has samples on both sides, so an outline always has one beyond it.
    A surface is in front when its plane, carried on to the point but not beyond the triangle's own depths, is nearer by
    TOLERANCE; so the faces that meet in an edge never hide it, however steep.
    """
    pixels, depth = view.project(pieces.ends.mean(1))
    xy = pixels * SAMPLES
    seen = np.zeros(len(xy), bool)
    for dx in (-0.5, 0.5):
        for dy in (-0.5, 0.5):
            column = np.clip(np.floor(xy[:, 0] + dx).astype(int), 0, SIDE - 1)
            row = np.clip(np.floor(xy[:, 1] + dy).astype(int), 0, SIDE - 1)
            index = buffer.triangle[row, column]
            inverse = (buffer.planes[index] * np.column_stack([xy, np.ones(len(xy))])).sum(1)
            inverse = np.clip(inverse, *buffer.bounds[index].T)
            seen |= (index < 0) | (1 / inverse > depth - TOLERANCE)
    return seen
