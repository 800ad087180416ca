"""Corners of some triangles that lie on the edges of others, as CAD programs write them: the edges are split there.

Without that both sides of such an edge are borders. Needles, triangles without a height, which some programs put into
these gaps, are left out first: nothing is known of the angle at their edges.
"""

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.page.boxes import BoxIndex

# A triangle whose height is below the tolerance is a needle if it is so many times longer.
NEEDLE = 10.0
# Rounds of splitting: each one splits one edge of a triangle.
ROUNDS = 6


def without_t_junctions(
    vertices: Float[Array, "V 3"], faces: Int[Index, "F 3"], tolerance: float
) -> tuple[Int[Index, "G 3"], Int[Index, " G"]]:
    """The faces with edges split at corners that lie on them, and which of the given ones each is, or is a part of.

    Args:
        vertices: those in one place are one already.
        faces: three different vertices each.
        tolerance: corners so near to an edge lie on it, world units.
    """
    rows = np.flatnonzero(~_needles(vertices[faces], tolerance))
    # Where nothing else is there, what is wrong is said elsewhere.
    if not len(rows):
        return faces, np.arange(len(faces))
    faces = faces[rows]
    for _ in range(ROUNDS):
        face, side, corner, share = _junctions(vertices, faces, tolerance)
        if not len(face):
            break
        # One edge a face and round.
        first = np.full(len(faces), 3)
        np.minimum.at(first, face, side)
        chosen = first[face] == side
        faces, of = _split(faces, face[chosen], side[chosen], corner[chosen], share[chosen])
        rows = rows[of]
    return faces, rows


def _needles(corners: Float[Array, "F 3 3"], tolerance: float) -> np.ndarray:
    a, b, c = corners.transpose(1, 0, 2)
    longest = np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2).max(1)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(longest, 1e-300)
    return np.asarray((height < tolerance) & (longest > NEEDLE * height))


def _junctions(
    vertices: Float[Array, "V 3"], faces: Int[Index, "F 3"], tolerance: float
) -> tuple[Index, Index, Index, Array]:
    """Faces, their sides, the corners of others that lie on these, and how far along."""
    start, stop = faces.ravel(), np.roll(faces, -1, 1).ravel()
    base = int(faces.max()) + 1
    key = np.minimum(start, stop) * base + np.maximum(start, stop)
    ordered = np.sort(key)
    changes = np.concatenate([[True], ordered[1:] != ordered[:-1], [True]])
    alone = ordered[changes[1:] & changes[:-1]]
    nothing = np.zeros(0, np.int64)
    if not len(alone):
        return nothing, nothing, nothing, np.zeros(0)
    side = np.flatnonzero(np.isin(key, alone))
    side = side[np.argsort(key[side])]
    ends = vertices[np.stack([start[side], stop[side]], 1)]
    corner = np.unique(np.concatenate([start[side], stop[side]]))
    low, high = ends.min(1) - tolerance, ends.max(1) + tolerance
    index = BoxIndex.of(low, high, float(np.median((high - low).max(1))))
    query, edge = index.around(vertices[corner])
    way = ends[edge, 1] - ends[edge, 0]
    off = vertices[corner[query]] - ends[edge, 0]
    length = np.linalg.norm(way, axis=1)
    share = np.einsum("pi,pi->p", off, way) / length**2
    away = np.linalg.norm(off - share[:, None] * way, axis=1)
    inner = (away <= tolerance) & (share * length > tolerance) & ((1 - share) * length > tolerance)
    of = side[edge[inner]]
    # A corner of the face itself is none, and boxes are met in several cells.
    found = np.unique(np.stack([of, corner[query[inner]]], 1), axis=0, return_index=True)
    (row, at), which = found[0].T, found[1]
    own = (faces[row // 3] == at[:, None]).any(1)
    return row[~own] // 3, row[~own] % 3, at[~own], share[inner][which][~own]


def _split(
    faces: Int[Index, "F 3"], face: Index, side: Index, corner: Index, share: Array
) -> tuple[Int[Index, "G 3"], Index]:
    """The faces with a side of some cut at corners: triangles that fan out from the corner opposite."""
    order = np.lexsort((share, face))
    face, side, corner = face[order], side[order], corner[order]
    fresh = np.append(True, face[1:] != face[:-1])
    last = np.append(fresh[1:], True)
    a, b, c = (faces[face, (side + k) % 3] for k in range(3))
    before = np.where(fresh, a, np.roll(corner, 1))
    parts = [np.stack([before, corner, c], 1), np.stack([corner, b, c], 1)[last]]
    kept = np.setdiff1d(np.arange(len(faces)), face)
    return np.concatenate([faces[kept], *parts]), np.concatenate([kept, face, face[last]])
