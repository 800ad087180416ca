"""Strokes that go on in each other become one stroke."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.chains import Chains
from diff3ds.sketch import JOINT_GAP, Sketch

# A stroke goes on in another one where it turns by less than 20 degrees, to this cosine. Empirical.
SMOOTH = 0.94


class _Walk(NamedTuple):
    """Strokes that follow on each other: for each the end at which the new stroke enters it."""

    entries: list[int]
    closed: bool


def join_smooth(sketch: Sketch) -> Sketch:
    """Joins strokes that meet end to end, turn there by less than 20 degrees and look alike, as a pen draws them.

    A stroke whose own ends meet so becomes a closed one: two half circles are a circle. Where several strokes meet, the
    two that turn least are joined first. The curves stay what they are.

    Args:
        sketch: of any degree and chains; ends meet if they are at most `JOINT_GAP` of their segments' extent apart.

    Returns:
        The same curves as fewer strokes, in the order of their first ones, which keep their directions.
    """
    return join_ends(sketch, _smooth_joints(sketch)) if len(sketch) else sketch


def join_ends(sketch: Sketch, pairs: Int[NDArray[np.int64], "P 2"]) -> Sketch:
    """Joins strokes at pairs of ends; the start of stroke i is end 2 i, its stop 2 i + 1, and each is in one pair.

    A new stroke looks like the first of its strokes, whose direction it has; widths along it stay.
    """
    chains = sketch.chains or Chains.plain(len(sketch))
    first = chains.first.tolist()
    rows: list[int] = []
    turned: list[bool] = []
    counts, closed, leads = [], [], []
    for walk in _walks(len(sketch), pairs, chains.closed.tolist()):
        before = len(rows)
        for entry in walk.entries:
            segments = list(range(first[entry // 2], first[entry // 2 + 1]))
            rows += segments[::-1] if entry % 2 else segments
            turned += [entry % 2 == 1] * len(segments)
        counts.append(len(rows) - before)
        closed.append(walk.closed)
        leads.append(walk.entries[0] // 2)
    joined, back = Chains.of(counts, closed), torch.tensor(turned, dtype=torch.bool)
    tensors = {}
    for name, value in sketch.tensors().items():
        if name in sketch.segment_fields:
            some = value[rows]
            some = torch.where(back.view(-1, *[1] * (some.ndim - 1)), some.flip(1), some)
            # Ends that met but for rounding.
            tensors[name] = some if name == "weights" else joined.joined(some)
        else:
            tensors[name] = value[leads]
    return Sketch(**tensors, width_space=sketch.width_space, chains=joined)


def _walks(count: int, pairs: Int[NDArray[np.int64], "P 2"], closed: Sequence[bool]) -> list[_Walk]:
    """All strokes by the new strokes they are in: from each back to where its new stroke begins, then along it."""
    mates = {int(a): int(b) for pair in pairs for a, b in (pair, pair[::-1])}
    found: list[_Walk] = []
    done: set[int] = set()
    for stroke in range(count):
        if stroke in done:
            continue
        start = 2 * stroke
        while start in mates:
            start = _other_end(mates[start])
            if start == 2 * stroke:
                break
        entries = [start]
        while (after := mates.get(_other_end(entries[-1]), start)) != start:
            entries.append(after)
        found.append(_Walk(entries, start in mates or closed[stroke]))
        done |= {entry // 2 for entry in entries}
    return found


def _other_end(end: int) -> int:
    """The other end of the same stroke."""
    return end ^ 1


def _smooth_joints(sketch: Sketch) -> Int[NDArray[np.int64], "P 2"]:
    """Pairs of ends of strokes that look alike and go on in each other, the best first; no end is in two pairs."""
    from scipy.spatial import cKDTree

    ends, outward, reach = _ends(sketch)
    near = cKDTree(ends).query_pairs(float(reach.max()), output_type="ndarray")
    a, b = near.T
    meet = np.linalg.norm(ends[a] - ends[b], axis=1) <= np.maximum(reach[a], reach[b])
    cosine = -(outward[a] * outward[b]).sum(1)
    fits = meet & (cosine > SMOOTH) & _alike(sketch, a, b)
    open_strokes = ~(sketch.chains or Chains.plain(len(sketch))).closed.numpy()
    fits &= open_strokes[a // 2] & open_strokes[b // 2]
    order = np.flatnonzero(fits)[np.argsort(-cosine[fits], kind="stable")]
    taken: set[int] = set()
    pairs = []
    for i in order:
        pair = int(a[i]), int(b[i])
        if not taken & set(pair):
            taken |= set(pair)
            pairs.append(pair)
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _ends(
    sketch: Sketch,
) -> tuple[Float[NDArray[np.float64], "E 3"], Float[NDArray[np.float64], "E 3"], Float[NDArray[np.float64], " E"]]:
    """Places of the ends, directions out of the strokes there (0 where they have none), and what counts as no gap."""
    chains = sketch.chains or Chains.plain(len(sketch))
    points = sketch.points.detach().double()
    start, stop = points[chains.first[:-1]], points[chains.first[1:] - 1].flip(1)
    control = torch.stack([start, stop], 1).flatten(0, 1).numpy()
    away = control[:, :1] - control[:, 1:]
    length = np.linalg.norm(away, axis=-1)
    extent = np.ptp(control, axis=1).max(-1)
    # The first control point that is not in the same place gives the direction.
    apart = length > 1e-9 * extent[:, None]
    chosen = apart.argmax(1)
    rows = np.arange(len(control))
    lengths = np.where(apart[rows, chosen], length[rows, chosen], np.inf)
    return control[:, 0], away[rows, chosen] / lengths[:, None], JOINT_GAP * extent


def _alike(
    sketch: Sketch, a: Int[NDArray[np.int64], " P"], b: Int[NDArray[np.int64], " P"]
) -> Bool[NDArray[np.bool_], " P"]:
    """Whether the strokes of two ends have one colour, opacity and, where they meet, width."""
    looks: list[Tensor] = [sketch.color, sketch.opacity[:, None]]
    if sketch.width.ndim == 1:
        looks.append(sketch.width[:, None])
    of_strokes = torch.cat(looks, 1).detach().numpy()
    same: NDArray[np.bool_] = (of_strokes[a // 2] == of_strokes[b // 2]).all(1)
    if sketch.width.ndim == 2:
        chains = sketch.chains or Chains.plain(len(sketch))
        width = sketch.width.detach()
        at = torch.stack([width[chains.first[:-1], 0], width[chains.first[1:] - 1, -1]], 1).flatten().numpy()
        same &= np.abs(at[a] - at[b]) <= JOINT_GAP * np.maximum(at[a], at[b])
    return same
