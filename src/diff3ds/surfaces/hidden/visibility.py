"""Which parts of strokes a surface hides from a camera: cut where that may change, decided for each part as a whole."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.even_out import evened
from diff3ds.page.chords import Chords, Ruler
from diff3ds.page.parts import Parts

# Which of the points at these parameters of these segments are hidden.
Ask = Callable[[Index, Array], Mask]

# A part is asked about at points so far apart, pixels, at so many at most. Empirical.
SPACING, MOST = 4.0, 200
# Parts shorter than this are what the part beside them is, pixels.
SHORTEST = 1.0


@dataclass(frozen=True)
class Care:
    """How exactly the lines of a view are found.

    Attributes:
        halvings: of an interval, as long as points are apart that are asked about, in which something changes that no
            outline has foretold.
        spacing: points of contours that are nearer to the one before, pixels, say nothing to the strokes that are
            fitted to them.
        least: so many points of a part are asked about at least.
    """

    halvings: int
    spacing: float
    least: int


# For drawings: 2^-30 of an interval is left. For films: a 128th of a pixel is. For what is measured in small pictures,
# within a pixel or two: a quarter.
EXACT, FOR_FILMS, FOR_MEASURES = Care(30, 0.0, 3), Care(9, 0.25, 3), Care(4, 0.5, 1)


def parts_of(
    chords: Chords,
    cuts: tuple[Int[Index, " X"], Float[Array, " X"]],
    ask: Ask,
    stray: float,
    care: Care = EXACT,
) -> Parts:
    """Strokes in parts that are seen, or hidden, as a whole.

    Args:
        chords: of the strokes.
        cuts: segments and parameters where something may change.
        ask: which of some points are hidden.
        stray: so large a share of a part's points that answer otherwise than the others is noise.
        care: how exactly.
    """
    if not len(chords.segment):
        return Parts.none()
    segment, start, stop = _between(chords, *cuts)
    ruler = Ruler(chords)
    hidden, segment, start, stop = _decided(segment, start, stop, ruler, ask, stray, care)
    length = ruler.length(segment, start, stop)
    return _merged(segment, start, stop, hidden, length)


def _between(
    chords: Chords, segment: Int[Index, " X"], t: Float[Array, " X"]
) -> tuple[Int[Index, " P"], Float[Array, " P"], Float[Array, " P"]]:
    """The parts between cuts."""
    # Runs of chords without a gap: a stroke that goes behind the camera and comes back has two.
    fresh = np.ones(len(chords.segment), bool)
    fresh[1:] = (chords.segment[1:] != chords.segment[:-1]) | (chords.start[1:] > chords.stop[:-1] + 1e-12)
    last = np.roll(fresh, -1)
    runs = chords.segment[fresh], chords.start[fresh], chords.stop[last]
    # Ends of runs come before and after cuts in the same place.
    kind = np.repeat([0, 2, 1], [len(runs[0]), len(runs[0]), len(t)])
    owner = np.concatenate([runs[0], runs[0], segment])
    value = np.concatenate([runs[1], runs[2], t])
    order = np.lexsort((kind, value, owner))
    owner, value, kind = owner[order], value[order], kind[order]
    depth = np.cumsum(kind == 0) - np.cumsum(kind == 2)
    inner = (depth[:-1] > 0) & (owner[1:] == owner[:-1]) & (value[1:] > value[:-1])
    return owner[:-1][inner], value[:-1][inner], value[1:][inner]


def _decided(
    segment: Int[Index, " P"],
    start: Float[Array, " P"],
    stop: Float[Array, " P"],
    ruler: Ruler,
    ask: Ask,
    stray: float,
    care: Care,
) -> tuple[Bool[Mask, " R"], Int[Index, " R"], Float[Array, " R"], Float[Array, " R"]]:
    """Parts with their answers, cut once more where points within one disagree for good."""
    count = np.clip(np.ceil(ruler.length(segment, start, stop) / SPACING), care.least, MOST).astype(np.int64)
    offset = np.cumsum(count) - count
    part = np.repeat(np.arange(len(segment)), count)
    shares = (np.arange(len(part)) - offset[part] + 0.5) / count[part]
    t = ruler.places(segment[part], start[part], stop[part], shares)
    hidden = ask(segment[part], t)
    if not len(part):
        return hidden, segment, start, stop
    votes = np.add.reduceat(hidden.astype(np.int64), offset)
    most = 2 * votes > count
    minority = np.minimum(votes, count - votes)
    mixed = minority > stray * count
    # What is alone between two of the other kind; what lies beyond the ends is not known.
    each = np.ones(len(part))
    each[offset] = each[offset + count - 1] = np.inf
    hidden = np.where(mixed[part], evened(hidden, each, 2, part), most[part])
    flips = np.flatnonzero((hidden[1:] != hidden[:-1]) & (part[1:] == part[:-1]))
    low, high, was = t[flips], t[flips + 1], hidden[flips]
    for _ in range(care.halvings if len(flips) else 0):
        middle = (low + high) / 2
        same = ask(segment[part[flips]], middle) == was
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    cut = (low + high) / 2
    of = part[flips]
    rows = np.concatenate([np.arange(len(segment)), of])
    begin = np.concatenate([start, cut])
    answer = np.concatenate([hidden[offset], ~was])
    order = np.lexsort((begin, rows))
    rows, begin, answer = rows[order], begin[order], answer[order]
    end = np.append(begin[1:], 0.0)
    final = np.append(rows[1:] != rows[:-1], True)
    end[final] = stop[rows[final]]
    return answer, segment[rows], begin, end


def _merged(
    segment: Int[Index, " P"],
    start: Float[Array, " P"],
    stop: Float[Array, " P"],
    hidden: Bool[Mask, " P"],
    length: Array,
) -> Parts:
    """Parts joined where nothing changes; short ones are made like the longer part beside them."""
    # What goes on in the next segment is drawn by itself all the same.
    fresh = np.ones(len(segment), bool)
    fresh[1:] = (segment[1:] != segment[:-1]) | (start[1:] > stop[:-1] + 1e-12)
    hidden = evened(hidden, length, SHORTEST, np.cumsum(fresh))
    fresh[1:] |= hidden[1:] != hidden[:-1]
    return Parts(segment[fresh], start[fresh], stop[np.roll(fresh, -1)], ~hidden[fresh])
