"""Faces of any number of corners cut into triangles, each in its own plane: concave ones, and holes by bridge edges."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask

# Corners, and pairs of them, that are looked at for all faces of a file together: about a minute.
MOST_PAIRS = 1 << 28
AT_ONCE = 1 << 21
# Of the square of a face's size: what is less is no area. Rounding is a few thousand times smaller.
FLAT = 1e-12
# Of the longer side of a face: corners so near to an ear's range are looked at. Rounding is far below it.
BESIDE = 1e-6
# As much of a face's area may be covered twice before it counts as one that crosses itself. Empirical: bent faces.
TWICE = 1e-3


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of polygons.

    Attributes:
        rows: of each, three of the polygons' corners, in the polygon's own direction.
        polygon: the polygon that each is of; rising.
        crossed: how many polygons cross themselves, or are so far from flat that their picture does.
    """

    rows: Int[Index, "T 3"]
    polygon: Int[Index, " T"]
    crossed: int


def triangulated(points: Float[Array, "C 3"], sizes: Int[Index, " P"]) -> Triangles:
    """All polygons cut into triangles between their own corners; those of fewer than three corners are left out.

    What fans out from its first corner without an overlap is cut so. Of others ears are cut off, the best shaped first:
    triangles of three corners in a row that hold no other corner.

    Args:
        points: where the corners of all polygons lie, one polygon after the other.
        sizes: corners of each polygon.

    Raises:
        ValueError: so many corners that it would take more than about a minute.
    """
    first = np.cumsum(sizes) - sizes
    kept = np.flatnonzero(sizes >= 3)
    count = sizes[kept] - 2
    polygon = np.repeat(kept, count)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(count) - count, count)
    rows = first[polygon][:, None] + np.stack([np.zeros_like(step), step + 1, step + 2], 1)
    if not (sizes > 3).any():
        return Triangles(rows, polygon, 0)
    flat, area = _in_plane(points, first, sizes)
    a, b, c = (flat[rows[:, k]] for k in range(3))
    bad = np.unique(polygon[~(_cross(b - a, c - a) > FLAT * area[polygon])])
    bad = bad[sizes[bad] > 3]
    if not len(bad):
        return Triangles(rows, polygon, 0)
    ears, of = _Clipping(flat, first[bad], sizes[bad]).triangles()
    kept_rows = ~np.isin(polygon, bad)
    rows, polygon = np.concatenate([rows[kept_rows], ears]), np.concatenate([polygon[kept_rows], bad[of]])
    order = np.argsort(polygon, kind="stable")
    a, b, c = flat[ears].transpose(1, 0, 2)
    signed = _cross(b - a, c - a)
    over = np.bincount(of, np.maximum(-signed, 0), len(bad)) > TWICE * np.bincount(of, np.abs(signed), len(bad))
    return Triangles(rows[order], polygon[order], int(over.sum()))


def _in_plane(
    points: Float[Array, "C 3"], first: Int[Index, " P"], sizes: Int[Index, " P"]
) -> tuple[Float[Array, "C 2"], Float[Array, " P"]]:
    """The corners along the two axes that show most of each polygon, which runs counter-clockwise there, and its area.

    To leave an axis out rounds nothing.
    """
    of = np.repeat(np.arange(len(sizes)), sizes)
    last = first + sizes - 1
    following = np.arange(1, len(points) + 1)
    following[last[sizes > 0]] = first[sizes > 0]
    local = points - points[first[of]]
    x, y, z = local.T
    onward = [axis[following] for axis in (x, y, z)]
    across = (y * onward[2] - z * onward[1], z * onward[0] - x * onward[2], x * onward[1] - y * onward[0])
    normal = np.stack([np.bincount(of, part, len(sizes)) for part in across], 1)
    axis = np.abs(normal).argmax(1)
    sign = np.take_along_axis(normal, axis[:, None], 1)[:, 0] < 0
    x, y = (axis + 1) % 3, (axis + 2) % 3
    x, y = np.where(sign, y, x)[of], np.where(sign, x, y)[of]
    flat = np.stack([np.take_along_axis(local, k[:, None], 1)[:, 0] for k in (x, y)], 1)
    return flat, np.abs(np.take_along_axis(normal, axis[:, None], 1)[:, 0])


def _cross(u: Float[Array, "N 2"], v: Float[Array, "N 2"]) -> Float[Array, " N"]:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


class _Clipping:
    """Cuts ears off all polygons side by side: in each round those that are better shaped than their neighbours."""

    def __init__(self, flat: Float[Array, "C 2"], first: Int[Index, " P"], sizes: Int[Index, " P"]) -> None:
        self._row = np.repeat(first - np.cumsum(sizes) + sizes, sizes) + np.arange(int(sizes.sum()))
        self._p = flat[self._row]
        self._of = np.repeat(np.arange(len(sizes)), sizes)
        start = np.cumsum(sizes) - sizes
        nodes = np.arange(len(self._p))
        self._before, self._after = nodes - 1, nodes + 1
        self._before[start], self._after[start + sizes - 1] = start + sizes - 1, start
        self._left = sizes.copy()
        low, high = (f.reduceat(self._p, start, axis=0) for f in (np.minimum, np.maximum))
        sides = high - low
        self._flat = FLAT * (sides.max(1) ** 2)[self._of]
        # A number a polygon, plus where in it along its longer side.
        axis = sides.argmax(1)[:, None]
        start_along, side = (np.take_along_axis(of, axis, 1)[self._of, 0] for of in (low, sides))
        along = np.take_along_axis(self._p, axis[self._of], 1)[:, 0] - start_along
        self._place = self._of + along / np.where(side > 0, 2 * side, 1.0)
        # Corners that are straight, or turn the other way, are what can lie in an ear.
        self._dull = np.zeros(len(self._p), bool)
        self._score = np.full(len(self._p), -np.inf)
        self._pairs = 0

    def triangles(self) -> tuple[Int[Index, "T 3"], Int[Index, " T"]]:
        """The triangles as rows of the given corners, and their polygons."""
        found = []
        fresh = active = np.arange(len(self._p))
        self._look(fresh)
        while len(active):
            cut = self._best(active)
            found.append(np.stack([self._before[cut], cut, self._after[cut]], 1))
            self._count(len(active))
            before, after = self._before[cut], self._after[cut]
            self._after[before], self._before[after] = after, before
            np.subtract.at(self._left, self._of[cut], 1)
            self._score[cut], self._dull[cut] = -np.inf, False
            gone = np.zeros(len(self._p), bool)
            gone[cut] = True
            active = active[~gone[active] & (self._left[self._of[active]] > 2)]
            fresh = np.unique(np.concatenate([before, after]))
            self._look(fresh[self._left[self._of[fresh]] > 2])
        ears = np.concatenate(found)
        return self._row[ears], self._of[ears[:, 0]]

    def _best(self, active: Int[Index, " A"]) -> Int[Index, " E"]:
        """Ears that are better than both of their neighbours; where a polygon has none, what does least harm."""
        score, before, after = self._score, self._before[active], self._after[active]
        own = score[active]
        # Of two that are as good the first in the file counts.
        better = ((own > score[before]) | ((own == score[before]) & (active < before))) & (
            (own > score[after]) | ((own == score[after]) & (active < after))
        )
        ears = active[better & (own > 0)]
        # Of the last three corners one is cut off, and nothing is left to be cut.
        ears = ears[(self._left[self._of[ears]] > 3) | (self._rank(ears) == 0)]
        stuck = active[~np.isin(self._of[active], self._of[ears])]
        if not len(stuck):
            return np.asarray(ears)
        harm = np.abs(
            _cross(self._p[stuck] - self._p[self._before[stuck]], self._p[self._after[stuck]] - self._p[stuck])
        )
        order = np.lexsort((harm, self._of[stuck]))
        _, least = np.unique(self._of[stuck[order]], return_index=True)
        return np.concatenate([ears, stuck[order[least]]])

    def _rank(self, nodes: Int[Index, " E"]) -> Int[Index, " E"]:
        """The how manieth of its polygon each node is."""
        _, start, of = np.unique(self._of[nodes], return_index=True, return_inverse=True)
        return np.asarray(np.arange(len(nodes)) - start[of], np.int64)

    def _look(self, nodes: Int[Index, " N"]) -> None:
        """Finds which of the nodes are ears, and how well shaped: 0 where they are none."""
        a, b, c = self._p[self._before[nodes]], self._p[nodes], self._p[self._after[nodes]]
        area = _cross(b - a, c - a)
        self._dull[nodes] = dull = area <= self._flat[nodes]
        longest = np.stack([((u - v) ** 2).sum(1) for u, v in ((a, b), (b, c), (c, a))]).max(0)
        self._score[nodes] = np.where(dull, -np.inf, area / np.where(longest > 0, longest, 1.0))
        sharp = nodes[~dull]
        other = np.flatnonzero(self._dull)
        other = other[np.argsort(self._place[other])]
        places = np.stack([self._place[k] for k in (self._before[sharp], sharp, self._after[sharp])])
        begin = np.searchsorted(self._place[other], places.min(0) - BESIDE)
        count = np.searchsorted(self._place[other], places.max(0) + BESIDE) - begin
        self._count(int(count.sum()))
        bounds = np.searchsorted(np.cumsum(count), np.arange(AT_ONCE, count.sum() + AT_ONCE, AT_ONCE), "right")
        for some in np.split(np.arange(len(sharp)), bounds):
            if len(some):
                each = count[some]
                ear = np.repeat(sharp[some], each)
                rank = np.arange(len(ear)) - np.repeat(np.cumsum(each) - each, each)
                blocked = ear[self._holds(ear, other[np.repeat(begin[some], each) + rank])]
                self._score[blocked] = -np.inf

    def _count(self, pairs: int) -> None:
        self._pairs += pairs
        if self._pairs > MOST_PAIRS:
            raise ValueError("faces have so many corners that they are not cut into triangles: triangulate them first")

    def _holds(self, ear: Int[Index, " N"], other: Int[Index, " N"]) -> Bool[Mask, " N"]:
        """Whether another corner lies in an ear, or on its border but where it has its own corners."""
        q, eps = self._p[other], self._flat[ear]
        corners = [self._p[k] for k in (self._before[ear], ear, self._after[ear])]
        inside = np.ones(len(ear), bool)
        for u, v in ((0, 1), (1, 2), (2, 0)):
            inside &= _cross(corners[v] - corners[u], q - corners[u]) >= -eps
        # Bridges to holes visit a place twice.
        for corner in corners:
            inside &= (q != corner).any(1)
        return inside
