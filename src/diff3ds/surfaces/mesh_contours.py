"""Contours of a mesh from one camera: where its interpolated normals are at right angles to the line of sight."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Int
from diff3ds.surfaces.arrays import Index, Mask
from diff3ds.surfaces.mesh import TriangleMesh
from diff3ds.surfaces.mesh_view import Picture


@dataclass(frozen=True, eq=False)
class Chain:
    """Points along one contour, each on an edge of the mesh.

    Attributes:
        points: world units; the first is not repeated where the chain closes.
        own: the two vertices of each point's edge, the second twice.
        convex: for each step to the next point, whether the surface bends away from the line of sight there: where it
            does not, a solid hides it. One fewer than points where the chain is open.
        closed: whether the last point goes on to the first.
    """

    points: Float[Array, "M 3"]
    own: Int[Index, "M 3"]
    convex: Bool[Mask, " S"]
    closed: bool


def contour_chains(mesh: TriangleMesh, picture: Picture) -> list[Chain]:
    """The contours of the smooth parts, hidden ones too; creases and borders are none.

    Normals are interpolated over the faces, smooth but for creases (`TriangleMesh.corner_normals`). In a face with
    corners towards the camera and corners away from it, the points between make a segment, and segments meet on edges.
    """
    corners = mesh.vertices[mesh.faces]
    facing = np.einsum("fki,fki->fk", mesh.corner_normals, picture.towards(corners))
    ahead = facing >= 0
    mixed = np.flatnonzero(ahead.any(1) & ~ahead.all(1))
    facing, corners, sign = facing[mixed], corners[mixed], ahead[mixed]
    after = np.roll(np.arange(3), -1)
    # Two edges of each of these faces change sign.
    changes = sign != sign[:, after]
    place = np.argsort(~changes, axis=1, kind="stable")[:, :2]
    row = np.arange(len(mixed))[:, None]
    one, other = place, after[place]
    edge = mesh.face_edges[mixed[:, None], place]
    # Along an edge in the direction of its vertices, so that both faces get the same point to the last bit.
    swapped = mesh.faces[mixed[:, None], one] != mesh.edges[edge, 0]
    one, other = np.where(swapped, other, one), np.where(swapped, one, other)
    share = facing[row, one] / (facing[row, one] - facing[row, other])
    points = corners[row, one] + share[..., None] * (corners[row, other] - corners[row, one])
    # Over a crease normals jump, and contours end: each face has a point of its own.
    apart = mesh.is_crease[edge] | (mesh.edge_counts[edge] != 2)
    node = np.where(apart, len(mesh.edges) + 3 * mixed[:, None] + place, edge)
    nodes, first, ends = np.unique(node, return_index=True, return_inverse=True)
    own = mesh.edges[edge.ravel()[first]]
    convex = _bends_away(corners, facing, picture)
    return [
        Chain(points.reshape(-1, 3)[first[run]], own[run][:, [0, 1, 1]], convex[steps], closed)
        for run, steps, closed in _walks(ends.reshape(-1, 2), len(nodes))
    ]


def _bends_away(corners: Float[Array, "S 3 3"], facing: Float[Array, "S 3"], picture: Picture) -> Bool[Mask, " S"]:
    """Whether the normal turns towards the camera on the way to it: on a ball it does, in a bowl it does not."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    sight = picture.towards(corners.mean(1))
    a, b, c = (np.einsum("si,si->s", x, y) for x, y in ((one, one), (one, other), (other, other)))
    x, y = np.einsum("si,si->s", one, sight), np.einsum("si,si->s", other, sight)
    # The way to the camera in the face's plane is s one + t other, up to the determinant, which is positive.
    s, t = c * x - b * y, a * y - b * x
    return s * (facing[:, 1] - facing[:, 0]) + t * (facing[:, 2] - facing[:, 0]) >= 0


def _walks(ends: Int[Index, "S 2"], count: int) -> list[tuple[list[int], list[int], bool]]:
    """Runs of nodes along steps between two each, the steps of each run, and whether it closes.

    A node has one or two steps.
    """
    steps_at: list[list[int]] = [[] for _ in range(count)]
    for step, (a, b) in enumerate(ends.tolist()):
        steps_at[a].append(step)
        steps_at[b].append(step)
    pairs = ends.tolist()
    seen = [False] * len(pairs)
    walks: list[tuple[list[int], list[int], bool]] = []
    starts = [n for n in range(count) if len(steps_at[n]) == 1]
    for start in (*starts, *range(count)):
        run: list[int] = [start]
        steps: list[int] = []
        while (step := next((s for s in steps_at[run[-1]] if not seen[s]), -1)) >= 0:
            seen[step] = True
            steps.append(step)
            a, b = pairs[step]
            run.append(b if run[-1] == a else a)
        if steps:
            closed = run[-1] == start
            walks.append((run[:-1] if closed else run, steps, closed))
    return walks
