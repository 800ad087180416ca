"""Strokes that go on in each other become one stroke."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask, Tensor
from diff3ds.chains import Chains
from diff3ds.curves.directions import turns
from diff3ds.sketch import JOINT_GAP, Sketch

# A stroke goes on in another one where it turns by less, radians. Empirical.
TURN = math.radians(20)
# Widths of strokes that look alike differ by at most this share, their colours and opacities by so much: by what
# rounding leaves in float32. More, though no display shows it, would add up along a row of strokes, of which the first
# one says how all look: a gradient would be lost.
ALIKE = 1e-6


class Joined(NamedTuple):
    """What comes of strokes that are joined.

    Attributes:
        sketch: the new strokes.
        strokes: of each the numbers of those that it is made of, in their order along it.
    """

    sketch: Sketch
    strokes: list[list[int]]


def join_smooth(sketch: Sketch, turn: float = TURN, gap: float | None = None) -> Joined:
    """Joins strokes that meet end to end, turn little there and look alike, as a pen draws them.

    A stroke whose own ends meet so becomes a closed one: two half circles are a circle. Where several strokes meet, the
    two that turn least are joined first. The curves stay what they are.

    Args:
        sketch: of any degree and chains.
        turn: radians; where strokes turn by less, they go on in each other.
        gap: world units; ends meet that are no farther apart. By default what rounding leaves, `JOINT_GAP` of the
            extent of their segments.

    Returns:
        The same curves as fewer strokes, in the order of their first ones, which keep their directions.
    """
    return join_ends(sketch, _smooth_pairs(sketch, turn, gap))


def join_ends(sketch: Sketch, pairs: Int[Index, "P 2"]) -> Joined:
    """Joins strokes at pairs of ends; the start of stroke i is end 2 i, its stop 2 i + 1, and each is in one pair.

    A new stroke looks like the first of its strokes, whose direction it has; widths along it stay.
    """
    if not len(sketch):
        return Joined(sketch, [])
    chains = sketch.chains or Chains.plain(len(sketch))
    first = chains.first.tolist()
    rows: list[int] = []
    turned: list[bool] = []
    counts, closed, strokes = [], [], []
    for entries, round_ in walks(len(sketch), pairs, chains.closed.tolist()):
        before = len(rows)
        for entry in entries:
            segments = list(range(first[entry // 2], first[entry // 2 + 1]))
            rows += segments[::-1] if entry % 2 else segments
            turned += [entry % 2 == 1] * len(segments)
        counts.append(len(rows) - before)
        closed.append(round_)
        strokes.append([entry // 2 for entry in entries])
    joined, back = Chains.of(counts, closed), torch.tensor(turned, dtype=torch.bool)
    curves = {}
    for name in sketch.segment_fields:
        some = getattr(sketch, name)[rows]
        some = torch.where(back.view(-1, *[1] * (some.ndim - 1)), some.flip(1), some)
        # Ends that met but for rounding.
        curves[name] = some if name == "weights" else joined.joined(some)
    return Joined(sketch.select([row[0] for row in strokes], **curves, chains=joined), strokes)


def walks(count: int, pairs: Int[Index, "P 2"], closed: Sequence[bool]) -> list[tuple[list[int], bool]]:
    """What strokes become that are joined at pairs of ends: the end at which each is entered, and whether it closes.

    Args:
        count: of the strokes.
        pairs: as of `join_ends`.
        closed: whether each stroke is closed by itself; such a one is in no pair.
    """
    mates = {int(a): int(b) for pair in pairs for a, b in (pair, pair[::-1])}
    found: list[tuple[list[int], bool]] = []
    done: set[int] = set()
    for stroke in range(count):
        if stroke in done:
            continue
        # Back to where the new stroke begins, then along it; the other end of the same stroke is end ^ 1.
        start = 2 * stroke
        while start in mates:
            start = mates[start] ^ 1
            if start == 2 * stroke:
                break
        entries = [start]
        while (after := mates.get(entries[-1] ^ 1, start)) != start:
            entries.append(after)
        found.append((entries, start in mates or closed[stroke]))
        done |= {entry // 2 for entry in entries}
    return found


def _smooth_pairs(sketch: Sketch, turn: float, gap: float | None) -> Int[Index, "P 2"]:
    """Pairs of ends of strokes that look alike and go on in each other, the best first; no end is in two pairs."""
    from scipy.spatial import cKDTree

    if not len(sketch):
        return np.zeros((0, 2), np.int64)
    chains = sketch.chains or Chains.plain(len(sketch))
    rows = torch.stack([chains.first[:-1], chains.first[1:] - 1], 1)
    control = _from_ends(sketch, rows)
    reach = JOINT_GAP * np.ptp(control, axis=1).max(-1) if gap is None else np.full(len(control), gap)
    a, b = cKDTree(control[:, 0]).query_pairs(float(reach.max()), output_type="ndarray").T
    meet = np.linalg.norm(control[a, 0] - control[b, 0], axis=1) <= np.maximum(reach[a], reach[b])
    inward = _directions(control)
    turned = turns(-inward[a], inward[b])
    # Both ends of a speck are near each other.
    steps = sketch.points.detach().double().diff(dim=1).norm(dim=-1).sum(1)
    length = torch.zeros(len(sketch), dtype=torch.float64).index_add_(0, chains.stroke, steps).numpy()
    speck = (a // 2 == b // 2) & (length[a // 2] < 4 * reach[a])
    opened = ~chains.closed.numpy()
    fits = meet & (turned < turn) & ~speck & opened[a // 2] & opened[b // 2] & _alike(sketch, rows, a, b)
    order = np.flatnonzero(fits)[np.argsort(turned[fits], kind="stable")]
    return first_pairs(np.stack([a, b], 1)[order])


def first_pairs(pairs: Int[Index, "P 2"]) -> Int[Index, "Q 2"]:
    """Of pairs of ends, the best first, those whose ends are in no pair before them."""
    taken: set[int] = set()
    found = []
    for pair in pairs.tolist():
        if not taken & set(pair):
            taken |= set(pair)
            found.append(pair)
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def _from_ends(sketch: Sketch, rows: Int[Tensor, "N 2"]) -> Float[Array, "E K 3"]:
    """Control points of the first and last segments of strokes, from the stroke's end on."""
    points = sketch.points.detach().double()
    return torch.stack([points[rows[:, 0]], points[rows[:, 1]].flip(1)], 1).flatten(0, 1).numpy()


def _directions(control: Float[Array, "E K 3"]) -> Float[Array, "E 3"]:
    """Vectors from the first control points to the next ones that are not in the same places."""
    away = control[:, 1:] - control[:, :1]
    length = np.linalg.norm(away, axis=-1)
    chosen = (length > 1e-9 * length.max(1, keepdims=True)).argmax(1)
    return away[np.arange(len(away)), chosen]


def _alike(sketch: Sketch, rows: Int[Tensor, "N 2"], a: Int[Index, " P"], b: Int[Index, " P"]) -> Bool[Mask, " P"]:
    """Whether the strokes of two ends look alike where they meet, and are both fixed or both not."""
    fixed = torch.zeros(len(sketch)) if sketch.fixed is None else sketch.fixed.float()
    looks = torch.cat([sketch.color, sketch.opacity[:, None], fixed[:, None]], 1).detach().double().numpy()
    same: Mask = (np.abs(looks[a // 2] - looks[b // 2]) <= ALIKE).all(1)
    width = sketch.width.detach()
    if width.ndim == 2:
        at = torch.stack([width[rows[:, 0], 0], width[rows[:, 1], -1]], 1).flatten().double().numpy()
    else:
        at = width.repeat_interleave(2).double().numpy()
    return same & (np.abs(at[a] - at[b]) <= ALIKE * np.maximum(at[a], at[b]))
