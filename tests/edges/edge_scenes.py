"""Scenes with known edges: exact ridges of lines, arcs and outlines in space, seen by cameras all around."""

import math

import numpy as np
import torch

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import curves_of
from diff3ds.curves.shapes.primitives import Kind, Primitive, arc_control, line_control
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges

# Ridges of images have about one point a pixel.
SPACING = 0.8


def around(views=24, size=128):
    """Cameras spread evenly over a ball, so that the unit ball fills the images."""
    i = torch.arange(views) + 0.5
    return ds.orbit(137.508 * i, torch.rad2deg(torch.asin(1 - 2 * i / views)), 3.0, fov=45, size=size)


def project(cameras, x):
    """Pixels (V, M, 2) and depths (V, M) of points, in double precision."""
    p = cameras.projection.double().numpy()
    h = np.einsum("vij,mj->vmi", p[:, :3, :3], x) + p[:, None, :3, 3]
    return h[..., :2] / h[..., 2:], h[..., 2]


def ridges_along(cameras, lines, shown=None):
    """Exact ridges of the polylines (S, 3), one list of them for all views or one a view; `shown` is (V, N) or None."""
    found = []
    for view in range(len(cameras)):
        own = lines[view] if isinstance(lines[0], list) else lines
        camera = cameras[[view]]
        parts = [
            image_line(project(camera, line)[0][0], cameras.size)
            for i, line in enumerate(own)
            if shown is None or shown[view, i]
        ]
        points, normals = (np.concatenate([p[k] for p in parts] or [np.zeros((0, 2))]) for k in (0, 1))
        found.append(Ridges.sharp(points, normals, np.ones(len(points))))
    return found


def image_line(pixels, size):
    """Points and unit normals at even distances along a polyline of an image, inside it."""
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(pixels, axis=0), axis=1))])
    tangents = np.gradient(pixels, axis=0)
    even = np.linspace(0, at[-1], max(2, round(at[-1] / SPACING) + 1))
    points, tangents = (np.stack([np.interp(even, at, v[:, k]) for k in (0, 1)], 1) for v in (pixels, tangents))
    normals = np.stack([tangents[:, 1], -tangents[:, 0]], 1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    height, width = size
    inside = (points > 0.5).all(1) & (points[:, 0] < width - 0.5) & (points[:, 1] < height - 0.5)
    return points[inside], normals[inside]


def texture(cameras, seed, count=260):
    """Ridges in all directions, in every picture others."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(len(cameras)):
        starts, angle = rng.uniform(5, 123, (count, 2)), rng.uniform(0, np.pi, count)
        ends = starts + 9 * np.stack([np.cos(angle), np.sin(angle)], 1)
        parts = [image_line(np.linspace(a, b, 12), cameras.size) for a, b in zip(starts, ends, strict=True)]
        points, normals = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
        found.append(Ridges.sharp(points, normals, np.ones(len(points))))
    return found


def both(first, second):
    """The ridges of two sets in one picture each."""
    return [
        Ridges.sharp(
            np.concatenate([a.points, b.points]), np.concatenate([a.normals, b.normals]), np.ones(len(a) + len(b))
        )
        for a, b in zip(first, second, strict=True)
    ]


def segment(start, stop, samples=200):
    """A polyline along a segment."""
    return np.linspace(np.asarray(start, float), np.asarray(stop, float), samples)


def arc(center, u, v, start=0.0, stop=2 * math.pi, samples=400):
    """A polyline along center + u cos + v sin."""
    t = np.linspace(start, stop, samples)[:, None]
    return np.asarray(center, float) + np.cos(t) * np.asarray(u, float) + np.sin(t) * np.asarray(v, float)


def views_of(cameras, lines, shown=None):
    """The ridges of polylines, ready for lookup."""
    return edge_views(cameras, ridges_along(cameras, lines, shown))


def lines_between(*segments):
    """Curves along straight segments."""
    none = np.zeros(0)
    return curves_of(
        [Primitive(Kind.LINE, line_control(np.asarray(a, float), np.asarray(b, float)), none) for a, b in segments]
    )


def circular_arc(center, u, v, start, stop):
    """An exact arc."""
    vectors = (np.asarray(w, float) for w in (center, u, v))
    return Primitive(Kind.ARC, arc_control(*vectors, start, stop), np.zeros(0))


def whole(center, u, v, kind=Kind.CIRCLE):
    """An exact circle, or ellipse."""
    return Primitive(kind, circular_arc(center, u, v, 0, math.pi).control, np.zeros(0))


def turned(seed=0):
    """A rotation that no axis escapes."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def distance_to_segment(points, start, stop):
    """Of points (M, 3)."""
    along = stop - start
    t = np.clip((points - start) @ along / (along @ along), 0, 1)
    return np.linalg.norm(points - start - t[:, None] * along, axis=1)


# The edges of a cuboid: corners by signs, edges as pairs of corners with the axes of their two faces.
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
EDGES = [(i, j) for i in range(8) for j in range(i) if (CORNERS[i] != CORNERS[j]).sum() == 1]


def box_edges(half, rotation):
    """The 12 edges of a cuboid as polylines."""
    corners = CORNERS * np.asarray(half) @ rotation.T
    return [segment(corners[i], corners[j]) for i, j in EDGES]


def box_shown(cameras, half, rotation):
    """Which faces of the cuboid the views see decides: (edges shown (V, 12), edges on the outline (V, 12))."""
    eye = cameras.centers.double().numpy() @ rotation
    seen = {(axis, sign): sign * eye[:, axis] > half[axis] for axis in range(3) for sign in (-1.0, 1.0)}
    shown, outline = [], []
    for i, j in EDGES:
        one, two = (seen[axis, CORNERS[i, axis]] for axis in range(3) if CORNERS[i, axis] == CORNERS[j, axis])
        shown.append(one | two)
        outline.append(one ^ two)
    return np.stack(shown, 1), np.stack(outline, 1)
