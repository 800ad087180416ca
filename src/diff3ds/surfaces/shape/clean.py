"""Triangles of any origin made a mesh: vertices welded, faces that are twice there dropped, all wound alike."""

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.formats.mesh_files.same_rows import different
from diff3ds.surfaces.shape.t_junctions import without_t_junctions

# Vertices nearer than a quarter of this, as a share of the mesh's longest side, are one: files repeat vertices for
# every face or texture, and write them in six digits. Of vertices farther apart than this none are.
SAME = 1e-6


def welded(
    vertices: Float[Array, "V 3"], faces: Int[Index, "F 3"]
) -> tuple[Int[Index, " W"], Int[Index, "G 3"], Int[Index, " G"]]:
    """The mesh with vertices in one place made one, without faces that have no area or were there before.

    Edges are split where corners of other faces lie on them.

    Returns:
        Which of the vertices faces use, of those in one place the first; the faces; and which each was, or is a
        part of.
    """
    rows, faces = _used(faces)
    if len(faces):
        first, faces = _joined(vertices[rows], faces)
        rows = rows[first]
    kept = np.flatnonzero((faces != np.roll(faces, 1, axis=1)).all(1))
    if len(kept):
        size = float(np.ptp(vertices[rows], axis=0).max())
        faces, whole = without_t_junctions(vertices[rows], faces[kept], SAME * size)
        kept = kept[whole]
    else:
        faces = faces[kept]
    a, b, c = faces.T
    least, most = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    first, _ = different([least, most, a + b + c])
    used, faces = _used(faces[first])
    return rows[used], faces, kept[first]


def _used(faces: Int[Index, "F 3"]) -> tuple[Index, Int[Index, "F 3"]]:
    is_used = np.zeros(int(faces.max(initial=-1)) + 1, bool)
    is_used[faces.ravel()] = True
    return np.flatnonzero(is_used), (np.cumsum(is_used) - 1)[faces]


def _joined(vertices: Float[Array, "V 3"], faces: Int[Index, "F 3"]) -> tuple[Int[Index, " W"], Int[Index, "F 3"]]:
    """Vertices in one place made one: which ones are left, and the faces between these.

    Places are rounded to cells of the size `SAME`. Two that are less than a quarter of it apart lie on different sides
    of a border in at most one of four shifted grids for each of the three axes, so that one grid holds them together.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    # Exact copies first: of each vertex a file of triangles without an index has six.
    copied, whose = different(list((vertices + 0.0).view(np.int64).T))
    vertices, faces = vertices[copied], whose[faces]
    low = vertices.min(0)
    side = float((vertices.max(0) - low).max())
    cells = (vertices - low) / (SAME * side) if side > 0 else np.zeros_like(vertices)
    count = len(vertices)
    ends = [np.arange(count)]
    for shift in (0.0, 0.25, 0.5, 0.75):
        whole = np.floor(cells + shift).astype(np.int64)
        # 2^21 is more than the cells along a side.
        key = (whole[:, 0] << 42) | (whole[:, 1] << 21) | whole[:, 2]
        _, first, same = np.unique(key, return_index=True, return_inverse=True)
        ends.append(first[same])
    rows, columns = np.tile(ends[0], 4), np.concatenate(ends[1:])
    apart = rows != columns
    graph = coo_matrix((np.ones(int(apart.sum()), bool), (rows[apart], columns[apart])), shape=(count, count))
    _, group = connected_components(graph, directed=False)
    _, first, same = np.unique(group, return_index=True, return_inverse=True)
    return copied[first], same[faces]


def wound_alike(
    vertices: Float[Array, "V 3"],
    faces: Int[Index, "F 3"],
    pairs: Int[Index, "P 2"],
    along: Bool[Mask, " P"],
) -> Int[Index, "F 3"]:
    """The faces with those turned round that are wound otherwise than their neighbours; outwards where that is known.

    Parts that cannot be wound alike, such as a Möbius strip, stay as they are. Where the volume of what had to be
    mended is negative, it is turned inside out, and so is a whole mesh of negative volume.

    Args:
        pairs: faces that meet at an edge of just the two.
        along: whether both run along it in the same direction, as faces that are wound alike do not.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(faces)
    turned = np.zeros(count, bool)
    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    parts, part = connected_components(graph, directed=False)
    volume = np.bincount(part, _volumes(vertices, faces), parts)
    if along.any():
        # Every face twice, as it is and turned: neighbours hang together as they agree. What can be wound alike falls
        # into two halves, which are each other turned.
        a, b = pairs.T
        other = np.where(along, count, 0)
        rows, columns = np.concatenate([a, a + count]), np.concatenate([b + other, b + count - other])
        graph = coo_matrix((np.ones(len(rows), bool), (rows, columns)), shape=(2 * count, 2 * count))
        _, half = connected_components(graph, directed=False)
        as_is, over = half[:count], half[count:]
        mended = np.zeros(parts, bool)
        mended[part[pairs[along, 0]]] = True
        turned = mended[part] & (as_is > over)
        signed = np.where(turned, -1, 1) * _volumes(vertices, faces)
        volume = np.bincount(part, signed, parts)
        turned ^= mended[part] & (volume[part] < 0) & (as_is != over)
        volume = np.where(mended, np.abs(volume), volume)
    if volume.sum() < 0:
        turned = ~turned
    return np.where(turned[:, None], faces[:, ::-1], faces)


def _volumes(vertices: Float[Array, "V 3"], faces: Int[Index, "F 3"]) -> Float[Array, " F"]:
    """Six times the signed volume between each face and the middle of the mesh."""
    a, b, c = (vertices - vertices.mean(0))[faces].transpose(1, 0, 2)
    return np.einsum("fi,fi->f", a, np.cross(b, c))
