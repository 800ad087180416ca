"""How much each stroke adds to what those before it draw, and the strokes in that order.

What a stroke adds is its ink where none of those before it passes close by. Strokes are taken one after the other, each
time the one that adds most, or somewhat less and hangs together with what is there (docs/explanation/mathematics.md,
eq. 16).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.bezier import derivatives, evaluate, length
from diff3ds.chains import Chains
from diff3ds.curves.directions import unit
from diff3ds.sketch import Sketch

# Width of a pen, as a share of the diagonal of the strokes' box: about that of the default width in a picture that a
# sketch fills: two lines so near to each other are one on paper. And up to what distance lines beside each other say
# the less anew the nearer they run. Empirical.
PEN, BESIDE = 0.005, 0.06
# Pens from point to point: what two lines along each other may be apart, a pen, is half of it.
STEP = 2.0
# So many points say enough, but that each segment has one: of more ink the pen is wider. Speed.
MOST_SAMPLES = 10_000
# So much more a stroke counts that closes a gap between those already taken, where nothing else is said: its two ends,
# and two of theirs. Empirical.
TOGETHER = 0.5
# Gains that differ by less, as a share, are the same: rounding must not say which comes first.
SAME = 1e-6
# Strokes that follow on each other in the order and add about as much, to this share, are worth the same, so many at
# most: four legs of a chair, not three. Empirical. And how much less each group of such strokes is worth than the one
# before it where the share alone would not say.
ALIKE, MOST_ALIKE, LESS = 0.95, 4, 1e-4


@dataclass(frozen=True, eq=False)
class Samples:
    """Points along the strokes of a sketch, `STEP` pens apart at most.

    Attributes:
        place: world units.
        tangent: unit vectors, or 0 where a stroke has no length.
        stroke: the number of the stroke that each is on.
        ink: the length of line that each stands for, in pens, times its opacity and its width, as a share of the widest
            one. Strokes have round ends, so that a dot has some too.
        ends: where open strokes begin and end, and the number of the stroke.
        pen: its width, world units.
        beside: the distance up to which lines say less beside each other, at least that.
    """

    place: Float[Array, "P 3"]
    tangent: Float[Array, "P 3"]
    stroke: Int[Index, " P"]
    ink: Float[Array, " P"]
    ends: tuple[Float[Array, "E 3"], Int[Index, " E"]]
    pen: float
    beside: float


# What share of its ink each point shows in the drawings, or what multiple of it.
Shown = Callable[[Samples], Float[Array, " P"]]


class Ranked(NamedTuple):
    """Strokes by their importance.

    Attributes:
        sketch: the strokes, each with its `importance`.
        strokes: of each the number that it had.
    """

    sketch: Sketch
    strokes: list[int]


def ranked(sketch: Sketch, shown: Shown | None = None, *, sort: bool = True, together: float = TOGETHER) -> Ranked:
    """The strokes with their importance, the most important first.

    Where the order decides what lies on top, in a flat sketch of several colours, strokes stay in their places.

    Args:
        sketch: of any degree and chains.
        shown: how much of it is seen in the drawings that count; by default everything everywhere.
        sort: False leaves all strokes in their places.
        together: so much more a stroke counts that closes a gap between those already taken.
    """
    if not len(sketch):
        return Ranked(sketch.replace(importance=sketch.opacity.detach()), [])
    samples = samples_of(sketch)
    ink = samples.ink if shown is None else samples.ink * shown(samples)
    order, share = _ordered(samples, ink, sketch.color.detach().cpu().double().numpy(), together)
    importance = np.empty(len(sketch))
    importance[order] = share
    found = sketch.replace(importance=torch.from_numpy(importance).to(sketch.opacity))
    strokes = order.tolist() if sort and not _is_painted(sketch) else list(range(len(sketch)))
    return Ranked(found.select(strokes), strokes)


def samples_of(sketch: Sketch) -> Samples:
    """Points along the strokes."""
    chains = sketch.chains or Chains.plain(len(sketch))
    owner = chains.stroke.cpu().numpy()
    points, weights = sketch.points.detach().cpu().double(), sketch.weights.detach().cpu().double()
    size = float((points.amax((0, 1)) - points.amin((0, 1))).norm()) or 1.0
    lengths = length(points, weights, 0.01 * PEN * size).numpy()
    pen = max(PEN * size, float(lengths.sum()) / (STEP * MOST_SAMPLES))
    lengths /= pen
    counts = np.maximum(np.ceil(lengths / STEP), 1).astype(np.int64)
    place, tangent, row = [], [], []
    # Those of as many points at once.
    for count in np.unique(counts):
        rows = np.flatnonzero(counts == count)
        t = (torch.arange(int(count), dtype=torch.float64) + 0.5) / int(count)
        place.append(evaluate(points[rows], weights[rows], t).flatten(0, 1).numpy())
        tangent.append(derivatives(points[rows], weights[rows], t)[0].flatten(0, 1).numpy())
        row.append(np.repeat(rows, count))
    segment = np.concatenate(row)
    order = np.argsort(segment, kind="stable")
    segment, along = segment[order], np.concatenate(tangent)[order]
    stroke = owner[segment]
    round_ends = 1 / np.bincount(stroke, minlength=len(sketch))
    long = _evenly(np.linalg.norm(along, axis=1), segment, lengths) + round_ends[stroke]
    open_ = np.flatnonzero(~chains.closed.cpu().numpy())
    first = chains.first.cpu().numpy()
    ends = np.concatenate([points[first[open_], 0].numpy(), points[first[open_ + 1] - 1, -1].numpy()])
    return Samples(
        np.concatenate(place)[order],
        unit(along),
        stroke,
        long * _strength(sketch)[segment],
        (ends, np.concatenate([open_, open_])),
        pen,
        max(BESIDE * size, pen),
    )


def _evenly(speed: Float[Array, " P"], segment: Int[Index, " P"], lengths: Float[Array, " M"]) -> Float[Array, " P"]:
    """The length of each segment shared out among its points as fast as the curve is there."""
    whole = np.bincount(segment, speed, len(lengths))
    return speed * np.where(whole > 0, lengths / np.where(whole > 0, whole, 1.0), 0.0)[segment]


def _strength(sketch: Sketch) -> Float[Array, " M"]:
    """How much ink a length of each segment has: its opacity times its width, as a share of the widest."""
    looks = sketch.segments()
    width = looks.width.detach().cpu().double()
    width = width.mean(1) if width.ndim == 2 else width
    return (looks.opacity.detach().cpu().double() * width / (float(width.max()) or 1.0)).numpy()


def _ordered(
    samples: Samples, ink: Float[Array, " P"], color: Float[Array, "N 3"], together: float
) -> tuple[Int[Index, " N"], Float[Array, " N"]]:
    """The strokes in the order in which they are taken, and the share of all ink that each adds; it never grows."""
    count = len(color)
    point, stroke, cover = _covers(samples, color)
    # Points that each stroke draws of others: one stroke after the other.
    first = np.searchsorted(stroke, np.arange(count + 1))
    joints = _Joints(samples, count)
    drawn, left = np.zeros(len(ink)), np.ones(count, bool)
    gain = np.bincount(samples.stroke, ink, count)
    order, share = np.zeros(count, np.int64), np.zeros(count)
    for place in range(count):
        wanted = np.where(left, np.maximum(gain, 0) * (1 + together / 4 * np.minimum(joints.closed, 4)), -1.0)
        best = int(np.flatnonzero(wanted >= (1 - SAME) * wanted.max())[0])
        order[place], share[place], left[best] = best, max(float(gain[best]), 0.0), False
        joints.take(best)
        row = slice(first[best], first[best + 1])
        rows, now = point[row], np.maximum(cover[row], drawn[point[row]])
        # What others would draw of these points, and no longer add.
        gain -= np.bincount(samples.stroke[rows], ink[rows] * (now - drawn[rows]), count)
        drawn[rows] = now
    share[share < SAME * share.max()] = 0.0
    return order, _falling(share / (share.sum() or 1.0))


def _covers(
    samples: Samples, color: Float[Array, "N 3"]
) -> tuple[Int[Index, " C"], Int[Index, " C"], Float[Array, " C"]]:
    """Points, strokes they are not on, and how much of the point the stroke draws: all within a pen, then ever less.

    The less as well the more their colours and, farther away than a pen, their directions differ.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(samples.place)
    one, other = tree.query_pairs(samples.beside, output_type="ndarray").T
    apart = samples.stroke[one] != samples.stroke[other]
    one, other = one[apart], other[apart]
    away = np.linalg.norm(samples.place[one] - samples.place[other], axis=1)
    along = np.abs((samples.tangent[one] * samples.tangent[other]).sum(1))
    fading = (samples.beside - away) / max(samples.beside - samples.pen, 1e-300)
    cover = np.where(away <= samples.pen, 1.0, along * fading)
    cover *= 1 - np.abs(color[samples.stroke[one]] - color[samples.stroke[other]]).max(1).clip(0, 1)
    point = np.concatenate([one, other])
    stroke = samples.stroke[np.concatenate([other, one])]
    cover = np.concatenate([cover, cover])
    # The best of each pair, stroke by stroke.
    key = stroke * len(samples.place) + point
    order = np.argsort(key)
    first = np.flatnonzero(np.diff(key[order], prepend=-1) > 0)
    best = np.maximum.reduceat(cover[order], first) if len(first) else cover
    return point[order[first]], stroke[order[first]], best


class _Joints:
    """How many ends, its own and those of strokes already taken, each stroke lets hang together.

    Attributes:
        closed: the ends of each stroke that meet one that is taken, and those of taken ones that meet none yet but it.
    """

    def __init__(self, samples: Samples, count: int) -> None:
        from scipy.spatial import cKDTree

        self.closed = np.zeros(count)
        places, owner = samples.ends
        self._owner: list[int] = owner.tolist()
        near = cKDTree(samples.place).query_ball_point(places, samples.pen) if len(places) else []
        self._met = [np.setdiff1d(samples.stroke[found], [own]) for found, own in zip(near, self._owner, strict=True)]
        self._ends: list[list[int]] = [[] for _ in range(count)]
        self._meeting: list[list[int]] = [[] for _ in range(count)]
        for end, (met, own) in enumerate(zip(self._met, self._owner, strict=True)):
            self._ends[own].append(end)
            for stroke in met.tolist():
                self._meeting[stroke].append(end)
        self._hangs, self._taken = [False] * len(places), [False] * count

    def take(self, stroke: int) -> None:
        """Tells that a stroke is taken."""
        self._taken[stroke] = True
        for end in self._meeting[stroke]:
            if self._hangs[end]:
                continue
            self._hangs[end] = True
            if self._taken[self._owner[end]]:
                self.closed[self._met[end]] -= 1
            else:
                self.closed[self._owner[end]] += 1
        for end in self._ends[stroke]:
            if not self._hangs[end]:
                self.closed[self._met[end]] += 1


def _falling(share: Float[Array, " N"]) -> Float[Array, " N"]:
    """The shares as values that fall with the same sum but for rounding, or are the same where strokes are alike.

    Where they grow, because a stroke was taken for the sake of its neighbours, they are evened out.
    """
    group = np.zeros(len(share), np.int64)
    first = 0
    for place in range(1, len(share)):
        likeness = min(share[first], share[place]) - ALIKE * max(share[first], share[place])
        first = first if likeness >= 0 and place - first < MOST_ALIKE else place
        group[place] = group[place - 1] + (first == place)
    blocks: list[tuple[float, int, int]] = []
    for total, count in zip(np.bincount(group, share).tolist(), np.bincount(group).tolist(), strict=True):
        groups = 1
        while blocks and blocks[-1][0] * count <= total * blocks[-1][1]:
            before, many, more = blocks.pop()
            total, count, groups = total + before, count + many, groups + more
        blocks.append((total, count, groups))
    # A little less in turn, so that they can be told apart.
    each = np.concatenate([total / count * (1 - LESS * np.arange(groups)) for total, count, groups in blocks])
    return each[group]


def _is_painted(sketch: Sketch) -> bool:
    """Whether strokes of several colours lie in one plane, where later ones lie on top."""
    color = sketch.color.detach()
    if bool((color == color[:1]).all()):
        return False
    points = sketch.points.detach().cpu().double().flatten(0, 1)
    points = points - points.mean(0)
    spread = torch.linalg.svdvals(points)
    return len(spread) < 3 or bool(spread[2] <= 1e-6 * spread[0])
