"""A mesh or a cloud of points as samples of a surface: places, normals, neighbours, and the scale of their noise."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.directions import unit
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

# Of meshes of no more faces than this the faces are the samples. Empirical.
FEW_FACES = 16_000
# Neighbours of a point of a cloud: a plane's normal from fewer is uncertain. Empirical.
NEIGHBOURS = 12
# Points whose scatter is measured, and the numbers of neighbours to which quadrics are fitted.
MEASURED, FEWEST, AROUND = 1500, 12, (20, 48)
# Samples farther apart than this, as a share of the longest side, have few neighbours on one form. Empirical.
COARSE = 0.02
# Most of the surface lies within a patch that has no edge; so large a share of the patches do. Empirical.
SMOOTH_SHARE = 0.35
# Of independent noise the fewest neighbours show so large a part, or more. What is off by more than BUMPY longest sides
# but not independent is no noise: wool, or a rack. Empirical.
SHOWN, BUMPY = 0.7, 0.0015
# A patch is flat where a quadric through so many points leaves so large a share of what a plane leaves, which is so
# little of how far they spread. Empirical.
FLAT_AROUND, NO_BETTER, FLATTEST = 20, 0.7, 0.1
# Bumps are wider than a patch of few points: of so many points, where at least so many patches are flat, those that are
# flatter than all but so few. Empirical.
WIDE_AROUND, LEAST_FLAT, FLATTEST_SHARE = 144, 0.1, 0.1
# Rounds in which normals become those of their neighbours that point alike, and how far apart such normals are at
# most, radians. Empirical.
ROUNDS, ALIKE = 6, 0.35


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a surface, all alike whether they were a mesh's vertices or a cloud's points.

    Attributes:
        points: world units.
        normals: unit vectors; outwards where `oriented`, else either way.
        pairs: neighbours, each pair once, the smaller number first.
        oriented: whether the normals say what is outside.
        spacing: how far a sample is from its nearest neighbours, median, world units.
        noise: standard deviation of the distances of samples from a smooth surface, world units.
        independent: what few neighbours show of that: less than `SHOWN` where neighbours are off alike, as bumps are.
        size: the longest side of the box, world units.
        measured: points of the surface itself: the samples, or the vertices of the faces whose middles they are.
        corners: of each sample the rows of `measured` that it is the middle of; None where it is one of them.
    """

    points: Float[Array, "N 3"]
    normals: Float[Array, "N 3"]
    pairs: Int[Index, "P 2"]
    oriented: bool
    spacing: float
    noise: float
    independent: float
    size: float
    measured: Float[Array, "V 3"]
    corners: Int[Index, "N 3"] | None = None

    def places(self, rows: Int[Index, " R"]) -> Float[Array, "P 3"]:
        """Points of the surface that some samples stand for."""
        return self.measured[rows if self.corners is None else np.unique(self.corners[rows])]

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def graph(self) -> "csr_matrix":
        """Neighbours as a symmetric matrix of ones."""
        from scipy.sparse import coo_matrix

        i, j = self.pairs.T
        ones = np.ones(2 * len(i), np.float32)
        return coo_matrix((ones, (np.r_[i, j], np.r_[j, i])), shape=(len(self), len(self))).tocsr()

    @cached_property
    def middle(self) -> Float[Array, " 3"]:
        """The mean of all samples."""
        return np.asarray(self.points.mean(0))

    @classmethod
    def of_mesh(cls, mesh: TriangleMesh) -> "Samples":
        """The vertices of a mesh, whose edges say which are neighbours; of one of few faces the middles of these.

        Most vertices of a coarse mesh lie at edges of the shape, where they have no normal.
        """
        if len(mesh) <= FEW_FACES:
            two = mesh.edge_counts == 2
            middles = mesh.vertices[mesh.faces].mean(1)
            pairs = np.sort(mesh.edge_faces[two], axis=1)
            return _measured(middles, mesh.face_normals, pairs, True, mesh.vertices, mesh.faces)
        weighted = mesh.corner_angles[..., None] * mesh.face_normals[:, None]
        total: Array = np.stack([np.bincount(mesh.faces.ravel(), weighted[..., k].ravel()) for k in range(3)], 1)
        return _measured(mesh.vertices, unit(total), mesh.edges, True)

    @classmethod
    def of_points(cls, points: Float[Array, "N 3"], normals: Float[Array, "N 3"] | None = None) -> "Samples":
        """Points of a cloud; normals are those of planes through their neighbours where there are none."""
        from scipy.spatial import cKDTree

        points = np.asarray(points, float)
        _, near = cKDTree(points).query(points, k=min(NEIGHBOURS + 1, len(points)), workers=-1)
        own, other = np.repeat(np.arange(len(points)), near.shape[1] - 1), near[:, 1:].ravel()
        keys = np.unique(np.minimum(own, other) * len(points) + np.maximum(own, other))
        pairs = np.stack(np.divmod(keys, len(points)), 1)
        if normals is None:
            around = points[near] - points[near].mean(1, keepdims=True)
            normals = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1][:, :, 0]
            return _measured(points, normals, pairs, False)
        return _measured(points, unit(np.asarray(normals, np.float64)), pairs, True)


def _measured(
    points: Array,
    normals: Array,
    pairs: Index,
    oriented: bool,
    measured: Array | None = None,
    corners: Index | None = None,
) -> Samples:
    """Samples with their scales, and with normals that noise has less of."""
    measured = points if measured is None else measured
    lengths = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    size = float(np.ptp(points, axis=0).max())
    spacing = float(np.median(lengths))
    # Few neighbours say less of waves, many more of edges.
    noise, least = (_noise(measured, around) for around in (AROUND[int(spacing < COARSE * size)], FEWEST))
    independent = least / max(noise, 1e-300)
    noise = max(min(noise, max(least / SHOWN, BUMPY * size)), _bumps(measured))
    steady = _steadied(points, normals, pairs, noise, spacing)
    return Samples(points, steady, pairs, oriented, spacing, noise, independent, size, measured, corners)


def _noise(points: Float[Array, "N 3"], around: int) -> float:
    """Root mean square distance of points from quadrics through their neighbours, where these fit well."""
    some = np.linspace(0, len(points) - 1, min(MEASURED, len(points))).astype(int)
    return float(np.quantile(_patches(points, some, around)[0], SMOOTH_SHARE))


def flat_share(mesh: TriangleMesh) -> float:
    """The share of a mesh's area that is flat but for noise, in [0, 1]."""
    area = np.cumsum(np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas, 3), len(mesh.vertices)))
    some = np.searchsorted(area, (np.arange(MEASURED) + 0.5) / MEASURED * area[-1])
    return float(_flat(mesh.vertices, some, FLAT_AROUND)[0].mean())


def _bumps(points: Float[Array, "N 3"]) -> float:
    """How far points are off planes where large patches are flat, in the flattest of these; 0 where few are."""
    if len(points) < 4 * WIDE_AROUND:
        return 0.0
    flat, off = _flat(points, np.linspace(0, len(points) - 1, MEASURED).astype(int), WIDE_AROUND)
    return float(np.quantile(off[flat], FLATTEST_SHARE)) if flat.mean() > LEAST_FLAT else 0.0


def _flat(
    points: Float[Array, "N 3"], some: Int[Index, " M"], around: int
) -> tuple[Bool[Mask, " M"], Float[Array, " M"]]:
    """Which points have flat patches around them, and how far all these are off planes."""
    off, from_plane, across = _patches(points, some, around)
    return (off > NO_BETTER * from_plane) & (from_plane < FLATTEST * across), from_plane


def _patches(
    points: Float[Array, "N 3"], some: Int[Index, " M"], around: int
) -> tuple[Float[Array, " M"], Float[Array, " M"], Float[Array, " M"]]:
    """How far some points and their neighbours are off quadrics and off planes, and how far they spread."""
    from scipy.spatial import cKDTree

    _, near = cKDTree(points).query(points[some], k=min(around, len(points)), workers=-1)
    local = points[near] - points[near].mean(1, keepdims=True)
    spread, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", local, local))
    z, x, y = np.moveaxis(local @ axes, 2, 0)
    scale = np.maximum(np.sqrt((x * x + y * y).mean(1, keepdims=True)), 1e-300)
    x, y = x / scale, y / scale
    design = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 2)
    solved = np.linalg.pinv(design) @ z[..., None]
    off = z - (design @ solved)[..., 0]
    left = np.sqrt((off * off).sum(1) / max(off.shape[1] - 6, 1))
    return left, np.sqrt(np.maximum(spread[:, 0], 0) / max(off.shape[1] - 3, 1)), scale[:, 0]


def _steadied(points: Array, normals: Array, pairs: Index, noise: float, spacing: float) -> Float[Array, "N 3"]:
    """Normals as those of the neighbours that point alike, so often as noise asks for."""
    from scipy.sparse import coo_matrix

    # Noise of so many spacings turns normals by as many radians; each round takes about two thirds of that away.
    rounds = int(np.clip(np.ceil(np.log(max(noise / spacing / 0.02, 1)) / np.log(1.7)), 0, ROUNDS))
    i, j = (
        np.r_[pairs[:, 0], pairs[:, 1], np.arange(len(points))],
        np.r_[pairs[:, 1], pairs[:, 0], np.arange(len(points))],
    )
    for left in range(rounds, 0, -1):
        cosine = np.einsum("pi,pi->p", normals[i], normals[j])
        # Wide at first, since the noise itself sets neighbours apart.
        angle = ALIKE * (1 + left / rounds)
        weight = np.exp(-np.maximum(1 - np.abs(cosine), 0) / (1 - np.cos(angle))) * np.sign(cosine)
        matrix = coo_matrix((weight, (i, j)), shape=(len(points), len(points))).tocsr()
        normals = unit(matrix @ normals)
    return normals
