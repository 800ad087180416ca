"""Previews of runs of phrases and pictures."""

import numpy as np
import torch

import diff3ds as ds
from diff3ds.tasks.results import seen_around, turntable


def test_a_preview_leaves_out_the_lines_that_a_surface_hides():
    """A line up beside a wall is seen from its own side, and not from the other one."""
    line = ds.Sketch(torch.tensor([[[0.3, 0.0, z / 3 - 0.5] for z in range(4)]]), width=0.05)
    wall = np.array([[[0.0, y, z] for y, z in c] for c in (((-1, -1), (1, -1), (1, 1)), ((-1, -1), (1, 1), (-1, 1)))])
    around = turntable(line)
    size = int(around.size[0])
    seen = seen_around(line, around, ds.TriangleMesh.of_triangles(wall))
    bare = seen_around(line, around, None)
    middle = slice(size // 3, 2 * size // 3)
    ink = [[float((1 - tile[middle, i * size : (i + 1) * size]).amax()) for i in range(4)] for tile in (
        seen[:size], seen[size:], bare[:size], bare[size:])]  # fmt: skip
    # Eight views from the front on; the fifth is from behind.
    assert ink[0][0] > 0.9
    assert min(ink[2][0], ink[3][0]) > 0.9
    behind = (1 - seen[size:, :size])[middle, size // 2 - 8 : size // 2 + 8]
    assert float(behind.amax()) < 0.1
