"""The lines of a mesh that no view changes: of its faces, at a scale, and of both what can be seen from outside."""

import numpy as np
import torch

from diff3ds._shapes import Bool, Mask
from diff3ds.bezier import evaluate
from diff3ds.chains import Chains
from diff3ds.curves.shapes.smooth_joints import first_curves, sketch_of
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.surfaces.hidden.outside import Outside
from diff3ds.surfaces.lines.feature_curves import feature_curves
from diff3ds.surfaces.lines.scale_creases import scale_creases
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# More runs of creases and borders than this are a mistake: a scan's noise, or an angle that is too small.
MOST_RUNS = 20_000
# Points along a segment, of which so large a share is seen from outside of a line that counts. Empirical.
POINTS, SEEN = 9, 0.1

# Strokes, and what each is.
FixedLines = tuple[Sketch, tuple[str, ...]]


def feature_lines(mesh: TriangleMesh) -> FixedLines:
    """The creases, borders and seams of a mesh.

    Raises:
        ValueError: more of them than a drawing has.
    """
    found = feature_curves(mesh, MOST_RUNS)
    sketch = sketch_of(found.curves, DEFAULT_WIDTH)
    return sketch, tuple(found.kinds[row] for row in first_curves(sketch, found.curves))


def scale_lines(mesh: TriangleMesh, where: Bool[Mask, " F"] | None = None) -> FixedLines:
    """The ridges and valleys of a mesh, on some faces or all."""
    curves, kinds = scale_creases(mesh, where)
    sketch = sketch_of(curves, DEFAULT_WIDTH)
    return sketch, tuple(kinds[row] for row in first_curves(sketch, curves))


def both(one: FixedLines, other: FixedLines) -> FixedLines:
    """FixedLines of two kinds together."""
    return Sketch.concatenate([one[0], other[0]]), one[1] + other[1]


def from_outside(lines: FixedLines, mesh: TriangleMesh) -> FixedLines:
    """The lines but for those that lie on what nobody outside sees."""
    sketch, kinds = lines
    if not len(sketch):
        return lines
    some = sketch.detach()
    places = evaluate(some.points.double(), some.weights.double(), torch.linspace(0, 1, POINTS, dtype=torch.float64))
    seen = Outside.of(mesh).sees(places.reshape(-1, 3).numpy())
    stroke = np.repeat((some.chains or Chains.plain(len(some))).stroke.numpy(), POINTS)
    share = np.bincount(stroke, seen, len(sketch)) / np.bincount(stroke, minlength=len(sketch))
    rows = np.flatnonzero(share > SEEN).tolist()
    return sketch[rows], tuple(kinds[row] for row in rows)
