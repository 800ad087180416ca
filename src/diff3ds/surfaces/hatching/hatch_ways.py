"""Directions of hatching on a surface: around what is round, smooth, and slanting on what is flat."""

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import unit
from diff3ds.surfaces.hatching.agreement import Complex, agreeing
from diff3ds.surfaces.hatching.fans import Fans
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Directions are smooth over so large a share of the mesh's size. Empirical.
SMOOTH = 0.12
# How much the fixed direction of what is flat, or round like a ball, counts beside that of a pronounced curvature.
# Empirical.
FLAT = 0.05
# Lines on what is flat are at right angles to this: none that a box's sides or a wheel's axis often have. Empirical.
SLANT = np.array([-0.42, -0.31, 0.85])


def hatch_ways(mesh: TriangleMesh, fans: Fans) -> Float[Array, "N 3"]:
    """Unit tangents, of either sign, along the direction in which the surface bends most.

    Lines of one principal direction agree with those of the other where these change places (Hertzmann and Zorin 2000);
    here the larger curvature decides, and counts by how much larger it is. Then neighbours are made to agree: least
    squares on vectors of twice the angle, transported from one tangent plane to the next (Knöppel and others 2013).
    """
    one, other = fans.tangents
    wanted = _bending(mesh, fans) * mesh.size
    wanted = wanted / np.sqrt(1 + np.abs(wanted) ** 2)
    across = np.cross(fans.normals, SLANT)
    wanted = wanted + FLAT * _doubled(across, one, other)
    ends, _, weight = fans.edges
    a, b = ends.T
    # The first tangent of one, as seen in the plane of the other.
    turn = np.angle(_doubled(one[a], one[b], other[b]))
    found = agreeing(fans.points, ends, turn, weight, fans.areas / (SMOOTH * mesh.size) ** 2 + 1e-12)(wanted)
    angle = np.angle(found) / 2
    return unit(np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * other)


def _doubled(vectors: Float[Array, "N 3"], one: Float[Array, "N 3"], other: Float[Array, "N 3"]) -> Complex:
    """Vectors in a plane as complex numbers of twice the angle."""
    value = np.einsum("ni,ni->n", vectors, one) + 1j * np.einsum("ni,ni->n", vectors, other)
    return value**2 / np.maximum(np.abs(value), 1e-12)


def _bending(mesh: TriangleMesh, fans: Fans) -> Complex:
    """By how much more the surface bends in one principal direction than in the other, as a number of twice its angle.

    Second fundamental forms of faces from the normals at their corners (Rusinkiewicz 2004), in the mean around fans.
    """
    corners, normals = fans.points[fans.faces], fans.normals[fans.faces]
    x = unit(corners[:, 1] - corners[:, 0])
    y = np.cross(mesh.face_normals, x)
    steps, changes = (np.roll(v, -1, 1) - v for v in (corners, normals))
    u, v = (np.einsum("fki,fi->fk", steps, axis) for axis in (x, y))
    du, dv = (np.einsum("fki,fi->fk", changes, axis) for axis in (x, y))
    # Rows of a least squares system in the form's three entries.
    zero = np.zeros_like(u)
    rows = np.concatenate([np.stack([u, v, zero], 2), np.stack([zero, u, v], 2)], 1)
    sides = np.concatenate([du, dv], 1)
    normal = np.einsum("fki,fkj->fij", rows, rows)
    scale = np.einsum("fii->f", normal) / 3
    normal += (1e-9 * scale + 1e-300)[:, None, None] * np.eye(3)
    e, f, g = np.linalg.solve(normal, np.einsum("fki,fk->fi", rows, sides)[..., None])[..., 0].T
    form = sum(
        value[:, None, None] * (p[:, :, None] * q[:, None, :] + q[:, :, None] * p[:, None, :]) / 2
        for value, p, q in ((e, x, x), (2 * f, x, y), (g, y, y))
    )
    parts = (form * (mesh.face_areas / 3)[:, None, None]).reshape(-1, 9).repeat(3, 0)
    total = np.stack([np.bincount(fans.faces.ravel(), part, len(fans)) for part in parts.T], 1)
    mean = total.reshape(-1, 3, 3) / np.maximum(fans.areas, 1e-300)[:, None, None]
    one, other = fans.tangents
    aa, ab, bb = (np.einsum("ni,nij,nj->n", p, mean, q) for p, q in ((one, one), (one, other), (other, other)))
    half, mean_curvature = (aa - bb) / 2 + 1j * ab, (aa + bb) / 2
    size = np.abs(half)
    more = np.abs(mean_curvature + size) - np.abs(mean_curvature - size)
    return more * half / np.maximum(size, 1e-300)
