"""Tracks in an order of short ways between them: each time the nearest, then with stretches turned round."""

from collections.abc import Sequence

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.page.pens.track import Samples, Track

# Stretches of so many tracks at most are turned, so many times over all: then little is gained. [empirical]
STRETCH, ROUNDS = 1000, 20
# Times that loops begin elsewhere and stretches are turned again.
AGAIN = 2
# px. Less is not worth a turn.
GAIN = 1e-6


def in_order(tracks: Sequence[Track], loop_step: float) -> list[Track]:
    """The tracks, some from their other ends, and closed ones from other places on, in an order of short ways.

    The pen comes from the corner at the origin.

    Args:
        loop_step: how far places are apart at which a closed track may begin, pixels.
    """
    if not tracks:
        return []
    places = [_places(track, loop_step) if track.closed else np.zeros((2, 3)) for track in tracks]
    order = _nearest_next(tracks, places)
    for _ in range(AGAIN):
        order = [order[k] if k >= 0 else order[~k].back for k in _turned(order)]
        order = _begun_nearest(order, loop_step)
    return order


def _places(track: Track, step: float) -> Float[Array, "n 3"]:
    """Where a closed track may begin: place, x and y."""
    samples = Samples.of([track], step)
    middle = samples.place + samples.size / 2
    corners = np.column_stack([np.arange(len(track.cubics)), track.cubics[:, 0]])
    return np.concatenate([corners, np.column_stack([middle, samples.points])])


def _nearest_next(tracks: Sequence[Track], places: Sequence[Float[Array, "_ 3"]]) -> list[Track]:
    """The tracks, each the one that begins nearest to where the one before it ends."""
    spots = [p[:, 1:] if track.closed else track.ends for track, p in zip(tracks, places, strict=True)]
    points, owner = np.concatenate(spots), np.repeat(np.arange(len(tracks)), [len(some) for some in spots])
    found, pen = [], np.zeros(2)
    while len(points):
        nearest = int(((points - pen) ** 2).sum(1).argmin())
        number = int(owner[nearest])
        track, which = tracks[number], int(nearest - np.searchsorted(owner, number))
        if track.closed:
            track = track.begun_at(float(places[number][which, 0]))
        elif which:
            track = track.back
        found.append(track)
        pen = track.ends[1]
        rest = owner != number
        points, owner = points[rest], owner[rest]
    return found


def _turned(tracks: Sequence[Track]) -> list[int]:
    """An order with shorter ways: numbers of tracks, ~number of those that are drawn from their other ends."""
    ends = np.stack([track.ends for track in tracks])
    begin, end = ends[:, 0].copy(), ends[:, 1].copy()
    order = np.arange(len(tracks))
    for _ in range(ROUNDS):
        gained = 0.0
        for first in range(len(tracks)):
            gain, last = _best_turn(begin, end, first)
            if gain <= GAIN:
                continue
            gained += gain
            stretch = slice(first, last + 1)
            order[stretch] = ~order[stretch][::-1]
            begin[stretch], end[stretch] = end[stretch][::-1].copy(), begin[stretch][::-1].copy()
        if gained <= GAIN:
            break
    return order.tolist()


def _best_turn(begin: Float[Array, "N 2"], end: Float[Array, "N 2"], first: int) -> tuple[float, int]:
    """What is gained most by a stretch that begins at a track, and its last track."""
    stop = min(first + STRETCH, len(begin))
    lasts, after = slice(first, stop), slice(first + 1, stop + 1)
    gain = np.zeros(stop - first)
    if first:
        gain += np.linalg.norm(begin[first] - end[first - 1]) - np.linalg.norm(end[lasts] - end[first - 1], axis=1)
    follow = begin[after]
    gain[: len(follow)] += np.linalg.norm(follow - end[lasts][: len(follow)], axis=1)
    gain[: len(follow)] -= np.linalg.norm(follow - begin[first], axis=1)
    best = int(gain.argmax())
    return float(gain[best]), first + best


def _begun_nearest(tracks: list[Track], step: float) -> list[Track]:
    """The tracks with closed ones begun where the ways from and to their neighbours are shortest."""
    found = list(tracks)
    for k, track in enumerate(found):
        if track.closed:
            places = _places(track, step)
            beside = ([found[k - 1].ends[1]] if k else []) + [after.ends[0] for after in found[k + 1 : k + 2]]
            ways = np.sum([np.linalg.norm(places[:, 1:] - end, axis=1) for end in beside], 0)
            # The first place is where it begins now.
            if len(beside) and ways[0] > ways.min() + GAIN:
                found[k] = track.begun_at(float(places[ways.argmin(), 0]))
    return found
