"""Curves in which the surfaces of quadrics meet, as chains of points on both: quartic curves, which are no conics."""

from functools import cache

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.surfaces.lines.contours import walks
from diff3ds.surfaces.shape.quadric_forms import Forms

# The smaller one of two solids is triangulated so finely around and along to find where it meets the other. What is
# smaller than a triangle is missed. Empirical.
AROUND, ALONG = 72, 24
# Newton's steps onto both surfaces, and how far from these, as a share of a solid's radius, a point may be afterwards.
NEWTON, ARRIVED = 5, 1e-6


def meeting_chains(
    forms: Forms, taper: Float[Array, " N"], axes: Float[Array, "N 3 3"], pairs: Int[Index, "P 2"]
) -> list[tuple[Float[Array, "M 3"], bool, tuple[int, int]]]:
    """Points along each curve in which two solids meet, whether it closes, and which two they are.

    Args:
        forms: of all solids.
        taper: of cylinders and cones.
        axes: columns are the axes of each.
        pairs: of solids that may meet.
    """
    found = []
    size = np.abs(np.linalg.det(axes))
    for one, other in pairs.tolist():
        small, large = (one, other) if size[one] <= size[other] else (other, one)
        points, faces = triangles_of(forms, taper, small)
        inside = _depths(forms, large, points)[0]
        for chain, closed in _zero_set(points[:, :3], faces, inside):
            found.append((onto_both(forms, small, large, chain), closed, (small, large)))
    return found


def triangles_of(forms: Forms, taper: Float[Array, " N"], solid: int) -> tuple[Float[Array, "V 4"], Int[Index, "F 3"]]:
    """One of the solids as triangles: points of weight 1 on it, and three of them a face."""
    vertices, faces = _triangles(bool(forms.is_round[solid]), float(taper[solid]))
    local = np.column_stack([vertices, np.ones(len(vertices))])
    return local @ np.linalg.inv(forms.local[solid]).T, faces


@cache
def _triangles(is_round: bool, taper: float) -> tuple[Float[Array, "V 3"], Int[Index, "F 3"]]:
    """A simple solid: a profile turned about its axis, with a vertex at both ends."""
    if is_round:
        angle = np.pi * np.arange(1, ALONG) / ALONG
        radius, height = np.sin(angle), -np.cos(angle)
    else:
        t = np.arange(1, ALONG + 1) / ALONG
        ends = np.ones(ALONG)
        radius = np.concatenate([t, 1 + (taper - 1) * t, taper * (1 - t[:-1])])
        height = np.concatenate([-ends, 2 * t - 1, ends[:-1]])
        sharp = radius > 0
        radius, height = radius[sharp], height[sharp]
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = np.stack(
        [np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)), np.outer(height, angle * 0 + 1)]
    )
    vertices = np.concatenate([[[0, 0, -1.0], [0, 0, 1.0]], rings.reshape(3, -1).T])
    ring = 2 + np.arange(len(radius))[:, None] * AROUND + np.arange(AROUND)
    after = np.roll(ring, -1, 1)
    a, b, c, d = ring[:-1], after[:-1], after[1:], ring[1:]
    faces = [np.stack(x, -1).reshape(-1, 3) for x in ((a, b, c), (a, c, d))]
    faces += [
        np.stack([np.full(AROUND, end), row, turn], 1)
        for end, row, turn in ((0, after[0], ring[0]), (1, ring[-1], after[-1]))
    ]
    return vertices, np.concatenate(faces)


def _depths(
    forms: Forms, solid: int | Int[Index, " P"], points: Float[Array, "P 4"]
) -> tuple[Float[Array, " P"], Int[Index, " P"]]:
    """How far points are outside of solids, negative inside, and what bounds it there: its quadric (0) or an end."""
    of = np.broadcast_to(solid, len(points))
    quadric = np.einsum("pa,pab,pb->p", points, forms.inside[of], points)
    ends = np.where(forms.is_round[of, None], -np.inf, np.einsum("pa,pka->pk", points, forms.ends[of]))
    values = np.column_stack([quadric, ends])
    return values.max(1), values.argmax(1)


def _zero_set(
    vertices: Float[Array, "V 3"], faces: Int[Index, "F 3"], values: Float[Array, " V"]
) -> list[tuple[Float[Array, "M 3"], bool]]:
    """Chains of points on edges where a function that is linear over faces changes its sign."""
    sign = values >= 0
    mixed = faces[sign[faces].any(1) & ~sign[faces].all(1)]
    after = np.roll(mixed, -1, 1)
    place = np.argsort(sign[mixed] == sign[after], axis=1, kind="stable")[:, :2]
    ends = np.sort(np.stack([np.take_along_axis(x, place, 1) for x in (mixed, after)], 2), axis=2)
    _, first, node = np.unique(ends[..., 0] * len(vertices) + ends[..., 1], return_index=True, return_inverse=True)
    a, b = ends.reshape(-1, 2)[first].T
    share = values[a] / (values[a] - values[b])
    points = vertices[a] + share[:, None] * (vertices[b] - vertices[a])
    return [(points[run], closed) for run, _, closed in walks(node.reshape(-1, 2), len(points))]


def onto_both(
    forms: Forms, one: int | Int[Index, " M"], other: int | Int[Index, " M"], points: Float[Array, "M 3"]
) -> Float[Array, "M 3"]:
    """The points moved onto the surfaces of both solids, where steps across both lead there."""
    moved = points
    for _ in range(NEWTON):
        x = np.column_stack([moved, np.ones(len(moved))])
        value = np.stack([_depths(forms, solid, x)[0] for solid in (one, other)], 1)
        slope = np.stack([bounds(forms, np.broadcast_to(solid, len(x)), x)[1] for solid in (one, other)], 1)
        gram = np.einsum("pia,pja->pij", slope, slope)
        det = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
        # Where the surfaces touch, there is no way to both.
        good = det > 1e-9 * gram[:, 0, 0] * gram[:, 1, 1]
        safe = np.where(good, det, 1.0)
        first = (gram[:, 1, 1] * value[:, 0] - gram[:, 0, 1] * value[:, 1]) / safe * good
        second = (gram[:, 0, 0] * value[:, 1] - gram[:, 0, 1] * value[:, 0]) / safe * good
        moved = moved - first[:, None] * slope[:, 0] - second[:, None] * slope[:, 1]
    x = np.column_stack([moved, np.ones(len(moved))])
    left = np.stack([_depths(forms, solid, x)[0] for solid in (one, other)])
    arrived = np.isfinite(moved).all(1) & (np.abs(left).max(0) < ARRIVED)
    return np.where(arrived[:, None], moved, points)


def bounds(
    forms: Forms, solid: Int[Index, " P"], points: Float[Array, "P 4"]
) -> tuple[Int[Index, " P"], Float[Array, "P 3"]]:
    """What bounds solids at points beside their surfaces, the quadric (0) or an end (1, 2), and its gradient there."""
    _, which = _depths(forms, solid, points)
    curved = 2 * np.einsum("pab,pb->pa", forms.inside[solid], points)
    flat = forms.ends[solid, np.maximum(which - 1, 0)]
    return which, np.where((which == 0)[:, None], curved, flat)[:, :3]
