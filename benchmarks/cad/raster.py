"""Triangles to pixels: a depth buffer at several samples a pixel, and a shaded picture of it."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from cad.boundary import Mesh
from cad.views import SIZE, View

SAMPLES = 3  # per pixel and axis
SIDE = SIZE * SAMPLES


@dataclass(frozen=True)
class Buffer:
    """Which triangle each sample sees; inverse depths are affine in the plane of the picture.

    triangle (SIDE, SIDE): index into `planes`, -1 where nothing is; planes (t, 3): 1 / depth = a x + b y + c with x, y
    in samples; bounds (t, 2): least and greatest 1 / depth of a triangle's corners; corners (t, 3): its
    vertices; face (t,): its face.
    """

    triangle: np.ndarray
    planes: np.ndarray
    bounds: np.ndarray
    corners: np.ndarray
    face: np.ndarray


def rasterise(mesh: Mesh, view: View) -> Buffer:
    """The nearest of the triangles that face the camera, at every sample."""
    pixels, depth = view.project(mesh.vertices)
    xy, inverse = pixels * SAMPLES, 1 / depth
    a, b, c = (xy[mesh.triangles[:, k]] for k in range(3))
    area = _cross(b - a, c - a)
    # Counter-clockwise from outside is clockwise on the screen when y points down.
    seen = area < -1e-9
    corners, a, b, c, area = mesh.triangles[seen], a[seen], b[seen], c[seen], area[seen]
    w = inverse[corners]
    slope_x = ((w[:, 1] - w[:, 0]) * (c - a)[:, 1] - (w[:, 2] - w[:, 0]) * (b - a)[:, 1]) / area
    slope_y = ((w[:, 2] - w[:, 0]) * (b - a)[:, 0] - (w[:, 1] - w[:, 0]) * (c - a)[:, 0]) / area
    planes = np.column_stack([slope_x, slope_y, w[:, 0] - slope_x * a[:, 0] - slope_y * a[:, 1]])
    index, x, y = _covered(np.stack([a, b, c], 1))
    value = (planes[index] * np.column_stack([x + 0.5, y + 0.5, np.ones(len(x))])).sum(1)
    where = y * SIDE + x
    nearest = np.zeros(SIDE * SIDE)
    np.maximum.at(nearest, where, value)
    best = value == nearest[where]
    triangle = np.full(SIDE * SIDE, -1)
    triangle[where[best]] = index[best]
    return Buffer(triangle.reshape(SIDE, SIDE), planes, np.column_stack([w.min(1), w.max(1)]), corners, mesh.face[seen])


def _covered(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples inside each of the triangles (t, 3, 2): index of the triangle, column, row; row by row, span by span."""
    top = np.clip(np.ceil(triangles[..., 1].min(1) - 0.5), 0, SIDE).astype(int)
    bottom = np.clip(np.ceil(triangles[..., 1].max(1) - 0.5), 0, SIDE).astype(int)
    index, row = _runs(top, bottom)
    height = row + 0.5
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for k in range(3):
        p, q = triangles[index, k], triangles[index, (k + 1) % 3]
        crosses = (p[:, 1] <= height) != (q[:, 1] <= height)
        t = (height - p[:, 1]) / np.where(crosses, q[:, 1] - p[:, 1], 1)
        x = p[:, 0] + t * (q[:, 0] - p[:, 0])
        left = np.where(crosses, np.minimum(left, x), left)
        right = np.where(crosses, np.maximum(right, x), right)
    filled = right > left
    index, row, left, right = index[filled], row[filled], left[filled], right[filled]
    start = np.clip(np.ceil(left - 0.5), 0, SIDE).astype(int)
    stop = np.clip(np.ceil(right - 0.5), 0, SIDE).astype(int)
    span, column = _runs(start, stop)
    return index[span], column, row[span]


def _runs(start: np.ndarray, stop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All integers from start to stop - 1 of every pair, with the index of the pair."""
    count = np.maximum(stop - start, 0)
    index = np.repeat(np.arange(len(start)), count)
    offset = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
    return index, start[index] + offset


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def face_colours(rng: Generator, faces: int) -> np.ndarray:
    """One colour a face (faces, 3) in 0..1: half of the parts grey all over, the others in three tones."""
    grey = np.full(3, rng.uniform(0.65, 0.9))
    if rng.random() < 0.5:
        return np.tile(grey, (faces, 1))
    tones = np.vstack([grey, rng.uniform(0.25, 0.9, (2, 3))])
    return tones[rng.choice(3, faces, p=[0.6, 0.25, 0.15])]


# Directions towards two lamps fixed in the world; a third sits on the camera.
LAMPS = np.array([[0.4, -0.5, 0.77], [-0.7, 0.3, -0.65]])
STRENGTHS = np.array([0.45, 0.2])
HEAD, AMBIENT = 0.3, 0.15


def normals_of(buffer: Buffer, mesh: Mesh, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals, smooth over faces, at all samples that see a triangle, row by row, and their triangles."""
    row, column = np.nonzero(buffer.triangle >= 0)
    index = buffer.triangle[row, column]
    used, back = np.unique(index, return_inverse=True)
    pixels, depth = view.project(mesh.vertices)
    a, b, c = (pixels[buffer.corners[used, k]] * SAMPLES for k in range(3))
    area = _cross(b - a, c - a)[back]
    p = np.column_stack([column + 0.5, row + 0.5])
    # Barycentric weights in the picture, divided by depth, are those on the triangle up to a factor.
    share = np.column_stack([_cross(b[back] - p, c[back] - p), _cross(c[back] - p, a[back] - p)]) / area[:, None]
    share = np.column_stack([share, 1 - share.sum(1)]) / depth[buffer.corners[used]][back]
    normals = (share[..., None] * mesh.normals[buffer.corners[used]][back]).sum(1)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12), index


def shade(buffer: Buffer, mesh: Mesh, view: View, colours: np.ndarray) -> np.ndarray:
    """The picture (SIZE, SIZE, 4), RGB not multiplied by alpha, in 0..1: Lambert's law with smooth normals."""
    row, column = np.nonzero(buffer.triangle >= 0)
    normals, index = normals_of(buffer, mesh, view)
    light = AMBIENT + HEAD * np.clip(normals @ -view.axes[2], 0, 1)
    light = light + (np.clip(normals @ LAMPS.T, 0, 1) * STRENGTHS).sum(1)
    colour = np.clip(light[:, None] * colours[buffer.face[index]], 0, 1)
    pixel = row // SAMPLES * SIZE + column // SAMPLES
    sums = [np.bincount(pixel, weights, SIZE * SIZE) for weights in (*colour.T, None)]
    image = np.column_stack(sums).reshape(SIZE, SIZE, 4)
    image[..., :3] /= np.maximum(image[..., 3:], 1)
    image[..., 3] /= SAMPLES**2
    return image
