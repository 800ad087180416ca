"""What people have of a part instead of its clean mesh: meshes of distance fields, scans with noise, clouds of points.

Needs fast-simplification, which decimates.
"""

import numpy as np
from numpy.random import Generator

from cad.boundary import Mesh
from cad.part import Part
from cad.raster import SAMPLES, SIDE, rasterise
from cad.views import random_views

# Samples of the surface from which a distance field is taken: some .0015 apart.
DENSE = 1_500_000
# Of a generated mesh: cells along its longest side, the blur of its distances in cells, and its bumps: their height as
# a share of the longest side and their width in cells. Such meshes turn by 5 degrees in the median from face to face,
# and spread a right angle over two to four rows, as those of Hunyuan3D do.
CELLS, BLUR, BUMP, BUMP_WIDTH = (128, 192), 1.0, 0.0018, 2.0
GENERATED_FACES, SCANNED_FACES = 30_000, 60_000
CLOUD = 32_768
# Of the decimation; more of it tears holes into noisy meshes.
AGGRESSIVE = 4


def samples(mesh: Mesh, count: int, rng: Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points (count, 3) spread evenly by area over the triangles, and the outward normals of those."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1)
    row = np.sort(rng.choice(len(area), count, p=area / area.sum()))
    u, v = rng.random((2, count))
    over = u + v > 1
    u[over], v[over] = 1 - u[over], 1 - v[over]
    points = a[row] + u[:, None] * (b - a)[row] + v[:, None] * (c - a)[row]
    return points, cross[row] / area[row, None]


def generated(part: Part, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The part through a blurred, bumped distance field, decimated: vertices and faces, as image-to-3D models give."""
    from scipy.ndimage import gaussian_filter

    from diff3ds.surfaces.shape.level_set import level_set

    rng = np.random.default_rng([seed, 3000])
    field = _Field(part, int(rng.integers(CELLS[0], CELLS[1] + 1)), rng)
    bumps = gaussian_filter(rng.normal(size=field.values.shape), BUMP_WIDTH)
    value = gaussian_filter(field.values, BLUR) + BUMP / bumps.std() * bumps
    mesh = level_set(value, field.low, field.spacing)
    return decimated(mesh.vertices, mesh.faces, GENERATED_FACES)


def scanned(part: Part, noise: float, faces: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The part's surface in even triangles, 60,000 at most, off along normals by noise, decimated to `faces`."""
    from diff3ds.surfaces.shape.level_set import level_set

    rng = np.random.default_rng([seed, 3001])
    a, b, c = part.mesh.vertices[part.mesh.triangles].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    # A cell that the surface goes through gives three triangles in the mean.
    field = _Field(part, int(np.sqrt(SCANNED_FACES / (3 * area))), rng)
    mesh = level_set(field.values, field.low, field.spacing)
    row = field.tree.query(mesh.vertices, workers=2)[1]
    vertices = field.on[row] + noise * rng.normal(size=(len(row), 1)) * field.normals[row]
    return decimated(vertices, mesh.faces, faces)


class _Field:
    """Distances of the points of a grid from a part's surface, positive inside, as far as four cells."""

    def __init__(self, part: Part, cells: int, rng: Generator) -> None:
        from scipy.ndimage import binary_dilation, binary_fill_holes
        from scipy.spatial import cKDTree

        margin = 6
        self.spacing = 1 / cells
        self.low = part.mesh.vertices.min(0) - margin * self.spacing
        shape = np.ceil(np.ptp(part.mesh.vertices, axis=0) / self.spacing).astype(int) + 2 * margin + 1
        self.on, self.normals = samples(part.mesh, DENSE, rng)
        self.tree, reach = cKDTree(self.on), 4 * self.spacing
        # Only cells near the surface are measured: those that a sample lies in, and their neighbours.
        near = np.zeros(shape, bool)
        near[tuple(np.round((self.on - self.low) / self.spacing).astype(int).T)] = True
        # Once wider, for a cell without a sample is a hole in the shell, and what it holds would not count as inside.
        self.values = np.where(binary_fill_holes(binary_dilation(near)), reach, -reach)
        places = np.argwhere(binary_dilation(near, iterations=4))
        points = self.low + self.spacing * places
        row = self.tree.query(points, workers=2)[1]
        away = points - self.on[row]
        signed = -np.copysign(np.linalg.norm(away, axis=1), np.einsum("ni,ni->n", away, self.normals[row]))
        self.values[tuple(places.T)] = np.clip(signed, -reach, reach)


def cloud(part: Part, noise: float, one_sided: bool, seed: int) -> np.ndarray:
    """Points (CLOUD, 3) of the surface, each off by noise along three axes; of one side those that one view sees."""
    rng = np.random.default_rng([seed, 3002])
    points = samples(part.mesh, CLOUD, rng)[0] if not one_sided else _seen(part, rng)
    return points + noise * rng.normal(size=points.shape)


def _seen(part: Part, rng: Generator) -> np.ndarray:
    """Points that a camera sees, as many as of a whole cloud."""
    view = random_views(rng, 1)[0]
    buffer = rasterise(part.mesh, view)
    points = samples(part.mesh, 40 * CLOUD, rng)[0]
    pixels, depth = view.project(points)
    x, y = np.clip((pixels * SAMPLES).astype(int), 0, SIDE - 1).T
    row = buffer.triangle[y, x]
    at = np.column_stack([pixels * SAMPLES, np.ones(len(points))])
    inverse = np.clip((buffer.planes[row] * at).sum(1), *buffer.bounds[row].T)
    seen = points[(row >= 0) & (1 / inverse > depth - 1e-3)]
    # A camera sees fewer points of what it sees aslant, but no part is left out: evenly by area.
    return seen[np.sort(rng.choice(len(seen), min(CLOUD, len(seen)), replace=False))]


def decimated(vertices: np.ndarray, faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with at most so many faces, by quadric errors."""
    if len(faces) <= count:
        return vertices, faces
    from fast_simplification import simplify

    found, triangles = simplify(vertices.astype(np.float32), faces.astype(np.int32), target_count=count, agg=AGGRESSIVE)
    return found.astype(float), triangles.astype(np.int64)
