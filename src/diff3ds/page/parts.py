"""Parts of a sketch's segments as a sketch: what goes on from one part to the next stays one stroke."""

from dataclasses import dataclass, replace

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask, Tensor
from diff3ds.bezier import subcurve
from diff3ds.chains import Chains
from diff3ds.sketch import Sketch


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of segments, in order; together all that lies in front of the near plane.

    Attributes:
        segment: the segment of each.
        start: its parameter where the part begins.
        stop: and ends.
        visible: whether it is seen.
    """

    segment: Int[Index, " P"]
    start: Float[Array, " P"]
    stop: Float[Array, " P"]
    visible: Bool[Mask, " P"]

    def __getitem__(self, rows: Mask | Index) -> "Parts":
        """Some of the parts."""
        return Parts(self.segment[rows], self.start[rows], self.stop[rows], self.visible[rows])

    def seen_of(self, sketch: Sketch) -> Sketch:
        """The visible parts of a sketch's strokes."""
        seen = self[self.visible]
        return cut_sketch(sketch, seen.segment, seen.start, seen.stop)[0]

    @staticmethod
    def none() -> "Parts":
        """Those of no segments."""
        return Parts(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0, bool))

    @staticmethod
    def whole(segments: int) -> "Parts":
        """So many segments, all seen."""
        return Parts(np.arange(segments), np.zeros(segments), np.ones(segments), np.ones(segments, bool))

    @staticmethod
    def concatenate(first: "Parts", second: "Parts", segments: int) -> "Parts":
        """Parts of two sketches as parts of both together; the first has so many segments."""
        return Parts(
            np.concatenate([first.segment, second.segment + segments]),
            *(np.concatenate([getattr(first, name), getattr(second, name)]) for name in ("start", "stop", "visible")),
        )


def cut_sketch(
    sketch: Sketch,
    segment: Int[Index, " P"],
    start: Float[Array, " P"],
    stop: Float[Array, " P"],
    ends: Float[Tensor, "P 2"] | None = None,
) -> tuple[Sketch, Int[Index, " R"]]:
    """Parts of segments, in order, as strokes with the appearance of theirs; gradients flow to the sketch.

    Args:
        ends: start and stop with their history, where gradients flow to these too.

    Returns:
        The strokes, and the stroke of the sketch that each is a part of.
    """
    runs, closed = _runs(sketch, segment, start, stop)
    order = np.array([part for run in runs for part in run], np.int64)
    home = sketch.points.device
    rows = torch.from_numpy(segment[order]).to(home)
    given = torch.from_numpy(np.stack([start, stop], 1)) if ends is None else ends
    begin, end = given[torch.from_numpy(order)].to(sketch.points).unbind(1)
    points, weights = subcurve(sketch.points[rows], sketch.weights[rows], begin, end)
    chains = sketch.chains or Chains.plain(len(sketch), home)
    firsts = torch.from_numpy(segment[np.array([run[0] for run in runs], np.int64)]).to(home)
    stroke = chains.stroke[firsts]
    made = Chains.of([len(run) for run in runs], closed).to(home)
    if len(runs):
        points = made.joined(points)
    curves = {"points": points, "weights": weights, "chains": made}
    if sketch.width.ndim == 2:
        cut, _ = subcurve(sketch.width[rows][..., None], None, begin, end)
        curves["width"] = made.joined(cut[..., 0]).clamp(min=0) if len(runs) else cut[..., 0]
    return sketch.select(stroke, **curves), stroke.cpu().numpy()


def _runs(
    sketch: Sketch, segment: Int[Index, " P"], start: Float[Array, " P"], stop: Float[Array, " P"]
) -> tuple[list[list[int]], list[bool]]:
    """Which parts follow on each other within a stroke, and whether they close."""
    after = torch.full((len(sketch.points),), -1) if sketch.chains is None else sketch.chains.after
    following = after.cpu().numpy()
    first_at = {int(s): k for k, s in reversed(list(enumerate(segment)))}
    onwards: dict[int, int] = {}
    for k, s in enumerate(segment.tolist()):
        n = k + 1
        if n < len(segment) and segment[n] == s and start[n] == stop[k]:
            onwards[k] = n
        elif stop[k] == 1 and following[s] >= 0:
            n = first_at.get(int(following[s]), -1)
            if n >= 0 and start[n] == 0:
                onwards[k] = n
    inner = set(onwards.values())
    runs, closed = [], []
    left = set(range(len(segment)))
    for k in (*(k for k in range(len(segment)) if k not in inner), *range(len(segment))):
        if k not in left:
            continue
        run = [k]
        left.discard(k)
        while (n := onwards.get(run[-1], -1)) in left:
            run.append(n)
            left.discard(n)
        runs.append(run)
        closed.append(onwards.get(run[-1], -1) == k)
    order = sorted(range(len(runs)), key=lambda r: min(runs[r]))
    return [runs[r] for r in order], [closed[r] for r in order]


def faint(sketch: Sketch, share: float) -> Sketch:
    """The same strokes with so large a share of their opacity."""
    return replace(sketch, opacity=sketch.opacity * share)
