"""Contours of a mesh from one camera: where its interpolated normals are at right angles to the line of sight."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.page.boxes import in_order
from diff3ds.page.picture import Picture
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class Chain:
    """Points along one contour, each on an edge of the mesh or at a vertex.

    Attributes:
        points: world units; the first is not repeated where the chain closes.
        own: the two vertices of each point's edge, the second twice, or the vertex thrice.
        convex: for each step to the next point, whether the surface bends away from the line of sight there: where it
            does not, a solid hides it. One fewer than points where the chain is open.
        closed: whether the last point goes on to the first.
    """

    points: Float[Array, "M 3"]
    own: Int[Index, "M 3"]
    convex: Bool[Mask, " S"]
    closed: bool

    @property
    def length(self) -> float:
        """From the first point to the last, world units."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class _Steps:
    """Steps of contours, each between two nodes.

    Attributes:
        nodes: of both ends: a place on an edge, on the side of one face where it is a crease, or a vertex.
        points: of both ends.
        own: the vertices that each end lies between.
        convex: as of `Chain`.
    """

    nodes: Int[Index, "S 2"]
    points: Float[Array, "S 2 3"]
    own: Int[Index, "S 2 3"]
    convex: Bool[Mask, " S"]


def contour_chains(mesh: TriangleMesh, picture: Picture, drawn: Bool[Mask, " E"]) -> list[Chain]:
    """The contours, hidden ones too; borders are none.

    Normals are interpolated over the faces, smooth but for creases (`TriangleMesh.corner_normals`). In a face with
    corners towards the camera and corners away from it, the points between make a segment, and segments meet on edges.
    Where the surface turns over at a crease, the contour goes along it.

    Args:
        mesh: what is seen.
        picture: from where.
        drawn: creases that are drawn already: contours do not go along them.
    """
    facing = np.einsum("fki,fki->fk", mesh.corner_normals, picture.towards(mesh.vertices[mesh.faces]))
    parts = [_across_faces(mesh, picture, facing), _along_creases(mesh, facing, mesh.is_crease & ~drawn)]
    joined = [np.concatenate([getattr(part, name) for part in parts]) for name in ("nodes", "points", "own", "convex")]
    nodes, points, own, convex = joined
    found, first, ends = np.unique(nodes, return_index=True, return_inverse=True)
    points, own = points.reshape(-1, 3)[first], own.reshape(-1, 3)[first]
    return [
        Chain(points[run], own[run], convex[steps], closed)
        for run, steps, closed in walks(ends.reshape(-1, 2), len(found))
    ]


def _across_faces(mesh: TriangleMesh, picture: Picture, facing: Float[Array, "F 3"]) -> _Steps:
    ahead = facing >= 0
    mixed = np.flatnonzero(ahead.any(1) & ~ahead.all(1))
    facing, corners, sign = facing[mixed], mesh.vertices[mesh.faces[mixed]], ahead[mixed]
    after = np.roll(np.arange(3), -1)
    # Two edges of each of these faces change sign.
    place = np.argsort(sign == sign[:, after], axis=1, kind="stable")[:, :2]
    row = np.arange(len(mixed))[:, None]
    one, other = place, after[place]
    edge = mesh.face_edges[mixed[:, None], place]
    # Along an edge in the direction of its vertices, so that both faces get the same point to the last bit.
    swapped = mesh.faces[mixed[:, None], one] != mesh.edges[edge, 0]
    one, other = np.where(swapped, other, one), np.where(swapped, one, other)
    share = facing[row, one] / (facing[row, one] - facing[row, other])
    points = corners[row, one] + share[..., None] * (corners[row, other] - corners[row, one])
    # Over a crease normals jump: each face has a point of its own.
    apart = mesh.is_crease[edge] | (mesh.edge_counts[edge] != 2)
    nodes = np.where(apart, _on_side(mesh, mixed[:, None], place), edge)
    return _Steps(nodes, points, mesh.edges[edge][..., [0, 1, 1]], _bends_away(corners, facing, picture))


def _along_creases(mesh: TriangleMesh, facing: Float[Array, "F 3"], chosen: Bool[Mask, " E"]) -> _Steps:
    """Where one side of a crease is turned to the camera and the other is not: its whole length, or a part."""
    edge = np.flatnonzero(chosen)
    ends, faces = mesh.edges[edge], mesh.edge_faces[edge]
    corner = (mesh.faces[faces][:, :, None] == ends[:, None, :, None]).argmax(3)
    values = facing[faces[..., None], corner]
    changes = (values[..., 0] >= 0) != (values[..., 1] >= 0)
    change = values[..., 0] - values[..., 1]
    share = np.where(changes, values[..., 0] / np.where(changes, change, 1.0), 1.0)
    vertex = len(mesh.edges) + 3 * len(mesh.faces) + ends
    place = (mesh.face_edges[faces] == edge[:, None, None]).argmax(2)
    node = np.where(changes, _on_side(mesh, faces, place), vertex[:, 1:])
    order = np.argsort(share, axis=1, kind="stable")
    share, node = np.take_along_axis(share, order, 1), np.take_along_axis(node, order, 1)
    stops = np.column_stack([np.zeros(len(edge)), share, np.ones(len(edge))])
    nodes = np.column_stack([vertex[:, 0], node, vertex[:, 1]])
    middle = (stops[:, None, 1:] + stops[:, None, :-1]) / 2
    ahead = values[..., :1] - change[..., None] * middle >= 0
    turned = (ahead[:, 0] != ahead[:, 1]) & (stops[:, 1:] > stops[:, :-1])
    row, part = np.nonzero(turned)
    t = np.stack([stops[row, part], stops[row, part + 1]], 1)
    a, b = mesh.vertices[ends[row, 0]][:, None], mesh.vertices[ends[row, 1]][:, None]
    own = np.where(t[..., None] == 0, ends[row, None, :1], ends[row][:, None, [0, 1, 1]])
    own = np.where(t[..., None] == 1, ends[row, None, 1:], own)
    return _Steps(
        np.stack([nodes[row, part], nodes[row, part + 1]], 1),
        a + t[..., None] * (b - a),
        own,
        mesh.turns[edge[row]] > 0,
    )


def _on_side(mesh: TriangleMesh, face: Index, place: Index) -> Index:
    """The node on an edge of a face that is on its side alone."""
    return np.asarray(len(mesh.edges) + 3 * face + place)


def _bends_away(corners: Float[Array, "S 3 3"], facing: Float[Array, "S 3"], picture: Picture) -> Bool[Mask, " S"]:
    """Whether the normal turns towards the camera on the way to it: on a ball it does, in a bowl it does not."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    sight = picture.towards(corners.mean(1))
    a, b, c = (np.einsum("si,si->s", x, y) for x, y in ((one, one), (one, other), (other, other)))
    x, y = np.einsum("si,si->s", one, sight), np.einsum("si,si->s", other, sight)
    # The way to the camera in the face's plane is s one + t other, up to the determinant, which is positive.
    s, t = c * x - b * y, a * y - b * x
    return s * (facing[:, 1] - facing[:, 0]) + t * (facing[:, 2] - facing[:, 0]) >= 0


def walks(ends: Int[Index, "S 2"], count: int) -> list[tuple[list[int], list[int], bool]]:
    """Runs of nodes along steps between two each, the steps of each run, and whether it closes.

    Runs begin at nodes of one step, then anywhere, and go on along the first step that none has gone along.
    """
    # A way along a step is a number: twice the step's own from its first end, and one more from the second.
    whose = ends.ravel()
    leaving = in_order(whose)
    first = np.searchsorted(whose[leaving], np.arange(count + 1))
    steps_at = np.diff(first)
    double = first[:-1][steps_at == 2]
    other = np.full(len(whose), -1)
    other[leaving[double]], other[leaving[double + 1]] = leaving[double + 1], leaving[double]
    # How each goes on; -1 where its last node has not just two steps.
    onwards = other[np.arange(len(whose)) ^ 1].tolist()
    nodes_of = whose.tolist()
    seen = bytearray(len(ends))

    def walk(way: int) -> tuple[list[int], list[int], bool]:
        run: list[int] = []
        while way >= 0 and not seen[way >> 1]:
            seen[way >> 1] = 1
            run.append(way)
            way = onwards[way]
            if way < 0:
                here = nodes_of[run[-1] ^ 1]
                ways = leaving[first[here] : first[here + 1]].tolist()
                way = next((way for way in ways if not seen[way >> 1]), -1)
        nodes = [nodes_of[way] for way in run]
        nodes.append(nodes_of[run[-1] ^ 1])
        closed = nodes[-1] == nodes[0]
        return nodes[:-1] if closed else nodes, [way >> 1 for way in run], closed

    ends_first = np.concatenate([leaving[first[:-1][steps_at == 1]], leaving])
    return [walk(way) for way in ends_first.tolist() if not seen[way >> 1]]
