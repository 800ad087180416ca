"""Creases at a scale: ridges and valleys of a surface by how much it turns across a band, not between two faces."""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, cast

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.directions import unit
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.surfaces.lines.edge_runs import edge_runs
from diff3ds.surfaces.lines.feature_curves import curves_of, few_pieces
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

# How wide a band is, in longest sides, and in edges of the mesh at least: fewer rows of faces are noise. Empirical.
BAND, ROWS = 0.025, 2.0
# A crease turns by so much across the band, degrees, in the median, and by so much all along. Empirical.
STRONG, WEAK = 45.0, 25.0
# It is so long at least, in longest sides. Empirical.
LEAST = 0.12
# Half a band beside it the surface turns less by so large a share, in the median: along a pipe it turns as much all
# around. Empirical.
PEAK = 0.12
# A ridge and a valley that are nearer than this, in bands, are one line. Empirical.
APART = 0.8
# Rounds in which a line becomes smooth. Empirical.
SMOOTHED = 8
# Curves keep within half of this, in longest sides.
FIT = 1 / 160


Kind = Literal["ridge", "valley"]


def scale_creases(mesh: TriangleMesh, where: Bool[Mask, " F"] | None = None) -> tuple[Curves, tuple[Kind, ...]]:
    """The ridges and valleys of a mesh that turn enough and are long enough to be lines of a drawing.

    Args:
        mesh: whose faces are small beside the band.
        where: faces on which they lie; by default all.

    Returns:
        Curves, and what each is: convex across it, or concave.
    """
    lengths = np.linalg.norm(mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]], axis=1)
    band = max(BAND * mesh.size, ROWS * float(np.median(lengths)))
    tensor, normals = _bends(mesh, lengths, band)
    faces = np.arange(len(mesh)) if where is None else np.flatnonzero(where)
    lines = [
        line
        for kind, bends in (("ridge", tensor), ("valley", -tensor))
        for line in _crests(mesh, faces, bends, normals, band, cast("Kind", kind))
    ]
    lines = _apart(lines, APART * band)
    places = np.concatenate([np.zeros((0, 3)), *(line.points for line in lines)])
    starts = np.cumsum([0, *(len(line.points) for line in lines)]).tolist()
    runs = [list(range(*stops)) for stops in pairwise(starts)]
    for run, line in zip(runs, lines, strict=True):
        if line.closed:
            run[-1] = run[0]
    found = few_pieces(places, runs, FIT * mesh.size)
    pieces = [piece for some in found for piece in some]
    kinds = [line.kind for line, some in zip(lines, found, strict=True) for _, strokes in some for _ in strokes]
    return curves_of(places, pieces), tuple(kinds)


@dataclass(frozen=True, eq=False)
class _Line:
    """A ridge or a valley.

    Attributes:
        kind: which of both.
        points: along it; the last is the first where it is closed.
        strength: by how much the surface turns there across the band, degrees.
        closed: whether it runs round.
    """

    kind: Kind
    points: Float[Array, "M 3"]
    strength: Float[Array, " M"]
    closed: bool


def _apart(lines: list[_Line], least: float) -> list[_Line]:
    """The lines but for those that run along stronger ones of the other kind, as both sides of a groove do."""
    from scipy.spatial import cKDTree

    kept: list[_Line] = []
    for line in sorted(lines, key=lambda one: -float(one.strength.sum())):
        others = [one.points for one in kept if one.kind != line.kind]
        if others and np.median(cKDTree(np.concatenate(others)).query(line.points)[0]) < least:
            continue
        kept.append(line)
    return kept


def _bends(
    mesh: TriangleMesh, lengths: Float[Array, " E"], band: float
) -> tuple[Float[Array, "V 3 3"], Float[Array, "V 3"]]:
    """How much the surface turns a length, at each vertex, along directions in which edges run; and its normals.

    Sums of turns over all edges around (Cohen-Steiner and Morvan 2003), and of normals, weighted alike over the band.
    """
    along = unit(mesh.vertices[mesh.edges[:, 1]] - mesh.vertices[mesh.edges[:, 0]])
    turn = np.nan_to_num(np.radians(mesh.turns)) * lengths
    rows, columns = np.triu_indices(3)
    every = np.column_stack([turn[:, None] * along[:, rows] * along[:, columns], np.zeros((len(turn), 4))])
    count = len(mesh.vertices)
    total = _at_ends(mesh.edges, every / 2, count)
    area = np.repeat(mesh.face_areas / 3, 3)
    total[:, 6] = np.bincount(mesh.faces.ravel(), area, count)
    weighted = np.repeat(mesh.face_normals * (mesh.face_areas / 3)[:, None], 3, axis=0)
    total[:, 7:] = np.stack([np.bincount(mesh.faces.ravel(), weighted[:, k], count) for k in range(3)], 1)
    mixed = _mixing(mesh.edges, count)
    # Each round spreads by half an edge along each of two directions; what counts lies within half a band.
    for _ in range(int(np.ceil((band / float(np.median(lengths))) ** 2 / 2))):
        total = mixed @ total
    tensor = np.empty((count, 3, 3))
    tensor[:, rows, columns] = tensor[:, columns, rows] = total[:, :6] / np.maximum(total[:, 6:7], 1e-300)
    return tensor, unit(total[:, 7:])


def _mixing(edges: Int[Index, "E 2"], count: int) -> "csr_matrix":
    """Half of each vertex's own value, and half of the mean of its neighbours'."""
    from scipy.sparse import coo_matrix, identity

    i, j = np.concatenate([edges, edges[:, ::-1]]).T
    degree = np.maximum(np.bincount(i, minlength=count), 1)
    return (coo_matrix((0.5 / degree[i], (i, j)), shape=(count, count)) + identity(count) / 2).tocsr()


def _at_ends(edges: Int[Index, "E 2"], values: Float[Array, "E K"], count: int) -> Float[Array, "V K"]:
    ends = edges.ravel()
    return np.stack([np.bincount(ends, np.repeat(column, 2), count) for column in values.T], 1)


def _crests(
    mesh: TriangleMesh,
    faces: Index,
    tensor: Float[Array, "V 3 3"],
    normals: Float[Array, "V 3"],
    band: float,
    kind: Kind,
) -> list[_Line]:
    """Lines along which the surface turns most across them."""
    # Edges along a crease turn: the direction with the most is along it.
    tangent = np.eye(3) - normals[:, :, None] * normals[:, None, :]
    values, vectors = np.linalg.eigh(tangent @ tensor @ tangent)
    turn = np.degrees(values[:, 2] * band)
    across = np.cross(normals, vectors[:, :, 2])
    slope = (_gradient(mesh, turn) * across).sum(1)
    steps, places, strength, fall = _steps(mesh, faces, turn, across, slope)
    # Of a parabola half a band from its top.
    peak = fall * band * band / 8 / np.maximum(strength, WEAK)
    runs = [run for run in _long(places, steps, strength, LEAST * mesh.size) if np.median(peak[run]) > PEAK]
    return [_Line(kind, _smoothed(places[run]), strength[run], run[0] == run[-1]) for run in runs]


def _gradient(mesh: TriangleMesh, values: Float[Array, " V"]) -> Float[Array, "V 3"]:
    """How values of vertices grow over the surface, by area from the faces around."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    opposite = np.stack([c - b, a - c, b - a], 1)
    turned = np.cross(mesh.face_normals[:, None], opposite)
    # Twice the area cancels against the weights.
    of_faces = np.einsum("fk,fki->fi", values[mesh.faces], turned) / 2
    corners = mesh.faces.ravel()
    total = np.stack([np.bincount(corners, np.repeat(of_faces[:, k], 3), len(values)) for k in range(3)], 1)
    area = np.bincount(corners, np.repeat(mesh.face_areas, 3), len(values))
    return total / np.maximum(area, 1e-300)[:, None]


def _steps(
    mesh: TriangleMesh,
    faces: Index,
    turn: Float[Array, " V"],
    across: Float[Array, "V 3"],
    slope: Float[Array, " V"],
) -> tuple[Int[Index, "S 2"], Float[Array, "P 3"], Float[Array, " P"], Float[Array, " P"]]:
    """Steps of crests through faces, between points of their edges where the slope across turns from up to down.

    And how much the surface turns at these points, and by how much the slope falls there, a length.
    """
    corners = mesh.faces[faces]
    sign = np.sign((across[corners] * across[corners[:, :1]]).sum(2))
    direction, slope_here = sign[..., None] * across[corners], sign * slope[corners]
    found = []
    for k in range(3):
        n = (k + 1) % 3
        way = mesh.vertices[corners[:, n]] - mesh.vertices[corners[:, k]]
        ahead = (way * (direction[:, k] + direction[:, n])).sum(1)
        # Up to a crest from both ends.
        found.append(
            (slope_here[:, k] * slope_here[:, n] < 0) & (slope_here[:, k] * ahead > 0) & (turn[corners[:, k]] > 0)
        )
    both = np.stack(found, 1)
    rows = np.flatnonzero(both.sum(1) == 2)
    sides = np.argsort(~both[rows], axis=1, kind="stable")[:, :2]
    keys, steps = np.unique(mesh.face_edges[faces[rows][:, None], sides], return_inverse=True)
    one, other = mesh.edges[keys].T
    low, high = np.abs(slope[one]), np.abs(slope[other])
    share = low / np.maximum(low + high, 1e-300)
    places = mesh.vertices[one] + share[:, None] * (mesh.vertices[other] - mesh.vertices[one])
    apart = np.abs(((mesh.vertices[other] - mesh.vertices[one]) * across[one]).sum(1))
    fall = (low + high) / np.maximum(apart, 1e-9 * mesh.size)
    return steps.reshape(-1, 2), places, turn[one] + share * (turn[other] - turn[one]), fall


def _long(
    places: Float[Array, "P 3"], steps: Int[Index, "S 2"], strength: Float[Array, " P"], least: float
) -> list[list[int]]:
    """Lines of steps that are nowhere weak, strong for the most part, and long."""
    steps = steps[strength[steps].min(1) > WEAK]
    out = []
    # They turn from face to face: no such turn is a corner.
    for run, _ in edge_runs(places, steps, np.zeros(len(steps), bool), lambda before, _: np.zeros(len(before), bool)):
        points = places[run]
        length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        if length >= least and np.median(strength[run]) > STRONG:
            out.append(run)
    return out


def _smoothed(points: Float[Array, "M 3"]) -> Float[Array, "M 3"]:
    """Points along a line without its turns from face to face; its ends stay."""
    for _ in range(SMOOTHED):
        points = points.copy()
        points[1:-1] = points[1:-1] / 2 + (points[:-2] + points[2:]) / 4
    return points
