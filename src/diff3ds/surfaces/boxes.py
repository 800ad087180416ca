"""An index of boxes in the plane or in space: which of them hold a point, which meet a box, for many at once.

Boxes of all sizes are kept in grids of which each is twice as coarse as the one before: a box in the finest whose cells
are as large as it is, where it lies in at most two cells along each axis. A point is looked up in one cell a grid.
"""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float, Int
from diff3ds.surfaces.arrays import Index

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
