"""Flags along chains without their short runs: where something changes for good, and where it is noise."""

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask


def evened(
    flags: Bool[Mask, " S"],
    length: Float[Array, " S"],
    least: float,
    chain: Int[Index, " S"],
    closed: Bool[Mask, " S"] | None = None,
) -> Bool[Mask, " S"]:
    """The flags of steps along chains, of which runs of one flag that are shorter than `least` become like the rest.

    The shortest run goes first, of equals the first; it becomes one with its neighbours, until none is too short or all
    flags of the chain are the same. The viewer's page has the same rule for its contours (`contours.js`).

    Args:
        length: of each step; infinite where a run is to stay.
        chain: the number of each step's chain; chains lie one after the other.
        closed: whether the chain of each step comes back to its first step; by default none does.
    """
    even = flags.copy()
    while len(even):
        fresh = np.ones(len(even), bool)
        fresh[1:] = (chain[1:] != chain[:-1]) | (even[1:] != even[:-1])
        first = np.flatnonzero(fresh)
        run = np.cumsum(fresh) - 1
        total = np.bincount(run, length)
        onwards = chain[first[1:]] == chain[first[:-1]]
        before = np.append(-1, np.where(onwards, np.arange(len(first) - 1), -1))
        after = np.append(np.where(onwards, np.arange(1, len(first)), -1), -1)
        # Of equal runs the first; what goes on over the start of a closed chain is one run.
        one, other = np.flatnonzero(before < 0), np.flatnonzero(after < 0)
        around = np.zeros(len(one), bool) if closed is None else closed[first[one]] & (one != other)
        one, other = one[around], other[around]
        same = even[first[one]] == even[first[other]]
        before[one], after[other] = np.where(same, before[other], other), np.where(same, after[one], one)
        one, other = one[same], other[same]
        total[one] = total[other] = total[one] + total[other]
        rank = np.full(len(total) + 1, np.inf)
        rank[np.argsort(total, kind="stable")] = np.arange(len(total))
        rank[other] = rank[one]
        beside = np.minimum(rank[before], rank[after])
        turned = (total < least) & (rank[:-1] < beside) & np.isfinite(beside)
        if not turned.any():
            break
        even ^= turned[run]
    return even
