"""Rows of whole numbers that are equal: places of vertices, corners of faces."""

from collections.abc import Sequence

import numpy as np

from diff3ds._shapes import Bool, Index, Int, Mask

# Factors that mix whole numbers: the first 64 bits of the fractions of the square roots of 2, 3 and 5, made odd.
MIXED = np.array([0x6A09E667F3BCC909, 0xBB67AE8584CAA73B, 0x3C6EF372FE94F82B], np.uint64).view(np.int64)


def different(columns: Sequence[Int[Index, " N"]]) -> tuple[Int[Index, " D"], Int[Index, " N"]]:
    """Rows without those that are equal to one before: which these are, rising, and which of them each row is equal to.

    One number is sorted that mixes the columns; all columns are where two rows have it by chance.

    Args:
        columns: three, of whole numbers.
    """
    key = np.zeros(len(columns[0]), np.int64)
    for column, factor in zip(columns, MIXED, strict=True):
        # What are numbers of 32 bits as float64 differs in its upper half only.
        key += (column ^ (column >> 32)) * factor
    order = np.argsort(key, kind="stable")
    fresh = _changes(columns, order)
    if (fresh != _changes([key], order)).any():
        order = np.lexsort(list(columns))
        fresh = _changes(columns, order)
    first = order[fresh]
    rank = np.argsort(first)
    number = np.empty_like(rank)
    number[rank] = np.arange(len(rank))
    same = np.empty_like(order)
    same[order] = number[np.cumsum(fresh) - 1]
    return first[rank], same


def _changes(columns: Sequence[Int[Index, " N"]], order: Int[Index, " N"]) -> Bool[Mask, " N"]:
    """Which rows, in this order, are not equal to the one before."""
    fresh = np.zeros(len(order), bool)
    fresh[:1] = True
    for column in columns:
        ordered = column[order]
        fresh[1:] |= ordered[1:] != ordered[:-1]
    return fresh
