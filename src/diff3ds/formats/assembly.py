"""Strokes that were read from a file, of segments of any degrees, as one sketch."""

from collections.abc import Sequence
from typing import NamedTuple

import torch

from diff3ds.bezier import elevate
from diff3ds.chains import Chains
from diff3ds.sketch import DEFAULT_WIDTH, Sketch, WidthSpace

# Control points (K, 3) and weights (K).
Segment = tuple[Sequence[Sequence[float]], Sequence[float]]


class ReadStroke(NamedTuple):
    """A stroke: its segments, each of a degree of its own, and its width, one or for each control point of each."""

    segments: Sequence[Segment]
    closed: bool
    color: Sequence[float]
    width: float | Sequence[Sequence[float]] = DEFAULT_WIDTH
    opacity: float = 1.0


def sketch_of(strokes: Sequence[ReadStroke], width_space: WidthSpace = "image") -> Sketch:
    """The strokes in float64, all of the highest degree among them; what has that degree is not changed.

    Raises:
        ValueError: as `Sketch`.
    """
    segments = [segment for stroke in strokes for segment in stroke.segments]
    controls = [len(weights) for _, weights in segments]
    most = max(controls)
    points = torch.empty(len(segments), most, 3, dtype=torch.float64)
    weights = torch.empty(len(segments), most, dtype=torch.float64)
    for count in set(controls):
        rows = [i for i, k in enumerate(controls) if k == count]
        some, of_some = (torch.tensor([segments[i][part] for i in rows], dtype=torch.float64) for part in (0, 1))
        points[rows], weights[rows] = elevate(some, of_some, most - 1)

    def column(values: Sequence[object]) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float64)

    if all(isinstance(stroke.width, float) for stroke in strokes):
        width = column([stroke.width for stroke in strokes])
    else:
        rows_of = [
            [[stroke.width] * len(weights)] * len(stroke.segments) if isinstance(stroke.width, float) else stroke.width
            for stroke in strokes
            for _, weights in stroke.segments[:1]
        ]
        each = [row for rows in rows_of for row in rows]
        width = torch.stack([elevate(column(row)[:, None], None, most - 1)[0][:, 0] for row in each])
    return Sketch(
        points,
        weights,
        width=width,
        color=column([list(stroke.color) for stroke in strokes]),
        opacity=column([stroke.opacity for stroke in strokes]),
        width_space=width_space,
        chains=Chains.of([len(stroke.segments) for stroke in strokes], [stroke.closed for stroke in strokes]),
    )
