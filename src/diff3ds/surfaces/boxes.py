"""An index of boxes in the plane or in space: which of them hold a point, which meet a box, for many at once.

Boxes of all sizes are kept in grids of which each is twice as coarse as the one before: a box in the finest whose cells
are as large as it is, where it lies in at most two cells along each axis. A point is looked up in one cell a grid.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Int
from diff3ds.surfaces.arrays import Index

# Triangles so much longer than high, and than triangles of a mesh of such a size would be if all were of one, are
# looked for in halves. Speed only.
THIN, LARGE = 5.0, 8.0
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
    """

    origin: Float[Array, " D"]
    cell: float
    levels: Int[Index, " L"]
    keys: Int[Index, " X"]
    boxes: Int[Index, " X"]

    @staticmethod
    def of(low: Float[Array, "N D"], high: Float[Array, "N D"], cell: float) -> "BoxIndex":
        """The index of boxes from `low` to `high`.

        Args:
            cell: side of the finest cells, positive: about the size of most boxes.
        """
        if not len(low):
            return BoxIndex(np.zeros(low.shape[1]), 1.0, *(np.zeros(0, np.int64) for _ in range(3)))
        origin = low.min(0)
        reach = float((high.max(0) - origin).max())
        cell = max(cell, reach / (1 << (BITS - 1)), 1e-300)
        size = (high - low).max(1) / cell
        level = np.clip(np.ceil(np.log2(np.maximum(size, 1e-9))), 0, LEVELS).astype(np.int64)
        side = cell * 2.0 ** level[:, None]
        first = np.floor((low - origin) / side).astype(np.int64)
        last = np.floor((high - origin) / side).astype(np.int64)
        keys, boxes = [], []
        rows = np.arange(len(low))
        for corner in range(1 << low.shape[1]):
            chosen = np.array([corner >> axis & 1 for axis in range(low.shape[1])], bool)
            # A box within one cell along an axis is there once.
            real = ((last > first) | ~chosen).all(1)
            place = np.where(chosen, last, first)[real]
            keys.append(_keys(level[real], place))
            boxes.append(rows[real])
        flat, box = np.concatenate(keys), np.concatenate(boxes)
        order = np.argsort(flat, kind="stable")
        return BoxIndex(origin, cell, np.unique(level), flat[order], box[order])

    def around(self, points: Float[Array, "Q D"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
        """Pairs of a point and a box that may hold it; all that do are among them."""
        queries, boxes = [], []
        for level in self.levels:
            place = np.floor((points - self.origin) / (self.cell * 2.0**level))
            query = np.flatnonzero(((place >= 0) & (place < 1 << BITS)).all(1))
            found = self._entries(query, _keys(level, place[query].astype(np.int64)))
            queries.append(found[0])
            boxes.append(found[1])
        return _joined(queries), _joined(boxes)

    def counts(self, points: Float[Array, "Q D"]) -> Int[Index, " Q"]:
        """How many pairs `around` gives for each point."""
        total = np.zeros(len(points), np.int64)
        for level in self.levels:
            place = np.floor((points - self.origin) / (self.cell * 2.0**level))
            inside = np.flatnonzero(((place >= 0) & (place < 1 << BITS)).all(1))
            keys = _keys(level, place[inside].astype(np.int64))
            total[inside] += np.searchsorted(self.keys, keys, "right") - np.searchsorted(self.keys, keys, "left")
        return total

    def batches(self, points: Float[Array, "Q D"]) -> Iterator[slice]:
        """Runs of points that have at most `MOST_PAIRS` pairs each, or are one."""
        batch = np.cumsum(self.counts(points)) // MOST_PAIRS
        bounds = [0, *(np.flatnonzero(np.diff(batch)) + 1).tolist(), len(points)]
        yield from (slice(*ends) for ends in pairwise(bounds))

    def meeting(self, low: Float[Array, "Q D"], high: Float[Array, "Q D"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
        """Pairs of a given box and one of the index that may meet; all that do are among them, some twice.

        Given boxes should be no larger than the finest cells: they are looked up in every cell that they touch.
        """
        queries, boxes = [], []
        for level in self.levels:
            side = self.cell * 2.0**level
            first = np.clip(np.floor((low - self.origin) / side), -1, 1 << BITS).astype(np.int64)
            last = np.clip(np.floor((high - self.origin) / side), -1, 1 << BITS).astype(np.int64)
            counts = last - first + 1
            total = counts.prod(1)
            query = np.repeat(np.arange(len(low)), total)
            number = np.arange(len(query)) - np.repeat(np.cumsum(total) - total, total)
            place = np.empty((len(query), low.shape[1]), np.int64)
            for axis in range(low.shape[1]):
                number, rest = np.divmod(number, counts[query, axis])
                place[:, axis] = first[query, axis] + rest
            real = ((place >= 0) & (place < 1 << BITS)).all(1)
            found = self._entries(query[real], _keys(level, place[real]))
            queries.append(found[0])
            boxes.append(found[1])
        return _joined(queries), _joined(boxes)

    def _entries(self, query: Int[Index, " Q"], keys: Int[Index, " Q"]) -> tuple[Int[Index, " P"], Int[Index, " P"]]:
        start, stop = np.searchsorted(self.keys, keys, "left"), np.searchsorted(self.keys, keys, "right")
        counts = stop - start
        entry = np.repeat(start - (np.cumsum(counts) - counts), counts) + np.arange(int(counts.sum()))
        return np.repeat(query, counts), self.boxes[entry]


def _keys(level: Int[Index, " N"] | np.int64, place: Int[Index, "N D"]) -> Int[Index, " N"]:
    key = np.broadcast_to(level, len(place)).astype(np.int64)
    for axis in range(place.shape[1]):
        key = (key << BITS) | place[:, axis]
    return key


def _joined(parts: list[Index]) -> Index:
    return np.concatenate([np.zeros(0, np.int64), *parts])


def slices(corners: Float[Array, "N 3 D"], most: int) -> tuple[Float[Array, "M D"], Float[Array, "M D"], Index]:
    """Boxes around parts of triangles: long ones are halved, so that their boxes are not much larger than they are.

    Args:
        corners: of the triangles.
        most: halving ends at about so many boxes.

    Returns:
        Low and high corners of the boxes, and the triangle of each.
    """
    source = np.arange(len(corners))
    # Were all in one layer and of one size, each would be as large as this.
    spacing = float(np.ptp(corners, axis=(0, 1)).max()) / len(corners) ** 0.5 if len(corners) else 0.0
    done: list[tuple[Array, Index]] = []
    count = len(corners)
    while len(corners):
        thin, extent = _shapes(corners)
        thin &= extent > LARGE * spacing
        done.append((corners[~thin], source[~thin]))
        corners, source, extent = corners[thin], source[thin], extent[thin]
        # The largest first.
        now = extent > extent.max(initial=0.0) / 2
        if count + now.sum() > most:
            now[:] = False
        if not now.any():
            done.append((corners, source))
            break
        rest, others, corners, source = corners[~now], source[~now], corners[now], source[now]
        count += len(corners)
        sides = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2)
        turn = (sides.argmax(1)[:, None] + np.arange(3)) % 3
        a, b, c = (np.take_along_axis(corners, turn[:, k, None, None], 1)[:, 0] for k in range(3))
        middle = (a + b) / 2
        corners = np.concatenate([rest, np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        source = np.concatenate([others, source, source])
    if not done:
        nothing = np.zeros((0, corners.shape[2]))
        return nothing, nothing, source
    parts, of = np.concatenate([part for part, _ in done]), np.concatenate([row for _, row in done])
    return parts.min(1), parts.max(1), of


def _shapes(corners: Float[Array, "N 3 D"]) -> tuple[NDArray[np.bool_], Float[Array, " N"]]:
    """Whether triangles are much longer than high, and how large they are."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    base_by_height = np.maximum((u * u).sum(1) * (v * v).sum(1) - (u * v).sum(1) ** 2, 0) ** 0.5
    extent = np.ptp(corners, axis=1).max(1)
    return extent**2 > THIN * base_by_height, extent
