"""3D points on edges: a ridge point and its camera span a plane, and an edge is where many planes meet in a line."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.first.carve import CELL, CHUNK
from diff3ds.edges.watch import Tick, no_tick
from diff3ds.parallel.in_copies import in_copies
from diff3ds.render.backends import kernels

# [rounds; empirical] Rounds of moving points onto the edges.
ROUNDS = 8
# [px, px, ratio; empirical] Standard deviation of the distances, falling from round to round: wide enough for the
# cells of the carving at first, then the scatter of ridges.
FIRST_SIGMA, LAST_SIGMA, SIGMA_RATIO = 2.0, 0.6, 0.75
# [standard deviations; numerical] Ridges farther off than this do not count at all.
CUT_OFF = 3.0
# [cosine; empirical] Cosine between an edge and a plane's normal at which the plane counts a quarter; the first
# directions are rough.
FIRST_TILT, TILT = 0.2, 0.12
# [rounds; empirical] Rounds of reweighting the first directions.
DIRECTION_ROUNDS = 3
# [ratio; numerical] Damping of the step across the edge, relative to the trace of its normal matrix.
DAMPING = 0.02
# [px; empirical] Points that come together in a cube of this side go on as one.
MERGED = 0.5


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """M points on 3D edges.

    Attributes:
        points: world units.
        directions: unit vectors along the edges, of either sign.
        scores: sums of the views' weights: about how many views agree.
    """

    points: Float[Array, "M 3"]
    directions: Float[Array, "M 3"]
    scores: Float[Array, " M"]

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, index: NDArray[Any]) -> "EdgePoints":
        return EdgePoints(self.points[index], self.directions[index], self.scores[index])

    def best_first(self) -> "EdgePoints":
        """Sorted by falling score."""
        return self[np.argsort(-self.scores, kind="stable")]


def triangulate(
    views: EdgeViews,
    starts: Float[Array, "M 3"],
    least_score: float,
    tick: Tick = no_tick,
) -> EdgePoints:
    """Moves points onto the edges near them; those that too few views confirm are dropped.

    Args:
        starts: near edges, a few pixels.
        least_score: of a point to stay, at the end; half of it on the way.
        tick: see `watch`.
    """
    count = -(-len(starts) // CHUNK)
    parts = in_copies(
        lambda k: _triangulated(views, starts[k * CHUNK : (k + 1) * CHUNK], least_score),
        count,
        count,
        lambda done: tick(min(done * CHUNK, len(starts)), len(starts)),
    )
    if not parts:
        return EdgePoints(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    return EdgePoints(*(np.concatenate([getattr(p, n) for p in parts]) for n in ("points", "directions", "scores")))


def _triangulated(views: EdgeViews, x: Float[Array, "M 3"], least_score: float) -> EdgePoints:
    # No farther than the cells that they came from.
    longest = CELL * views.pixel
    directions: Array | None = None
    scores = np.zeros(len(x))
    for turn in range(ROUNDS):
        sigma = max(FIRST_SIGMA * SIGMA_RATIO**turn, LAST_SIGMA)
        x, directions, scores = _settled(views, x, directions, sigma, longest)
        if turn >= 2:
            stay = _best_of_voxels(x, scores, MERGED * views.pixel)
            stay = stay[scores[stay] >= (least_score if turn == ROUNDS - 1 else least_score / 2)]
            x, directions, scores = x[stay], directions[stay], scores[stay]
    assert directions is not None
    return EdgePoints(x, directions, scores)


def _settled(
    views: EdgeViews, x: Float[Array, "M 3"], directions: Float[Array, "M 3"] | None, sigma: float, longest: float
) -> tuple[Float[Array, "M 3"], Float[Array, "M 3"], Float[Array, " M"]]:
    """Points moved to the planes nearby, the directions in which these meet, and the sums of their weights."""
    if kernel := getattr(kernels(), "edges_settled", None):
        tilt, rounds = (FIRST_TILT, DIRECTION_ROUNDS) if directions is None else (TILT, 1)
        known = None if directions is None else torch.from_numpy(directions)
        given = torch.from_numpy(views.planes), torch.from_numpy(np.ascontiguousarray(x)), known
        found, axes, scores = kernel(views.tables, *given, sigma, CUT_OFF * sigma, tilt, rounds, DAMPING, longest)
        return found, axes, scores
    match = views.match(x)
    # One component after the other: what follows goes over each of them in a row.
    planes = np.moveaxis(np.ascontiguousarray(np.moveaxis(views.planes.take(match.ridge, 0), -1, 0)), 0, -1)
    normals = planes[..., :3]
    near = np.exp(-0.5 * (match.distance / sigma) ** 2) * (match.distance < CUT_OFF * sigma)
    if directions is None:
        weights, directions = _first_directions(near, normals)
    else:
        weights = near * _along(normals, directions, TILT)
        directions = _axis(weights, normals)
    residual = np.einsum("vmk,mk->vm", normals, x) + planes[..., 3]
    return x + _step(weights, normals, residual, directions, longest), directions, weights.sum(0)


def _first_directions(near: Array, normals: Array) -> tuple[Array, Array]:
    """Reweighted directions: hidden edges leave wrong planes in many views."""
    weights = near
    directions = _axis(weights, normals)
    for _ in range(DIRECTION_ROUNDS - 1):
        weights = weights * _along(normals, directions, FIRST_TILT)
        directions = _axis(weights, normals)
    return weights, directions


def _along(normals: Array, directions: Array, tilt: float) -> Float[Array, "V M"]:
    """Weights of planes by how well they contain a direction."""
    cosine = np.einsum("vmk,mk->vm", normals, directions)
    return 1 / (1 + (cosine / tilt) ** 2) ** 2


def _axis(weights: Array, normals: Array) -> Float[Array, "M 3"]:
    """The direction most nearly orthogonal to all normals."""
    _, vectors = np.linalg.eigh(_scatter(weights, normals))
    return np.asarray(vectors[:, :, 0])


def _scatter(weights: Array, normals: Array) -> Float[Array, "M 3 3"]:
    # Six sums of products are six times as fast as one sum of matrices.
    across = [normals[..., k] for k in range(3)]
    weighted = [weights * axis for axis in across]
    sums = {(i, j): np.einsum("vm,vm->m", weighted[i], across[j]) for i in range(3) for j in range(i, 3)}
    return np.stack([np.stack([sums[min(i, j), max(i, j)] for j in range(3)], -1) for i in range(3)], 1)


def _step(weights: Array, normals: Array, residual: Array, directions: Array, longest: float) -> Float[Array, "M 3"]:
    """The damped least squares step to the planes, across the edge, of limited length."""
    matrix = _scatter(weights, normals)
    right = -np.einsum("vm,vmi->mi", weights * residual, normals)
    damping = DAMPING * np.trace(matrix, axis1=1, axis2=2) + 1e-9
    step = np.linalg.solve(matrix + damping[:, None, None] * np.eye(3), right[..., None])[..., 0]
    step = step - (step * directions).sum(1, keepdims=True) * directions
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return step * np.minimum(1, longest / np.maximum(length, 1e-12))


def _best_of_voxels(x: Float[Array, "M 3"], scores: Float[Array, " M"], side: float) -> NDArray[np.int64]:
    """Indices of the best point in every voxel, in order of the voxels."""
    voxel = np.floor(x / side).astype(np.int64)
    order = np.lexsort((-scores, voxel[:, 2], voxel[:, 1], voxel[:, 0]))
    ordered = voxel[order]
    first = np.ones(len(x), bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(1)
    return order[first]


def thinned(found: EdgePoints, apart: float, flank: float) -> EdgePoints:
    """The best of points that lie together.

    Args:
        apart: no two points stay within this distance, world units.
        flank: within this distance, a point to the side of a better one is dropped if it runs the same way, or is much
            worse: the flank of an edge is no second edge.
    """
    from scipy.spatial import cKDTree

    found = found.best_first()
    alive = np.ones(len(found), bool)
    for i, near in enumerate(cKDTree(found.points).query_ball_point(found.points, apart) if len(found) else []):
        if alive[i]:
            later = np.array(near)
            alive[later[later > i]] = False
    found = found[alive]
    alive = np.ones(len(found), bool)
    for i, near in enumerate(cKDTree(found.points).query_ball_point(found.points, flank) if len(found) else []):
        if alive[i]:
            later = np.array(near)
            alive[_flanking(found, i, later[later > i])] = False
    return found[alive]


# [cosine, fraction; empirical] Directions to this angle count as the same way, and scores below this fraction as much
# worse.
SAME_WAY, MUCH_WORSE = 0.9, 0.6


def _flanking(found: EdgePoints, i: int, others: NDArray[np.int64]) -> NDArray[np.int64]:
    apart = found.points[others] - found.points[i]
    along = np.abs(apart @ found.directions[i])
    across = np.sqrt(np.maximum((apart**2).sum(1) - along**2, 0))
    parallel = np.abs(found.directions[others] @ found.directions[i]) > SAME_WAY
    return others[(across > along) & (parallel | (found.scores[others] < MUCH_WORSE * found.scores[i]))]
