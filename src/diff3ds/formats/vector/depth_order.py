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
from diff3ds.formats.vector.screen_pieces import Pieces
from diff3ds.project import Strokes2D

# Pixels, and at least a half width: how long the chords are by which meeting places are found.
CHORD = 4.0
MOST_CHORDS = 64
# Of the sum of half widths: strokes that only touch need no order.
TOUCH = 0.9
# Of the depth: what is as deep as that needs no order, such as strokes that begin at one point.
EQUAL = 1e-6
# Of a round of cuts, how many of the strokes in circles are cut: the best ones, for cuts may make others needless.
# [empirical: a half makes twice as many parts, a fiftieth hardly fewer in more time]
SHARE = 0.05


class _Chords(NamedTuple):
    """Straight parts of pieces: their piece and parameters, ends (x, y, depth) and half widths; and their stroke."""

    piece: Int[NDArray[np.int64], " C"]
    start: Float[NDArray[np.float64], " C"]
    ends: Float[NDArray[np.float64], "C 2 3"]
    radius: Float[NDArray[np.float64], " C"]
    stroke: Int[NDArray[np.int64], " C"]


class Part(NamedTuple):
    """A stroke or a part of it, and whether it has been cut at its start and at its end."""

    pieces: Pieces
    cut: tuple[bool, bool]


def painting_order(strokes: Strokes2D, view: int, pieces: Pieces) -> list[Part]:
    """What is painted first comes first.

    Translucent strokes are not cut, because where two parts meet they would be darker; among them, and where strokes
    change their order within a chord, the deeper one on the whole comes first.
    """
    if not len(pieces.stroke):
        return []
    chords = _chords(strokes, view, pieces)
    opaque = (strokes.opacity >= 1).cpu().numpy()
    # Opaque strokes of one colour look alike in any order: translucent ones each have a colour of their own here.
    colors = np.unique(np.round(strokes.color.double().cpu().numpy() * 255), axis=0, return_inverse=True)[1].reshape(-1)
    near, far = _meetings(chords, np.where(opaque, colors, len(colors) + np.arange(len(colors))))
    part = _cut(chords, near, far, opaque)
    depth = np.bincount(part, chords.ends[:, :, 2].mean(1)) / np.bincount(part)
    order = _sorted(part[far], part[near], depth)
    split, home = _split(pieces, chords, part)
    first, last = (np.searchsorted(part, np.arange(len(depth)), side) for side in ("left", "right"))
    cut = np.stack([~_begins(chords)[first], ~np.append(_begins(chords), True)[last]], 1).tolist()
    rows = np.searchsorted(home, np.arange(len(depth) + 1))
    return [Part(split.rows(slice(rows[item], rows[item + 1])), tuple(cut[item])) for item in order]


def _chords(strokes: Strokes2D, view: int, pieces: Pieces) -> _Chords:
    control = pieces.points.numpy()
    length = np.linalg.norm(np.diff(control[..., :2], axis=1), axis=-1).sum(1)
    count = np.clip(np.ceil(length / np.maximum(CHORD, control[:, :, 2].max(1))).astype(np.int64), 1, MOST_CHORDS)
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
    return _Chords(piece, u[:, 0], np.stack(ends, 1), radius, pieces.stroke.numpy()[piece])


def _meetings(chords: _Chords, ink: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of chords (near, far), one for each place where two strokes meet: the nearer must be painted later.

    Args:
        ink: of each stroke; those of one ink need no order.
    """
    first, second = _neighbours(chords)
    different = ink[chords.stroke[first]] != ink[chords.stroke[second]]
    first, second = first[different], second[different]
    swap = chords.stroke[first] > chords.stroke[second]
    first, second = np.where(swap, second, first), np.where(swap, first, second)
    distance, deeper = _closest(chords.ends[first], chords.ends[second])
    reach = chords.radius[first] + chords.radius[second]
    meet = distance < TOUCH * reach
    meet &= np.abs(deeper) > EQUAL * np.abs(chords.ends[first][:, :, 2]).max(1)
    first, second, deeper, closeness = first[meet], second[meet], deeper[meet], 1 - distance[meet] / reach[meet]
    # Along both strokes: each may come by the other one twice where the other is once.
    told = [_told(chords, *pair, deeper, closeness) for pair in ((first, second), (second, first))]
    rows = np.unique(np.concatenate(told))
    a, b, front = first[rows], second[rows], deeper[rows] > 0
    return np.where(front, a, b), np.where(front, b, a)


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
    """Pairs of chords whose ink may meet; chords of like widths are looked for together."""
    from scipy.spatial import cKDTree

    middle = chords.ends[:, :, :2].mean(1)
    reach = np.linalg.norm(chords.ends[:, 1, :2] - chords.ends[:, 0, :2], axis=-1) / 2 + chords.radius
    size = np.ceil(np.log2(np.maximum(reach, 1.0))).astype(np.int64)
    classes = {int(k): np.flatnonzero(size == k) for k in np.unique(size)}
    trees = {k: cKDTree(middle[rows]) for k, rows in classes.items()}
    pairs: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    for k, rows in classes.items():
        for other, others in classes.items():
            if other < k:
                found = trees[k].sparse_distance_matrix(trees[other], 2.0**k + 2.0**other, output_type="ndarray")
                pairs.append((rows[found["i"]], others[found["j"]]))
            elif other == k:
                both = trees[k].query_pairs(2.0 ** (k + 1), output_type="ndarray")
                pairs.append((rows[both[:, 0]], rows[both[:, 1]]))
    first, second = (np.concatenate(column) for column in zip(*pairs, strict=True))
    gap = middle[first] - middle[second]
    close = np.hypot(gap[:, 0], gap[:, 1]) < reach[first] + reach[second]
    return first[close], second[close]


def _closest(
    a: Float[NDArray[np.float64], "P 2 3"], b: Float[NDArray[np.float64], "P 2 3"]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The distance of two chords on the page, and how much deeper the second one is where they are closest."""
    p, u, q, v = a[:, 0], a[:, 1] - a[:, 0], b[:, 0], b[:, 1] - b[:, 0]

    def clamped(over: NDArray[np.float64], under: NDArray[np.float64]) -> NDArray[np.float64]:
        with np.errstate(divide="ignore", invalid="ignore"):
            share: NDArray[np.float64] = np.nan_to_num(np.clip(over / under, 0, 1))
        return share

    def dot(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        product: NDArray[np.float64] = (x[:, :2] * y[:, :2]).sum(-1)
        return product

    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    w = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / cross
        t = (w[:, 0] * u[:, 1] - w[:, 1] * u[:, 0]) / cross
        crossing = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    # Where they do not cross, an end of one is closest to the other.
    zero, one = np.zeros(len(a)), np.ones(len(a))
    candidates = [
        (np.where(crossing, s, 0), np.where(crossing, t, clamped(dot(p - q, v), dot(v, v)))),
        (one, clamped(dot(p + u - q, v), dot(v, v))),
        (clamped(dot(w, u), dot(u, u)), zero),
        (clamped(dot(w + v, u), dot(u, u)), one),
    ]
    gaps = [p + s[:, None] * u - q - t[:, None] * v for s, t in candidates]
    distances = np.stack([np.linalg.norm(gap[:, :2], axis=-1) for gap in gaps])
    best = distances.argmin(0)
    row = np.arange(len(a))
    return distances[best, row], -np.stack([gap[:, 2] for gap in gaps])[best, row]


def _cut(
    chords: _Chords, near: NDArray[np.int64], far: NDArray[np.int64], opaque: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """The part that each chord belongs to: strokes, cut until no part is both before and behind others in a circle."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    starts = _begins(chords)
    where = np.concatenate([near, far])
    front = np.repeat([True, False], [len(near), len(far)])
    order = np.argsort(where, kind="stable")
    where, front = where[order], front[order]
    meeting = np.concatenate([np.arange(len(near))] * 2)[order]
    while True:
        part = np.cumsum(starts) - 1
        count = int(part[-1]) + 1
        graph = coo_matrix((np.ones(len(near)), (part[far], part[near])), shape=(count, count))
        circle = connected_components(graph, connection="strong")[1]
        stuck = (circle[part[near]] == circle[part[far]])[meeting]
        spots, sides = where[stuck], front[stuck]
        # Between two meetings of one part that differ, and lie on different chords, there may be a cut.
        change = (part[spots[1:]] == part[spots[:-1]]) & (sides[1:] != sides[:-1]) & (spots[1:] > spots[:-1])
        change &= opaque[chords.stroke[spots[1:]]]
        if not change.any():
            return part
        cuts = (spots[1:] + spots[:-1] + 1)[change] // 2
        changes = np.bincount(part[cuts], minlength=count)
        meetings = np.bincount(part[spots], minlength=count)
        candidates = np.flatnonzero(changes)
        # One cut that frees many meetings is worth more than many that free few.
        worth = meetings[candidates] / changes[candidates]
        chosen = candidates[np.argsort(-worth, kind="stable")[: max(1, int(SHARE * len(candidates)))]]
        starts[cuts[np.isin(part[cuts], chosen)]] = True


def _begins(chords: _Chords) -> NDArray[np.bool_]:
    """Whether a chord is the first of its stroke."""
    return _changes(chords.stroke, chords.stroke)


def _sorted(far: NDArray[np.int64], near: NDArray[np.int64], depth: NDArray[np.float64]) -> list[int]:
    """Parts from far to near: each after those that it hides, else by depth; in circles that are left by depth."""
    edges = np.unique(np.stack([far, near], 1), axis=0)
    edges = edges[edges[:, 0] != edges[:, 1]]
    after: list[list[int]] = [[] for _ in depth]
    waits = np.bincount(edges[:, 1], minlength=len(depth)).tolist()
    for a, b in edges.tolist():
        after[a].append(b)
    keys = [(-d, -i) for i, d in enumerate(depth.tolist())]
    ready = [(key, i) for i, key in enumerate(keys) if not waits[i]]
    heapq.heapify(ready)
    rest = sorted(range(len(keys)), key=keys.__getitem__, reverse=True)
    order: list[int] = []
    done = [False] * len(keys)
    while len(order) < len(keys):
        while ready:
            _, i = heapq.heappop(ready)
            if done[i]:
                continue
            done[i] = True
            order.append(i)
            for j in after[i]:
                waits[j] -= 1
                if not waits[j] and not done[j]:
                    heapq.heappush(ready, (keys[j], j))
        while rest and done[rest[-1]]:
            rest.pop()
        if rest:
            heapq.heappush(ready, (keys[rest[-1]], rest[-1]))
    return order


def _split(pieces: Pieces, chords: _Chords, part: NDArray[np.int64]) -> tuple[Pieces, NDArray[np.int64]]:
    """The pieces, cut where a part ends within them, and the part of each."""
    begins = np.ones(len(part), bool)
    begins[1:] = (part[1:] != part[:-1]) | (chords.piece[1:] != chords.piece[:-1])
    rows = np.flatnonzero(begins)
    piece, start = chords.piece[rows], chords.start[rows]
    stop = np.append(start[1:], 0.0)
    stop[stop == 0] = 1.0
    some = pieces.rows(torch.from_numpy(piece))
    return some.parts(torch.from_numpy(start), torch.from_numpy(stop)), part[rows]
