"""Where points lie on straight lines, and which of them lie along some."""

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Mask
from diff3ds.curves.directions import unit
from diff3ds.page.boxes import BoxIndex

# Lines that turn by less go the same way, cosine. Empirical.
SAME_WAY = 0.8


def along_chords(
    middles: Float[Array, "N 3"],
    chords: Float[Array, "C 2 3"],
    tolerance: float,
    ways: Float[Array, "N 3"] | None = None,
) -> Bool[Mask, " N"]:
    """Which points lie on straight chords of curves, within the tolerance, that go the ways of these, unit vectors."""
    along = np.zeros(len(middles), bool)
    index = index_of(chords.min(1), chords.max(1), tolerance)
    for query, chord in index.batches(middles):
        found, _ = on_segments(middles[query], chords[chord])
        near = np.linalg.norm(found - middles[query], axis=1) <= tolerance
        if ways is not None:
            own = unit(chords[chord, 1] - chords[chord, 0])
            near &= np.abs(np.einsum("pi,pi->p", own, ways[query])) > SAME_WAY
        along[query[near]] = True
    return along


def index_of(low: Float[Array, "N 3"], high: Float[Array, "N 3"], tolerance: float) -> BoxIndex:
    """The index of boxes that reach farther by the tolerance."""
    low, high = low - tolerance, high + tolerance
    return BoxIndex.of(low, high, float(np.median((high - low).max(1))) if len(low) else 1.0)


def on_segments(
    points: Float[Array, "P 3"], ends: Float[Array, "P 2 3"]
) -> tuple[Float[Array, "P 3"], Float[Array, " P"]]:
    """The closest points of segments, and the share of the way along each."""
    way = ends[:, 1] - ends[:, 0]
    length = np.einsum("pi,pi->p", way, way)
    share = np.einsum("pi,pi->p", points - ends[:, 0], way) / np.where(length > 0, length, 1.0)
    share = np.clip(share, 0, 1)
    return ends[:, 0] + share[:, None] * way, share
