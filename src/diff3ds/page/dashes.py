"""Dashes along parts of strokes, evenly spaced in the picture, over the joints of their segments too."""

import numpy as np

from diff3ds._shapes import Array, Float, Index
from diff3ds.page.chords import Chords, Ruler
from diff3ds.page.parts import Parts

# Of dashes and the gaps between them, as shares of the picture's height; lines and their round ends come on top.
# Empirical.
DASH, GAP = 0.009, 0.006


def dashed(parts: Parts, after: Index, chords: Chords, height: int, width: float) -> Parts:
    """The dashes of parts.

    Args:
        parts: in order.
        after: the segment that follows on each segment of the sketch, or -1.
        chords: of the same strokes.
        height: of the picture, pixels.
        width: of the lines, pixels: round ends reach half of it into the gaps.
    """
    dash, gap = DASH * height, GAP * height + width
    if not len(parts.segment):
        return parts
    ruler = Ruler(chords)
    low, high = ruler.position(parts.segment, parts.start), ruler.position(parts.segment, parts.stop)
    fresh = np.ones(len(low), bool)
    onwards = (parts.stop[:-1] == 1) & (parts.start[1:] == 0) & (after[parts.segment[:-1]] == parts.segment[1:])
    fresh[1:] = ~onwards
    run = np.cumsum(fresh) - 1
    last = np.append(np.flatnonzero(fresh)[1:] - 1, len(low) - 1)
    # A run begins and ends with a whole dash.
    begin, total = low[fresh], high[last] - low[fresh]
    count = np.maximum(np.round((total + gap) / (dash + gap)), 1)
    period = total / (count - gap / (dash + gap))
    return _within(parts, low, high, run, begin, count, period, dash / (dash + gap), ruler)


def _within(
    parts: Parts,
    low: Float[Array, " P"],
    high: Float[Array, " P"],
    run: Index,
    begin: Float[Array, " R"],
    count: Float[Array, " R"],
    period: Float[Array, " R"],
    share: float,
    ruler: Ruler,
) -> Parts:
    """Each part's share of the dashes of its run, which are such a share of their period."""
    beat = np.where(period > 0, period, 1.0)[run]
    first = np.floor((low - begin[run]) / beat)
    final = np.minimum(np.floor((high - begin[run]) / beat), count[run] - 1)
    numbers = np.maximum(final - first + 1, 0).astype(np.int64)
    part = np.repeat(np.arange(len(low)), numbers)
    number = np.arange(len(part)) - np.repeat(np.cumsum(numbers) - numbers, numbers) + first[part]
    on = begin[run[part]] + number * beat[part]
    off = on + beat[part] * share
    one, other = np.maximum(on, low[part]), np.minimum(off, high[part])
    real = (other > one) | (period[run[part]] == 0)
    part, one, other = part[real], one[real], other[real]
    length = np.maximum(high - low, 1e-300)[part]
    segment, start, stop = parts.segment[part], parts.start[part], parts.stop[part]
    ends = []
    for place in (one, other):
        t = ruler.places(segment, start, stop, (place - low[part]) / length)
        # Ends of parts to the last bit: what goes on in the next segment is joined to it.
        ends.append(np.where(place <= low[part], start, np.where(place >= high[part], stop, t)))
    return Parts(segment, ends[0], ends[1], parts.visible[part])
