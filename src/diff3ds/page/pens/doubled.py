"""Tracks without what lies on ink that is drawn already: a pen that draws a line twice tears the paper."""

import math
from collections.abc import Sequence

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.page.pens.track import Samples, Track

# Samples in a pen's width.
SAMPLES = 4
# Of lines that turn against each other by more than this, radians, neither lies on the other: they cross. [empirical]
ALONG = math.radians(15)
# What lies on other ink is left out where it is so many pens long, or so many and in the mean so near, in pens, to the
# middle of the other line: lines that cross or part at a small angle stay whole. [empirical]
LONG, SHORT, NEAR = 12.0, 2.0, 0.125
# A track comes back onto itself no sooner than so many pens along it. [empirical]
SELF = 2.0


def without_doubled(tracks: Sequence[Track], pen: float) -> list[Track]:
    """The tracks without the parts that lie within half a pen's width of others, longer ones, or of earlier parts.

    Args:
        pen: its width, pixels.
    """
    if not tracks:
        return []
    samples = Samples.of(tracks, pen / SAMPLES)
    lengths = np.bincount(samples.track, samples.length, len(tracks))
    rank = np.empty(len(tracks), np.int64)
    rank[np.argsort(-lengths, kind="stable")] = np.arange(len(tracks))
    i, j, off = _beside(samples, rank, pen)
    bounds = np.searchsorted(rank[samples.track[i]], np.arange(len(tracks) + 1))
    rows = np.searchsorted(samples.track, np.arange(len(tracks) + 1))
    kept = np.ones(len(samples.track), bool)
    for track in np.argsort(rank):
        some = slice(*bounds[rank[track] : rank[track] + 2])
        own = slice(*rows[track : track + 2])
        if some.start == some.stop:
            continue
        nearest = np.full(own.stop - own.start, math.inf)
        there = kept[j[some]]
        np.minimum.at(nearest, i[some][there] - own.start, off[some][there])
        kept[own] = ~_left_out(nearest, samples.length[own], pen)
    return [
        part
        for track, row in zip(tracks, range(len(tracks)), strict=True)
        for part in _parts(track, row, samples, kept, rows)
    ]


def _beside(
    samples: Samples, rank: Int[Index, " T"], pen: float
) -> tuple[Int[Index, " P"], Int[Index, " P"], Float[Array, " P"]]:
    """Pairs of samples of which the first may lie on the ink of the second, sorted by the rank of the first's track.

    Returns:
        Both, and how far the first lies off the line of the second.
    """
    from scipy.spatial import cKDTree

    # Of the samples of a line one is nearer than half a cell along it.
    reach = math.hypot(pen / 2, pen / SAMPLES / 2)
    pairs = cKDTree(samples.points).query_pairs(reach, output_type="ndarray")
    i, j = pairs.T
    swapped = rank[samples.track[i]] < rank[samples.track[j]]
    same = samples.track[i] == samples.track[j]
    swapped |= same & (i < j)
    i, j = np.where(swapped, j, i), np.where(swapped, i, j)
    total = np.cumsum(samples.length)
    apart = total[i] - total[j]
    lengths = np.bincount(samples.track, samples.length)
    apart = np.where(same, np.minimum(apart, lengths[samples.track[i]] - apart), math.inf)
    way = samples.points[i] - samples.points[j]
    one, other = samples.direction[i], samples.direction[j]
    off = np.abs(way[:, 0] * other[:, 1] - way[:, 1] * other[:, 0])
    fits = (np.abs((one * other).sum(1)) > math.cos(ALONG)) & (off <= pen / 2) & (apart > SELF * pen)
    i, j, off = i[fits], j[fits], off[fits]
    order = np.argsort(rank[samples.track[i]], kind="stable")
    return i[order], j[order], off[order]


def _left_out(off: Float[Array, " n"], length: Float[Array, " n"], pen: float) -> Bool[Mask, " n"]:
    """Which samples of a track are left out, that lie so far off the lines of other ink."""
    on = np.isfinite(off)
    if on.all():
        return on
    out = np.zeros(len(on), bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]])))
    for start, stop in edges.reshape(-1, 2):
        run = float(length[start:stop].sum())
        near = float(off[start:stop].mean()) < NEAR * pen
        out[start:stop] = run >= LONG * pen or (run >= SHORT * pen and near)
    return out


def _parts(track: Track, row: int, samples: Samples, kept: Bool[Mask, " S"], rows: Int[Index, " R"]) -> list[Track]:
    """What is left of a track."""
    own = slice(*rows[row : row + 2])
    left = kept[own]
    if left.all():
        return [track]
    begin, end = samples.place[own], samples.place[own] + samples.size[own]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], left, [False]])))
    return [track.part(begin[start], end[stop - 1]) for start, stop in edges.reshape(-1, 2)]
