"""Tracks joined at their ends into long ones, so that a pen is lifted as rarely as it can be."""

from collections.abc import Sequence

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.curves.directions import turns
from diff3ds.curves.join import first_pairs, walks
from diff3ds.page.pens.track import Track
from diff3ds.page.stroke_outlines import DIGIT


def join_tracks(tracks: Sequence[Track], gap: float) -> list[Track]:
    """Joins tracks whose ends meet, however they turn there, the nearest and straightest first.

    Where several meet, as few tracks are left as can be: half of the places with an odd number of ends. Ends that meet
    within the gap, in pixels, are joined by a straight line.
    """
    if not tracks:
        return []
    ends = np.concatenate([track.ends for track in tracks])
    meeting = _meeting(tracks, ends, gap)
    closed = [track.closed for track in tracks]
    open_ = ~np.repeat(closed, 2)
    own = [[2 * i, 2 * i + 1] for i in np.flatnonzero(closed)]
    pairs = first_pairs(meeting[open_[meeting].all(1)])
    pairs = np.concatenate([pairs, np.array(own, np.int64).reshape(-1, 2)])
    pairs = _spliced(len(tracks), pairs, meeting, ends, gap)
    return [_along(tracks, *walk) for walk in walks(len(tracks), pairs, [False] * len(tracks))]


def join_followers(tracks: Sequence[Track], gap: float) -> list[Track]:
    """Tracks in their order, each with those after it that begin within the gap, in pixels, of where it ends."""
    found: list[Track] = []
    for track in tracks:
        if found and np.linalg.norm(track.ends[0] - found[-1].ends[1]) <= gap:
            found[-1] = _along([found[-1], track], (0, 2), False)
        else:
            found.append(track)
    return found


def _meeting(tracks: Sequence[Track], ends: Float[Array, "E 2"], gap: float) -> Int[Index, "P 2"]:
    """Pairs of ends that meet, the best first."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(ends).query_pairs(gap, output_type="ndarray")
    lengths = np.array([np.linalg.norm(np.diff(track.cubics, axis=1), axis=2).sum() for track in tracks])
    # Both ends of a speck are near each other.
    speck = (pairs[:, 0] // 2 == pairs[:, 1] // 2) & (lengths[pairs[:, 0] // 2] < 4 * gap)
    pairs = pairs[~speck]
    inward = np.concatenate([_inward(track) for track in tracks])
    apart = np.linalg.norm(ends[pairs[:, 0]] - ends[pairs[:, 1]], axis=1)
    turned = turns(-inward[pairs[:, 0]], inward[pairs[:, 1]])
    return pairs[np.argsort(apart / gap + turned / np.pi, kind="stable")]


def _inward(track: Track) -> Float[Array, "2 2"]:
    """Directions from both ends into the track, of any length."""
    first, last = track.cubics[0], track.cubics[-1, ::-1]
    steps = [cubic[1:] - cubic[0] for cubic in (first, last)]
    return np.stack([step[(np.abs(step).max(1) > DIGIT).argmax()] for step in steps])


def _spliced(
    count: int, pairs: Int[Index, "P 2"], meeting: Int[Index, "Q 2"], ends: Float[Array, "E 2"], gap: float
) -> Int[Index, "R 2"]:
    """The pairs with each loop that meets another track made a part of it: the way goes once round on the way."""
    mates = {int(a): int(b) for pair in pairs for a, b in (pair, pair[::-1])}
    group, loops = np.empty(count, np.int64), []
    for number, (entries, closed) in enumerate(walks(count, pairs, [False] * count)):
        group[[entry // 2 for entry in entries]] = number
        loops.append(closed)
    for a, b in meeting.tolist():
        if not loops[group[a // 2]]:
            a, b = b, a
        mine, other = group[a // 2], group[b // 2]
        if mine == other or not loops[mine]:
            continue
        mate, beyond = mates[a], mates.get(b)
        if beyond is not None and np.linalg.norm(ends[mate] - ends[beyond]) > gap:
            continue
        mates[a], mates[b] = b, a
        if beyond is None:
            del mates[mate]
        else:
            mates[mate], mates[beyond] = beyond, mate
        group[group == mine] = other
    return np.array([[a, b] for a, b in mates.items() if a < b], np.int64).reshape(-1, 2)


def _along(tracks: Sequence[Track], entries: Sequence[int], closed: bool) -> Track:
    """One track of several, each entered at one of its ends."""
    parts = [tracks[entry // 2].back if entry % 2 else tracks[entry // 2] for entry in entries]
    cubics = [parts[0].cubics]
    for before, after in zip(parts, parts[1:] + parts[:1] * closed, strict=False):
        cubics += [_line(before.ends[1], after.ends[0])]
        cubics += [after.cubics] if after is not parts[0] else []
    strokes = dict.fromkeys(stroke for part in parts for stroke in part.strokes)
    return Track(np.concatenate(cubics), closed, tuple(strokes))


def _line(start: Float[Array, " 2"], stop: Float[Array, " 2"]) -> Float[Array, "n 4 2"]:
    """A line between two points, nothing where they are one."""
    if np.abs(stop - start).max() <= DIGIT:
        return np.zeros((0, 4, 2))
    return (start + (stop - start) * (np.arange(4) / 3)[:, None])[None]
