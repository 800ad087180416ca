"""Where two curves go on smoothly in each other, and the sketch in which such curves are one stroke."""

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Int
from diff3ds.chains import Chains
from diff3ds.curves.directions import turns
from diff3ds.curves.join import join_ends
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.sketch import Sketch

# [rad; empirical] Curves that turn by less where they meet go on in each other.
TURN = np.deg2rad(20.0)


def smooth_joints(curves: Curves) -> Int[NDArray[np.int64], "P 2"]:
    """Pairs of ends that meet smoothly where no third curve does; the start of curve i is end 2 i, its stop 2 i + 1."""
    control = curves.constrained(curves.points)[0].double().numpy()
    outward = (control[:, [0, 3]] - control[:, [1, 2]]).reshape(-1, 3)
    vertex = curves.vertex.numpy().reshape(-1)
    order = np.argsort(vertex, kind="stable")
    _, first, count = np.unique(vertex[order], return_index=True, return_counts=True)
    pairs = order[first[count == 2][:, None] + [0, 1]]
    return pairs[turns(outward[pairs[:, 0]], -outward[pairs[:, 1]]) < TURN]


def sketch_of(curves: Curves, width: float) -> Sketch:
    """The curves as black strokes, as a pen would draw them.

    A whole circle or ellipse is one closed stroke of two segments. Curves that meet smoothly are one stroke, closed
    where they run round; they stay apart at corners, and where three or more meet. Strokes come in the order of their
    first curves, which keep their directions.
    """
    points, weights = curves.segments(curves.points)
    whole = curves.closed.tolist()
    chains = Chains.of([2 if closed else 1 for closed in whole], whole)
    # The other half of a circle is a reflection, which rounding leaves a little off.
    sketch = Sketch(chains.joined(points), weights, width=width, chains=chains)
    return join_ends(sketch, smooth_joints(curves)).sketch


def first_curves(sketch: Sketch, curves: Curves) -> list[int]:
    """The row of the first curve of each stroke of `sketch_of`: the one with the same middle."""
    from scipy.spatial import cKDTree

    if not len(sketch):
        return []
    first = (sketch.chains or Chains.plain(len(sketch))).first[:-1]
    middles = cKDTree(curves.points[:, 1:3].double().mean(1).numpy())
    rows: list[int] = middles.query(sketch.points[first, 1:3].double().mean(1).numpy())[1].tolist()
    return rows
