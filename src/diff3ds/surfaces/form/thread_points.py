"""Points that lie along curves, in no order, as lines through them from end to end, or round."""

from collections.abc import Iterator

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int

# A line comes back to its start where half way along it there are two places farther apart than so many gaps.
APART = 2.0


def threaded(
    points: Float[Array, "C 3"], gap: float, step: float
) -> Iterator[tuple[Float[Array, "M 3"], bool, Int[Index, " R"]]]:
    """Lines through points: their own points, whether they close, and the rows of the points that they go through.

    Args:
        points: along curves that do not branch, dense beside the gap, scattered about them by less.
        gap: points that are farther apart are not of one line; world units.
        step: between the points of a line.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components, dijkstra
    from scipy.spatial import cKDTree

    i, j = cKDTree(points).query_pairs(gap, output_type="ndarray").reshape(-1, 2).T
    # Two in one place are neighbours all the same.
    length = np.maximum(np.linalg.norm(points[i] - points[j], axis=1), 1e-9 * gap)
    graph = coo_matrix((length, (i, j)), shape=(len(points), len(points))).tocsr()
    count, piece = connected_components(graph, directed=False)
    for k in range(count):
        rows = np.flatnonzero(piece == k)
        own = graph[rows][:, rows]
        from_any = dijkstra(own, False, 0)
        along = dijkstra(own, False, int(from_any.argmax()))
        sides = _sides(points[rows], own, along, gap)
        line = np.concatenate([_mean(points[rows[side]], along[side], step)[::way] for way, side in sides])
        if len(sides) > 1:
            line = np.concatenate([line, line[:1]])
        if len(line) > 1:
            yield line, len(sides) > 1, rows


def _sides(points: Array, graph: object, along: Array, gap: float) -> list[tuple[int, Index]]:
    """The rows of a line, or of both sides of one that closes, and which way each is gone along."""
    from scipy.sparse.csgraph import connected_components

    everything = np.arange(len(points))
    far = float(along.max())
    inner = np.flatnonzero((along > gap) & (along < far - gap))
    if far < 4 * gap or len(inner) < 4:
        return [(1, everything)]
    count, side = connected_components(graph[inner][:, inner], directed=False)  # type: ignore[index]
    size = np.bincount(side)
    if count < 2 or np.sort(size)[-2] < 0.2 * len(inner):
        return [(1, everything)]
    one, other = np.argsort(-size, kind="stable")[:2]
    ends = [everything[along <= gap], everything[along >= far - gap]]
    return [(1, np.concatenate([ends[0], inner[side == one], ends[1]])), (-1, inner[side == other])]


def _mean(points: Float[Array, "R 3"], along: Float[Array, " R"], step: float) -> Float[Array, "M 3"]:
    """Means of the points of each step along a line."""
    _, group = np.unique(np.floor(along / step), return_inverse=True)
    return np.stack([np.bincount(group, points[:, k]) for k in range(3)], 1) / np.bincount(group)[:, None]
