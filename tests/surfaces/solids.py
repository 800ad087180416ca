"""Meshes of known solids, made without a library: spheres from the icosahedron, tori, lathes, boxes."""

import numpy as np

Solid = tuple[np.ndarray, np.ndarray]


def icosphere(levels: int) -> Solid:
    """The unit sphere: an icosahedron whose faces are cut in four so many times."""
    g = (1 + 5**0.5) / 2
    vertices = np.array([(s * a, t * b, 0.0) for a, b in ((1, g),) for s in (-1, 1) for t in (-1, 1)])
    vertices = np.concatenate([np.roll(vertices, k, 1) for k in range(3)])
    near = np.linalg.norm(vertices[:, None] - vertices, axis=2) < 2.1
    faces = [(i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] & near[j, k] & near[i, k]]
    corners = np.array(faces)
    inwards = np.linalg.det(vertices[corners]) < 0
    corners[inwards] = corners[inwards][:, ::-1]
    points = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    for _ in range(levels):
        points, corners = refined(points, corners)
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points, corners


def refined(vertices: np.ndarray, faces: np.ndarray) -> Solid:
    """Every face cut in four, at the middles of its edges."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, 1)], 2), 2).reshape(-1, 2)
    edges, edge = np.unique(sides, axis=0, return_inverse=True)
    m = edge.reshape(-1, 3) + len(vertices)
    a, b, c = faces.T
    parts = [(a, m[:, 0], m[:, 2]), (m[:, 0], b, m[:, 1]), (m[:, 2], m[:, 1], c), m.T]
    return np.concatenate([vertices, vertices[edges].mean(1)]), np.concatenate([np.stack(p, 1) for p in parts])


def grid(points: np.ndarray, across: bool, along: bool = True) -> Solid:
    """A surface through rows and columns of points (R, C, 3); closed over the rows, or columns, or not."""
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    index = np.concatenate([index, index[:1]]) if across else index
    index = np.concatenate([index, index[:, :1]], 1) if along else index
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return points.reshape(-1, 3), faces


def lathe(radius: np.ndarray, height: np.ndarray, around: int) -> Solid:
    """A profile turned around z; open unless its radius is 0 at the ends."""
    angle = 2 * np.pi * np.arange(around) / around
    turned = [np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)), np.outer(height, np.ones(around))]
    return grid(np.stack(turned, -1).transpose(1, 0, 2), True, False)


def torus(ring: float, tube: float, around: int, about: int) -> Solid:
    """A torus around z, of circles of radius `tube`."""
    u, v = 2 * np.pi * np.arange(around) / around, 2 * np.pi * np.arange(about) / about
    out = ring + tube * np.cos(v)
    points = np.stack([np.outer(np.cos(u), out), np.outer(np.sin(u), out), np.tile(tube * np.sin(v), (around, 1))], -1)
    return grid(points, True)


def box(low: tuple[float, float, float] = (-1, -1, -1), high: tuple[float, float, float] = (1, 1, 1)) -> Solid:
    """Twelve triangles."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return np.array(low) + corners * (np.array(high) - np.array(low)), np.array(faces)


def together(*solids: Solid) -> Solid:
    """Several solids as one mesh."""
    before = np.cumsum([0, *(len(vertices) for vertices, _ in solids)])
    faces = [faces + start for (_, faces), start in zip(solids, before, strict=False)]
    return np.concatenate([vertices for vertices, _ in solids]), np.concatenate(faces)
