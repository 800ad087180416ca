"""Strokes as polylines, for formats and programs that know no curves."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Float
from diff3ds.bezier import tessellate
from diff3ds.formats.framing import ball_of
from diff3ds.sketch import Sketch

# Of the radius of the sketch: how far polylines may be off the curves.
TOLERANCE = 1e-4


class Polyline(NamedTuple):
    """A stroke.

    Attributes:
        vertices: world units; of closed ones the first is not given again.
        closed: whether the last vertex is joined to the first.
    """

    vertices: Float[NDArray[np.float64], "P 3"]
    closed: bool


def polylines_of(sketch: Sketch, tolerance: float = TOLERANCE) -> list[Polyline]:
    """One a stroke, float64, off by the tolerance times the sketch's radius at most."""
    sketch = sketch.detach().to("cpu")
    tolerance *= ball_of(sketch)[1]
    pieces = [
        vertices.numpy() for _, vertices in tessellate(sketch.points.double(), sketch.weights.double(), tolerance)
    ]
    first = range(len(sketch) + 1) if sketch.chains is None else sketch.chains.first.tolist()
    closed = [False] * len(sketch) if sketch.chains is None else sketch.chains.closed.tolist()
    found = []
    for stroke in range(len(sketch)):
        some = pieces[first[stroke] : first[stroke + 1]]
        vertices = np.concatenate([some[0], *(piece[1:] for piece in some[1:])])
        found.append(Polyline(vertices[: len(vertices) - closed[stroke]], closed[stroke]))
    return found
