"""Where two curves go on smoothly in each other, and the sketch in which such curves are one stroke."""

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Int
from diff3ds.chains import Chains
from diff3ds.curves.directions import turns
from diff3ds.curves.join import join_ends
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.sketch import Sketch

# [rad; empirical] Curves that turn by less where they meet go on in each other.
TURN = np.deg2rad(20.0)


def smooth_joints(curves: Curves, through: bool = False) -> Int[NDArray[np.int64], "P 2"]:
    """Pairs of ends that meet smoothly; the start of curve i is end 2 i, its stop 2 i + 1.

    Args:
        through: also where more than two curves meet: the straightest pairs go on in each other. Else only where no
            third curve ends.
    """
    control = curves.constrained(curves.points)[0].double().numpy()
    outward = (control[:, [0, 3]] - control[:, [1, 2]]).reshape(-1, 3)
    vertex = curves.vertex.numpy().reshape(-1)
    order = np.argsort(vertex, kind="stable")
    _, first, count = np.unique(vertex[order], return_index=True, return_counts=True)
    pairs = order[first[count == 2][:, None] + [0, 1]]
    pairs = pairs[turns(outward[pairs[:, 0]], -outward[pairs[:, 1]]) < TURN]
    if not through:
        return pairs
    crossing = [_straightest(order[start : start + n], outward) for start, n in zip(first, count, strict=True) if n > 2]
    return np.concatenate([pairs, *crossing])


def _straightest(ends: Int[NDArray[np.int64], " E"], outward: Float[Array, "A 3"]) -> Int[NDArray[np.int64], "P 2"]:
    """Pairs of the ends at a vertex that go on in each other, the straightest first."""
    one, other = ends[np.stack(np.triu_indices(len(ends), 1))]
    turn = turns(outward[one], -outward[other])
    found: list[tuple[int, int]] = []
    for k in np.argsort(turn, kind="stable"):
        if turn[k] < TURN and not {one[k], other[k]} & {end for pair in found for end in pair}:
            found.append((int(one[k]), int(other[k])))
    return np.array(found, np.int64).reshape(-1, 2)


def sketch_of(curves: Curves, width: float, through: bool = False) -> Sketch:
    """The curves as black strokes, as a pen would draw them.

    A whole circle or ellipse is one closed stroke of two segments. Curves that meet smoothly are one stroke, closed
    where they run round; they stay apart at corners, and where three or more meet. Strokes come in the order of their
    first curves, which keep their directions.

    Args:
        width: of the strokes.
        through: where three or more meet, those that go on in each other are one stroke as well.
    """
    points, weights = curves.segments(curves.points)
    whole = curves.closed.tolist()
    chains = Chains.of([2 if closed else 1 for closed in whole], whole)
    # The other half of a circle is a reflection, which rounding leaves a little off.
    sketch = Sketch(chains.joined(points), weights, width=width, chains=chains)
    return join_ends(sketch, smooth_joints(curves, through)).sketch


def first_curves(sketch: Sketch, curves: Curves) -> list[int]:
    """The row of the first curve of each stroke of `sketch_of`: the one with the same middle."""
    from scipy.spatial import cKDTree

    if not len(sketch):
        return []
    first = (sketch.chains or Chains.plain(len(sketch))).first[:-1]
    middles = cKDTree(curves.points[:, 1:3].double().mean(1).numpy())
    rows: list[int] = middles.query(sketch.points[first, 1:3].double().mean(1).numpy())[1].tolist()
    return rows
