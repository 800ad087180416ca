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
GENERATED_FACES = 30_000
CLOUD = 32_768


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
    from scipy.spatial import cKDTree

    from diff3ds.surfaces.meshes.level_set import level_set

    rng = np.random.default_rng([seed, 3000])
    cells = int(rng.integers(CELLS[0], CELLS[1] + 1))
    spacing, margin = 1 / cells, 6
    low = part.mesh.vertices.min(0) - margin * spacing
    shape = np.ceil(np.ptp(part.mesh.vertices, axis=0) / spacing).astype(int) + 2 * margin + 1
    on, normals = samples(part.mesh, DENSE, rng)
    tree, reach = cKDTree(on), 4 * spacing
    # Only cells near the surface are measured: those that a sample lies in, and their neighbours.
    near = np.zeros(shape, bool)
    near[tuple(np.round((on - low) / spacing).astype(int).T)] = True
    from scipy.ndimage import binary_dilation, binary_fill_holes

    solid = binary_fill_holes(near)
    near = binary_dilation(near, iterations=4)
    places = np.argwhere(near)
    points = low + spacing * places
    _, row = tree.query(points, workers=2)
    away = points - on[row]
    value = np.where(solid, reach, -reach)
    signed = -np.copysign(np.linalg.norm(away, axis=1), np.einsum("ni,ni->n", away, normals[row]))
    value[tuple(places.T)] = np.clip(signed, -reach, reach)
    bumps = gaussian_filter(rng.normal(size=shape), BUMP_WIDTH)
    value = gaussian_filter(value, BLUR) + BUMP / bumps.std() * bumps
    mesh = level_set(value, low, spacing)
    return decimated(mesh.vertices, mesh.faces, GENERATED_FACES)


def scanned(part: Part, noise: float, faces: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The part's surface in 60,000 triangles, its vertices off along their normals by noise, decimated to `faces`."""
    rng = np.random.default_rng([seed, 3001])
    vertices, triangles = _refined(part.mesh, 60_000)
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], np.cross(b - a, c - a))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
    vertices = vertices + noise * rng.normal(size=(len(vertices), 1)) * normals
    return decimated(vertices, triangles, faces)


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

    found, triangles = simplify(vertices.astype(np.float32), faces.astype(np.int32), target_count=count)
    return found.astype(float), triangles.astype(np.int64)


def _refined(mesh: Mesh, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles cut at the middle of their longest edges until there are so many; vertices in one place are one."""
    _, first, row = np.unique(np.round(mesh.vertices, 6), axis=0, return_index=True, return_inverse=True)
    points, faces = mesh.vertices[first], row.ravel()[mesh.triangles]
    faces = faces[(faces != np.roll(faces, 1, 1)).all(1)]
    while len(faces) < count:
        sides = np.sort(np.stack([faces, np.roll(faces, -1, 1)], 2), axis=2)
        keys, edge = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
        edge = edge.reshape(-1, 3)
        length = np.linalg.norm(points[keys[:, 0]] - points[keys[:, 1]], axis=1)
        longest = edge[np.arange(len(faces)), length[edge].argmax(1)]
        # The longest edges of all are cut first; each cut edge splits its faces, one cut a face and round.
        those = np.unique(longest)
        most = min(max((count - len(faces) + 1) // 2, 1), max(len(those) // 3, 1))
        wanted = np.zeros(len(keys), bool)
        wanted[those[np.argsort(-length[those], kind="stable")[:most]]] = True
        cut = wanted[edge]
        # A face of which several edges are cut is cut at the longest of them; the others wait where all agree.
        once = np.where(cut, length[edge], -1).argmax(1)
        agreed = wanted.copy()
        for k in range(3):
            other = cut[:, k] & (once != k)
            agreed[edge[other, k]] = False
        middle = np.full(len(keys), -1)
        middle[agreed] = len(points) + np.arange(agreed.sum())
        points = np.concatenate([points, points[keys[agreed]].mean(1)])
        has = agreed[edge]
        split = has.any(1)
        k = has[split].argmax(1)
        rows = faces[split]
        i, j, o = (np.take_along_axis(rows, ((k + s) % 3)[:, None], 1)[:, 0] for s in range(3))
        m = middle[edge[split, k]]
        faces = np.concatenate([faces[~split], np.stack([i, m, o], 1), np.stack([m, j, o], 1)])
    return points, faces
