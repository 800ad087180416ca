"""Where two curves go on smoothly in each other, and the sketch in which such curves are one stroke."""

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Int
from diff3ds.chains import Chains
from diff3ds.edges.shapes.curve_set import Curves
from diff3ds.edges.shapes.lines import unit
from diff3ds.sketch import Sketch

# [cosine; empirical] Curves that meet at a smaller angle meet smoothly.
SMOOTH = 0.94


class _Stroke(NamedTuple):
    """Curves that follow on each other: for each the end at which the stroke enters it (see `smooth_joints`)."""

    entries: list[int]
    closed: bool


def smooth_joints(curves: Curves) -> Int[NDArray[np.int64], "P 2"]:
    """Pairs of ends that meet smoothly where no third curve does; the start of curve i is end 2 i, its stop 2 i + 1."""
    control = curves.constrained(curves.points)[0].double().numpy()
    outward = unit(control[:, [0, 3]] - control[:, [1, 2]]).reshape(-1, 3)
    vertex = curves.vertex.numpy().reshape(-1)
    order = np.argsort(vertex, kind="stable")
    _, first, count = np.unique(vertex[order], return_index=True, return_counts=True)
    pairs = order[first[count == 2][:, None] + [0, 1]]
    return pairs[(outward[pairs[:, 0]] * outward[pairs[:, 1]]).sum(1) < -SMOOTH]


def sketch_of(curves: Curves, width: float) -> Sketch:
    """The curves as black strokes, as a pen would draw them.

    A whole circle or ellipse is one closed stroke of two segments. Curves that meet smoothly are one stroke, closed
    where they run round; they stay apart at corners, and where three or more meet. Strokes come in the order of their
    first curves, which keep their directions.
    """
    points, weights = curves.segments(curves.points)
    first = torch.searchsorted(curves.owner, torch.arange(len(curves))).tolist()
    whole = curves.closed.tolist()
    rows: list[int] = []
    turned: list[bool] = []
    counts, closed = [], []
    for stroke in _strokes(curves):
        before = len(rows)
        for end in stroke.entries:
            curve = end // 2
            segments = [first[curve], first[curve] + 1] if whole[curve] else [first[curve]]
            rows += segments
            turned += [end % 2 == 1] * len(segments)
        counts.append(len(rows) - before)
        closed.append(stroke.closed or whole[stroke.entries[0] // 2])
    chains = Chains.of(counts, closed)
    points, weights = points[rows], weights[rows]
    back = torch.tensor(turned, dtype=torch.bool)
    points = torch.where(back[:, None, None], points.flip(1), points)
    weights = torch.where(back[:, None], weights.flip(1), weights)
    # The other half of a circle is a reflection, which rounding leaves a little off.
    return Sketch(chains.joined(points), weights, width=width, chains=chains)


def _strokes(curves: Curves) -> list[_Stroke]:
    """All curves as strokes: from every curve back to where its stroke begins, then along it."""
    pairs = smooth_joints(curves).tolist()
    mates = {**dict(pairs), **{b: a for a, b in pairs}}
    found: list[_Stroke] = []
    done: set[int] = set()
    for curve in range(len(curves)):
        if curve in done:
            continue
        start = 2 * curve
        while start in mates:
            start = _other_end(mates[start])
            if start == 2 * curve:
                break
        entries = [start]
        while (after := mates.get(_other_end(entries[-1]), start)) != start:
            entries.append(after)
        found.append(_Stroke(entries, start in mates))
        done |= {entry // 2 for entry in entries}
    return found


def _other_end(end: int) -> int:
    """The other end of the same curve."""
    return end ^ 1
