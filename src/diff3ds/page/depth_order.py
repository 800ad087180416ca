"""In which order strokes are painted over each other, and where they are cut because that order changes along them.

The renderer sorts by depth in every pixel; a drawing of paths has one order for each. So where the ink of two strokes
meets on the page, one must come after the other. If these demands go round in a circle, as in a knot, strokes of it are
cut between places where they are in front and places where they are behind.
"""

import heapq
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Float, Int
from diff3ds.page.boxes import near_pairs
from diff3ds.page.screen_pieces import Pieces
from diff3ds.project import Strokes2D

# Pixels: how long the chords are by which meeting places are found, and how far they may be off the curve.
CHORD, SAG = 8.0, 0.25
MOST_CHORDS = 64
# Of the sum of half widths: strokes that only touch need no order.
TOUCH = 0.9
# Of the depth: what is as deep as that needs no order, such as strokes that begin at one point.
EQUAL = 1e-6
# Of a chord: what meets at its end is not on the next one.
_INSIDE = 1 - 1e-9
# Of a chord: places that are nearer to each other are not cut apart. Rounding is less; where much more is asked for
# crossings of dense tangles hold each other together.
_NEXT = 1e-6
# Places in a circle that is small. [empirical: larger ones need nearly all of their cuts, and more rounds one by one]
_FEW = 24
# Pairs of chords that are looked at together: a hundred megabytes.
BLOCK = 1 << 20


class _Chords(NamedTuple):
    """Straight parts of pieces: their piece and parameters, ends (x, y, depth) and half widths; and their stroke."""

    piece: Int[NDArray[np.int64], " C"]
    start: Float[NDArray[np.float64], " C"]
    stop: Float[NDArray[np.float64], " C"]
    ends: Float[NDArray[np.float64], "C 2 3"]
    radius: Float[NDArray[np.float64], " C"]
    stroke: Int[NDArray[np.int64], " C"]


class _Meetings(NamedTuple):
    """Where the ink of two strokes meets, and how deep it lies; places are the number of a chord plus a share of it."""

    near: Float[NDArray[np.float64], " M"]
    far: Float[NDArray[np.float64], " M"]
    near_depth: Float[NDArray[np.float64], " M"]
    far_depth: Float[NDArray[np.float64], " M"]


class Part(NamedTuple):
    """A stroke or a part of it, and whether it has been cut at its start and at its end."""

    pieces: Pieces
    cut: tuple[bool, bool]


def painting_order(strokes: Strokes2D, view: int, pieces: Pieces) -> list[Part]:
    """What is painted first comes first; where strokes go round in a circle all the same, the deeper one on the whole.

    Of strokes that are as deep as each other the later one comes later, as the renderer has it.

    Opaque strokes of one colour look alike in any order, and are never cut for each other.
    """
    if not len(pieces.stroke):
        return []
    chords = _chords(strokes, view, pieces)
    opaque = (strokes.opacity >= 1).cpu().numpy()
    # Translucent strokes each have a colour of their own here.
    colors = np.unique(np.round(strokes.color.double().cpu().numpy() * 255), axis=0, return_inverse=True)[1].reshape(-1)
    meetings = _meetings(chords, np.where(opaque, colors, len(colors) + np.arange(len(colors))))
    begins = np.flatnonzero(_begins(chords))
    cuts = _cut(begins.astype(float), meetings)
    split, part = _split(pieces, chords, cuts)
    depth = split.depth(strokes, view, torch.full_like(split.start, 0.5)).numpy()
    depth = np.bincount(part, depth) / np.bincount(part)
    order = _sorted(_part(cuts, meetings.far), _part(cuts, meetings.near), _levels(depth))
    whole = np.isin(cuts, begins)
    cut = np.stack([~whole, ~np.append(whole[1:], True)], 1).tolist()
    rows = np.searchsorted(part, np.arange(len(cuts) + 1))
    return [Part(split.rows(slice(rows[item], rows[item + 1])), tuple(cut[item])) for item in order]


def _chords(strokes: Strokes2D, view: int, pieces: Pieces) -> _Chords:
    control = pieces.points.numpy()
    length = np.linalg.norm(np.diff(control[..., :2], axis=1), axis=-1).sum(1)
    # A cubic with second differences b is off n chords by 6 b / (8 n^2) at most.
    bend = np.linalg.norm(np.diff(control[..., :2], 2, axis=1), axis=-1).max(1)
    fine = np.maximum(length / np.maximum(CHORD, control[:, :, 2].max(1)), np.sqrt(0.75 * bend / SAG))
    count = np.clip(np.ceil(fine).astype(np.int64), 1, MOST_CHORDS)
    piece = np.repeat(np.arange(len(count)), count)
    within = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    u = np.stack([within, within + 1], 1) / count[piece, None]
    rows = pieces.rows(torch.from_numpy(piece))
    ends = []
    for side in (0, 1):
        t = torch.from_numpy(u[:, side])
        a, b = 1 - u[:, side], u[:, side]
        basis = np.stack([a**3, 3 * a * a * b, 3 * a * b * b, b**3], -1)
        place = np.einsum("ck,ckd->cd", basis, control[piece])
        place[:, 2] = rows.depth(strokes, view, t).numpy()
        ends.append(place)
    radius = control[:, :, 2].max(1)[piece]
    return _Chords(piece, u[:, 0], u[:, 1], np.stack(ends, 1), radius, pieces.stroke.numpy()[piece])


def _meetings(chords: _Chords, ink: NDArray[np.int64]) -> _Meetings:
    """One for each place where two strokes meet: the nearer must be painted later.

    Args:
        ink: of each stroke; those of one ink need no order.
    """
    first, second = _neighbours(chords)
    look = ink[chords.stroke]
    different = look[first] != look[second]
    first, second = first[different], second[different]
    rows, s, t, distance = _close(chords, first, second)
    first, second = first[rows], second[rows]
    depths = [
        chords.ends[c, 0, 2] + u * (chords.ends[c, 1, 2] - chords.ends[c, 0, 2]) for c, u in ((first, s), (second, t))
    ]
    deeper = depths[1] - depths[0]
    closeness = 1 - distance / (chords.radius[first] + chords.radius[second])
    clear = np.abs(deeper) > EQUAL * np.abs(depths[0])
    # Along both strokes: each may come by the other one twice where the other is once.
    told = [
        np.flatnonzero(clear)[_told(chords, a[clear], b[clear], deeper[clear], closeness[clear])]
        for a, b in ((first, second), (second, first))
    ]
    kept = np.unique(np.concatenate(told))
    places = first[kept] + np.minimum(s[kept], _INSIDE), second[kept] + np.minimum(t[kept], _INSIDE)
    front, (here, there) = deeper[kept] > 0, (depths[0][kept], depths[1][kept])
    return _Meetings(
        np.where(front, *places), np.where(front, *places[::-1]), np.minimum(here, there), np.maximum(here, there)
    )


def _told(
    chords: _Chords,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    deeper: NDArray[np.float64],
    closeness: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Which pairs tell the order along the first strokes: both ends of runs of chords with the same order."""
    # Of each chord the closest one of the other stroke, in their order along the stroke.
    pair = chords.stroke[first] * (chords.stroke.max() + 1) + chords.stroke[second]
    order = np.lexsort((-closeness, first, pair))
    order = order[_changes(pair[order], first[order])]
    pair, first, second, front = pair[order], first[order], second[order], deeper[order] > 0
    place = np.cumsum(_changes(pair, first - np.arange(len(first)))) - 1
    run = np.cumsum(_changes(place, front)) - 1
    # Short runs are the rims of crossings where the strokes are steep, but for the run of the closest chords.
    length = np.bincount(run, np.linalg.norm(np.diff(chords.ends[first], axis=1)[:, 0, :2], axis=-1))[run]
    best = np.lexsort((-closeness[order], place))
    kept = np.isin(run, run[best[_changes(place[best], place[best])]])
    kept |= length > chords.radius[first] + chords.radius[second]
    last = np.append(_changes(run, run)[1:], True)[: len(run)]
    told: NDArray[np.int64] = order[kept & (_changes(run, run) | last)]
    return told


def _changes(a: NDArray[np.generic], b: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Where either of two columns differs from the row before; the first row does."""
    new = np.ones(len(a), bool)
    new[1:] = (a[1:] != a[:-1]) | (b[1:] != b[:-1])
    return new


def _neighbours(chords: _Chords) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of chords whose ink may meet."""
    middle = chords.ends[:, :, :2].mean(1)
    reach = np.linalg.norm(chords.ends[:, 1, :2] - chords.ends[:, 0, :2], axis=-1) / 2 + chords.radius
    return near_pairs(middle, reach)


class _Closest(NamedTuple):
    """Of some pairs of chords (rows): where they are closest, as shares of both, and how far apart they are there."""

    rows: NDArray[np.int64]
    first: NDArray[np.float64]
    second: NDArray[np.float64]
    distance: NDArray[np.float64]


def _close(chords: _Chords, first: NDArray[np.int64], second: NDArray[np.int64]) -> _Closest:
    """The pairs whose ink meets on the page: those beside each other, and then those that cross."""
    beside: list[_Closest] = []
    over: list[_Closest] = []
    for start in range(0, len(first), BLOCK):
        found = _close_of(chords, first[start : start + BLOCK], second[start : start + BLOCK])
        for kind, closest in zip((beside, over), found, strict=True):
            kind.append(closest._replace(rows=closest.rows + start))
    nothing = _Closest(np.zeros(0, np.int64), *np.zeros((3, 0)))
    return _Closest(*(np.concatenate(column) for column in zip(nothing, *beside, *over, strict=True)))


def _close_of(chords: _Chords, first: NDArray[np.int64], second: NDArray[np.int64]) -> tuple[_Closest, _Closest]:
    """Those of a block, apart."""
    x, y = chords.ends[:, 0, 0], chords.ends[:, 0, 1]
    dx, dy = chords.ends[:, 1, 0] - x, chords.ends[:, 1, 1] - y
    wx, wy = x[second] - x[first], y[second] - y[first]
    ux, uy, vx, vy = dx[first], dy[first], dx[second], dy[second]
    cross, to_second, to_first = ux * vy - uy * vx, wx * uy - wy * ux, wx * vy - wy * vx
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = to_first / cross, to_second / cross
    crossing = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    # Else an end of one is closest to the other; few are as near as that to each other's lines.
    reach = TOUCH * (chords.radius[first] + chords.radius[second])
    length = np.hypot(dx, dy)
    apart = _beside(to_second, cross, reach * length[first]) | _beside(to_first, cross, reach * length[second])
    rows = np.flatnonzero(~crossing & ~apart)
    beside = _ends(*(column[rows] for column in (wx, wy, ux, uy, vx, vy)))
    meet = beside[2] < reach[rows]
    over = np.flatnonzero(crossing)
    return _Closest(rows[meet], *(column[meet] for column in beside)), _Closest(
        over, s[over], t[over], np.zeros(len(over))
    )


def _beside(start: NDArray[np.float64], cross: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether both ends of a chord lie on one side of another's line, beyond a limit; all are areas."""
    stop = start - cross
    beside: NDArray[np.bool_] = (np.minimum(np.abs(start), np.abs(stop)) > limit) & (start * stop > 0)
    return beside


def _ends(
    wx: NDArray[np.float64],
    wy: NDArray[np.float64],
    ux: NDArray[np.float64],
    uy: NDArray[np.float64],
    vx: NDArray[np.float64],
    vy: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Where the chords from 0 along u and from w along v, which do not cross, are closest, and how far apart."""

    def clamped(over: NDArray[np.float64], under: NDArray[np.float64]) -> NDArray[np.float64]:
        with np.errstate(divide="ignore", invalid="ignore"):
            share: NDArray[np.float64] = np.nan_to_num(np.clip(over / under, 0, 1))
        return share

    uu, vv, uv, uw, vw = ux * ux + uy * uy, vx * vx + vy * vy, ux * vx + uy * vy, ux * wx + uy * wy, vx * wx + vy * wy
    zero, one = np.zeros(len(wx)), np.ones(len(wx))
    best_s, best_t, best = zero, zero, np.full(len(wx), np.inf)
    for s, t in (
        (zero, clamped(-vw, vv)),
        (one, clamped(uv - vw, vv)),
        (clamped(uw, uu), zero),
        (clamped(uw + uv, uu), one),
    ):
        distance = np.hypot(wx + t * vx - s * ux, wy + t * vy - s * uy)
        nearer = distance < best
        best_s, best_t, best = (np.where(nearer, *pair) for pair in ((s, best_s), (t, best_t), (distance, best)))
    return best_s, best_t, best


def _part(cuts: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.int64]:
    """The part in which each place lies, of those that begin at the cuts."""
    part: NDArray[np.int64] = np.searchsorted(cuts, places, "right") - 1
    return part


def _cut(begins: NDArray[np.float64], meetings: _Meetings) -> NDArray[np.float64]:
    """Where the parts begin: strokes, cut until no part is both before and behind others in a circle.

    What goes round in a circle is cut at a depth: each of its parts then lies before it or behind it.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    cuts = begins
    near, far, near_depth, far_depth = meetings
    while True:
        first, second = _part(cuts, near), _part(cuts, far)
        graph = csr_array((np.ones(len(near), np.int8), (second, first)), shape=(len(cuts), len(cuts)))
        circle = connected_components(graph, connection="strong")[1].astype(np.int64)
        stuck = circle[first] == circle[second]
        near, far, near_depth, far_depth = (column[stuck] for column in (near, far, near_depth, far_depth))
        place, depth = np.concatenate([near, far]), np.concatenate([near_depth, far_depth])
        order = np.argsort(place, kind="stable")
        place, depth = place[order], depth[order]
        part = _part(cuts, place)
        link = (part[1:] == part[:-1]) & (place[1:] - place[:-1] > _NEXT)
        behind = depth > _planes(circle[part], link, depth)[circle[part]]
        change = np.flatnonzero(link & (behind[1:] != behind[:-1]))
        if not len(change):
            return cuts
        # What no cut sets apart would keep the whole circle together: one of the two meetings is given up.
        bound = np.flatnonzero((part[1:] == part[:-1]) & ~link & (behind[1:] != behind[:-1])) + 1
        kept = ~np.isin(np.arange(len(near)), order[bound] % max(len(near), 1))
        near, far, near_depth, far_depth = (column[kept] for column in (near, far, near_depth, far_depth))
        # Of small circles cuts are made one at a time: the first one may free the whole circle.
        owner = circle[part][change]
        alone = np.zeros(len(change), bool)
        alone[np.unique(owner, return_index=True)[1]] = True
        change = change[alone | (np.bincount(circle[part])[owner] > _FEW)]
        middle = (place[change] + place[change + 1]) / 2
        # Beside the end of a piece the cut is there: no part begins with a sliver.
        end = np.round(middle)
        cuts = np.sort(np.concatenate([cuts, np.where(np.abs(middle - end) < _NEXT / 4, end, middle)]))


def _planes(circle: NDArray[np.int64], link: NDArray[np.bool_], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """At which depth to cut each circle: where few cuts set many places apart from the others (the sparsest cut).

    Args:
        circle, depth: of places in their order along the strokes.
        link: whether a place and the next one lie on one part, with room for a cut between them.
    """
    planes = np.full(circle.max(initial=-1) + 1, np.inf)
    low, high = np.minimum(depth[1:], depth[:-1])[link], np.maximum(depth[1:], depth[:-1])[link]
    # Going deeper, places are passed, and links between places that follow on each other begin and end.
    owner = np.concatenate([circle, circle[1:][link], circle[1:][link]])
    level = np.concatenate([depth, low, high])
    links = np.concatenate([np.zeros(len(depth), np.int64), np.ones(len(low), np.int64), -np.ones(len(low), np.int64)])
    passed = np.concatenate([np.ones(len(depth), np.int64), np.zeros(2 * len(low), np.int64)])
    order = np.lexsort((level, owner))
    owner, level = owner[order], level[order]
    first = np.flatnonzero(_changes(owner, owner))
    group = np.cumsum(_changes(owner, owner)) - 1
    open_links, before = np.cumsum(links[order]), np.cumsum(passed[order])
    before -= np.append(0, before)[first][group]
    total = np.bincount(circle, minlength=len(planes))[owner]
    # Between two levels; a plane that cuts no link sets nothing free.
    room = np.append((level[1:] > level[:-1]) & (owner[1:] == owner[:-1]), False) & (open_links > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        price = np.where(room, open_links / np.minimum(before, total - before), np.inf)
    best = np.lexsort((price, owner))[first]
    best = best[np.isfinite(price[best])]
    planes[owner[best]] = (level[best] + level[best + 1]) / 2
    return planes


def _begins(chords: _Chords) -> NDArray[np.bool_]:
    """Whether a chord is the first of its stroke."""
    return _changes(chords.stroke, chords.stroke)


def _levels(depth: NDArray[np.float64]) -> NDArray[np.int64]:
    """Depths as whole numbers: the same for those between which there is no step that counts."""
    order = np.argsort(depth)
    steps = np.diff(depth[order], prepend=depth[order[:1]]) > EQUAL * np.abs(depth[order])
    levels = np.empty(len(depth), np.int64)
    levels[order] = np.cumsum(steps)
    return levels


def _sorted(far: NDArray[np.int64], near: NDArray[np.int64], level: NDArray[np.int64]) -> list[int]:
    """Parts from far to near: each after those that it hides, else by depth and number; so in circles that are left."""
    count = len(level)
    edges = np.unique((far * count + near)[far != near])
    far, near = edges // count, edges % count
    rows = np.searchsorted(far, np.arange(count + 1))
    waits = np.bincount(near, minlength=count)
    keys = [(-d, i) for i, d in enumerate(level.tolist())]
    ready = [(keys[i], i) for i in np.flatnonzero(waits == 0).tolist()]
    heapq.heapify(ready)
    rest = sorted(range(count), key=keys.__getitem__, reverse=True)
    order: list[int] = []
    done = np.zeros(count, bool)
    while len(order) < count:
        while ready:
            _, i = heapq.heappop(ready)
            if done[i]:
                continue
            done[i] = True
            order.append(i)
            after = near[rows[i] : rows[i + 1]]
            waits[after] -= 1
            for j in after[(waits[after] == 0) & ~done[after]].tolist():
                heapq.heappush(ready, (keys[j], j))
        while rest and done[rest[-1]]:
            rest.pop()
        if rest:
            heapq.heappush(ready, (keys[rest[-1]], rest[-1]))
    return order


def _split(pieces: Pieces, chords: _Chords, cuts: NDArray[np.float64]) -> tuple[Pieces, NDArray[np.int64]]:
    """The pieces, cut where a part ends within them, and the part of each."""
    places = np.unique(np.concatenate([cuts, np.flatnonzero(_changes(chords.piece, chords.piece))]))
    chord = places.astype(np.int64)
    piece = chords.piece[chord]
    start = chords.start[chord] + (places - chord) * (chords.stop - chords.start)[chord]
    stop = np.append(start[1:], 0.0)
    stop[stop == 0] = 1.0
    some = pieces.rows(torch.from_numpy(piece))
    return some.parts(torch.from_numpy(start), torch.from_numpy(stop)), _part(cuts, places)
