"""An index of boxes in the plane or in space: which of them hold a point, which meet a box; and pairs of discs.

Boxes of all sizes are kept in grids of which each is twice as coarse as the one before: a box in the finest whose cells
are as large as it is, where it lies in at most two cells along each axis. A point is looked up in one cell a grid.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Index, Int, Mask, Tensor
from diff3ds.render.backends import for_kernels, kernels

# Triangles so much longer than high, and than triangles of a mesh of such a size would be if all were of one, are
# looked for in halves. Speed only.
THIN, LARGE = 5.0, 8.0
# Long triangles are halved until there are so many boxes a triangle, since boxes cost time, too. Speed only.
MOST_BOXES = 1.25
# So many pairs are looked at together: some hundred megabytes.
MOST_PAIRS = 1 << 21
# Grids are at most so much coarser than the finest, in powers of two; bits of a cell's number along an axis.
LEVELS, BITS = 18, 19


@dataclass(frozen=True, eq=False)
class BoxIndex:
    """Boxes by the cells that they lie in.

    Attributes:
        origin: the least coordinates of all boxes.
        cell: side of the finest grid's cells.
        levels: the grids that hold boxes, 0 for the finest.
        keys: grid and cell of each entry, sorted.
        boxes: the box of each entry.
        low: the least coordinates of each box.
        high: the largest.
    """

    origin: Float[Array, " D"]
    cell: float
    levels: Int[Index, " L"]
    keys: Int[Index, " X"]
    boxes: Int[Index, " X"]
    low: Float[Array, "N D"]
    high: Float[Array, "N D"]

    @staticmethod
    def of(low: Float[Array, "N D"], high: Float[Array, "N D"], cell: float) -> "BoxIndex":
        """The index of boxes from `low` to `high`.

        Args:
            cell: side of the finest cells, positive: about the size of most boxes.
        """
        if not len(low):
            none = np.zeros(0, np.int64)
            return BoxIndex(np.zeros(low.shape[1]), 1.0, none, none, none, low, high)
        origin = low.min(0)
        reach = float((high.max(0) - origin).max())
        cell = max(cell, reach / (1 << (BITS - 1)), 1e-300)
        size = largest(high - low) / cell
        level = np.clip(np.ceil(np.log2(np.maximum(size, 1e-9))), 0, LEVELS).astype(np.int64)
        side = np.ldexp(cell, level)
        first, last = (
            # Axis by axis, see `largest`.
            [np.floor((x - start) / side).astype(np.int64) for x, start in zip(corner.T, origin, strict=True)]
            for corner in (low, high)
        )
        keys, boxes = [], []
        rows = np.arange(len(low))
        for corner in range(1 << len(origin)):
            chosen = [corner >> axis & 1 for axis in range(len(origin))]
            # A box within one cell along an axis is there once.
            real = rows
            for a, b, far in zip(first, last, chosen, strict=True):
                real = real[b[real] > a[real]] if far else real
            ends = [b if far else a for a, b, far in zip(first, last, chosen, strict=True)]
            keys.append(_keys(level[real], [end[real] for end in ends]))
            boxes.append(real)
        flat, box = np.concatenate(keys), np.concatenate(boxes)
        order = in_order(flat)
        return BoxIndex(origin, cell, np.unique(level), flat[order], box[order], low, high)

    def around(self, points: Float[Array, "Q D"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
        """Pairs of a point and a box that holds it, some twice."""
        return self.meeting(points, points)

    def meeting(self, low: Float[Array, "Q D"], high: Float[Array, "Q D"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
        """Pairs of a given box and one of the index that meet, some twice.

        Given boxes should be no larger than the finest cells: they are looked up in every cell that they touch.
        """
        found = list(self._runs(low, high))
        return _joined([query for query, _ in found]), _joined([boxes for _, boxes in found])

    def batches(self, points: Float[Array, "Q D"]) -> Iterator[tuple[Int[Index, " P"], Int[Index, " P"]]]:
        """The pairs of `around` for run after run of points that have about `MOST_PAIRS` of them, or are one."""
        return self._runs(points, points)

    def _runs(
        self, low: Float[Array, "Q D"], high: Float[Array, "Q D"]
    ) -> Iterator[tuple[Int[Index, " P"], Int[Index, " P"]]]:
        """The pairs of `meeting` for run after run of given boxes."""
        if meeting := getattr(kernels(), "boxes_meeting", None):
            ends = for_kernels(low, high)
            done = 0
            while done < len(low):
                query, box, done = meeting(*self.tables, *ends, done, MOST_PAIRS)
                # Of C's long long, which numpy tells from its own integers.
                yield query.view(np.int64), box.view(np.int64)
            return
        cells = [self._cells(level, low, high) for level in self.levels]
        total = np.zeros(len(low), np.int64)
        for query, start, stop in cells:
            np.add.at(total, query, stop - start)
        batch = np.cumsum(total) // MOST_PAIRS
        bounds = [0, *(np.flatnonzero(np.diff(batch)) + 1).tolist(), len(low)]
        for some in pairwise(bounds):
            found = []
            for query, start, stop in cells:
                rows = slice(*np.searchsorted(query, some))
                found.append(self._entries(query[rows], start[rows], stop[rows]))
            query, box = _joined([query for query, _ in found]), _joined([boxes for _, boxes in found])
            # A cell holds many boxes that do not meet a given one: most pairs end here.
            for given_low, given_high, own_low, own_high in zip(low.T, high.T, self.low.T, self.high.T, strict=True):
                met = (own_low[box] <= given_high[query]) & (given_low[query] <= own_high[box])
                query, box = query[met], box[met]
            yield query, box

    @cached_property
    def tables(self) -> tuple[tuple[Tensor, ...], float, int]:
        """The index for the compiled kernels."""
        given = for_kernels(self.origin, self.levels, self.keys, self.boxes, self.low, self.high)
        return tuple(given), self.cell, BITS

    def _cells(
        self, level: np.int64, low: Float[Array, "Q D"], high: Float[Array, "Q D"]
    ) -> tuple[Index, Index, Index]:
        """The cells of a grid that given boxes touch: whose box, in order, and where their entries start and stop."""
        side = self.cell * 2.0**level
        # What is no number is in no cell.
        places = [np.nan_to_num(np.floor((x - self.origin) / side), nan=-1.0) for x in (low, high)]
        first, last = (np.clip(place, -1, 1 << BITS).astype(np.int64) for place in places)
        counts = last - first + 1
        total = counts.prod(1)
        query = np.repeat(np.arange(len(low)), total)
        number = np.arange(len(query)) - np.repeat(np.cumsum(total) - total, total)
        place = np.empty((len(query), low.shape[1]), np.int64)
        for axis in range(low.shape[1]):
            number, rest = np.divmod(number, counts[query, axis])
            place[:, axis] = first[query, axis] + rest
        real = _in_grid(place)
        keys = _keys(level, place[real].T)
        return query[real], np.searchsorted(self.keys, keys, "left"), np.searchsorted(self.keys, keys, "right")

    def _entries(
        self, query: Int[Index, " Q"], start: Int[Index, " Q"], stop: Int[Index, " Q"]
    ) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
        counts = stop - start
        entry = np.repeat(start - (np.cumsum(counts) - counts), counts) + np.arange(int(counts.sum()))
        return np.repeat(query, counts), self.boxes[entry]


def _keys(level: Int[Index, " N"] | np.int64, place: Sequence[Index] | Int[Index, "D N"]) -> Int[Index, " N"]:
    key = np.broadcast_to(level, len(place[0])).astype(np.int64)
    for number in place:
        key = (key << BITS) | number
    return key


def in_order(keys: Int[Index, " N"]) -> Int[Index, " N"]:
    """The rows by rising keys, those of one key by rising rows; fewer than 2^32.

    Numpy's own stable sort takes three times as long as two that need not be stable.
    """
    order = np.argsort(keys)
    found = keys[order]
    group = np.cumsum(np.concatenate([np.zeros(len(keys[:1]), np.int64), found[1:] != found[:-1]]))
    rows: Index = np.sort(group << 32 | order) & 0xFFFFFFFF
    return rows


def _in_grid(place: Int[Index, "N D"]) -> Mask:
    return all_of((place >= 0) & (place < 1 << BITS))


# Numpy takes five times as long to go along axes of two or three values as to take their columns one by one.
def largest(values: Float[Array, "N D"]) -> Float[Array, " N"]:
    """The largest value of each row; of few columns."""
    return reduce(np.maximum, values.T)


def all_of(flags: NDArray[np.bool_]) -> Mask:
    """Whether all flags of a row are set; of few columns."""
    return reduce(np.logical_and, flags.T)


def around_triangles(corners: Float[Array, "N 3 D"]) -> tuple[Float[Array, "N D"], Float[Array, "N D"]]:
    """The low and high corners of boxes around triangles."""
    a, b, c = corners.transpose(1, 0, 2)
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _joined(parts: list[Index]) -> Index:
    return np.concatenate([np.zeros(0, np.int64), *parts])


def slices(corners: Float[Array, "N 3 D"]) -> tuple[Float[Array, "M D"], Float[Array, "M D"], Index]:
    """Boxes around parts of triangles: long ones are halved, so that their boxes are not much larger than they are.

    Args:
        corners: of the triangles.

    Returns:
        Low and high corners of the boxes, and the triangle of each.
    """
    source = np.arange(len(corners))
    done: list[tuple[Array, Array, Index]] = []
    count, most = len(corners), MOST_BOXES * len(corners)
    # Were all in one layer and of one size, each would be as large as this.
    spacing = max(float(np.ptp(x)) for x in corners.transpose(2, 0, 1)) / count**0.5 if count else 0.0
    while len(corners):
        low, high = around_triangles(corners)
        extent = largest(high - low)
        thin = _are_thin(corners, extent, LARGE * spacing)
        # The largest first.
        now = thin & (extent > extent[thin].max(initial=0.0) / 2)
        if not now.any() or count + now.sum() > most:
            done.append((low, high, source))
            break
        done.append((low[~thin], high[~thin], source[~thin]))
        count += int(now.sum())
        later = thin & ~now
        halves, of = _halves(corners[now]), source[now]
        corners, source = np.concatenate([corners[later], *halves]), np.concatenate([source[later], of, of])
    if not done:
        nothing = np.zeros((0, corners.shape[2]))
        return nothing, nothing, source
    if len(done) == 1:
        return done[0]
    return np.concatenate([b[0] for b in done]), np.concatenate([b[1] for b in done]), _joined([b[2] for b in done])


def _are_thin(corners: Float[Array, "N 3 D"], extent: Float[Array, " N"], least: float) -> Mask:
    """Which triangles are larger than this and much longer than high."""
    thin = extent > least
    rows = np.flatnonzero(thin)
    a, b, c = corners[rows].transpose(1, 2, 0)
    u, v = b - a, c - a
    base_by_height = np.sqrt(np.maximum(sum(u * u) * sum(v * v) - sum(u * v) ** 2, 0))
    thin[rows] = extent[rows] ** 2 > THIN * base_by_height
    return thin


def _halves(corners: Float[Array, "N 3 D"]) -> tuple[Float[Array, "N 3 D"], Float[Array, "N 3 D"]]:
    """Triangles cut across their longest sides."""
    sides = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2)
    turn = (sides.argmax(1)[:, None] + np.arange(3)) % 3
    a, b, c = (np.take_along_axis(corners, turn[:, k, None, None], 1)[:, 0] for k in range(3))
    middle = (a + b) / 2
    return np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)


def near_pairs(points: Float[Array, "N 2"], reach: Float[Array, " N"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
    """Pairs of points that are not farther apart than the sum of their reaches, and some others; first the lower row.

    Points of like reaches are looked for together.
    """
    from scipy.spatial import cKDTree

    if not len(points):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    size = np.ceil(np.log2(np.maximum(reach, 1.0))).astype(np.int64)
    classes = [np.flatnonzero(size == k) for k in np.unique(size)]
    trees = [cKDTree(points[rows]) for rows in classes]
    largest = [float(reach[rows].max()) for rows in classes]
    pairs: list[tuple[Index, Index]] = []
    for k, rows in enumerate(classes):
        both = trees[k].query_pairs(2 * largest[k], output_type="ndarray")
        pairs.append((rows[both[:, 0]], rows[both[:, 1]]))
        for other, others in enumerate(classes[:k]):
            found = trees[k].sparse_distance_matrix(trees[other], largest[k] + largest[other], output_type="ndarray")
            pairs.append((rows[found["i"]], others[found["j"]]))
    first, second = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return np.minimum(first, second), np.maximum(first, second)
