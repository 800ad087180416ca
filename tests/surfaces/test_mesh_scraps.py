"""What of a scan's creases and borders is no line of the thing: folds and cracks."""

import numpy as np
import pytest
import torch
from solids import box, icosphere

import diff3ds as ds
from diff3ds.surfaces.lines.feature_curves import crease_length, loose_share
from diff3ds.tasks.mesh.draw_mesh import without_cracks
from diff3ds.tasks.mesh.source import creased


def test_the_length_of_creases_is_that_of_their_runs():
    assert crease_length(ds.TriangleMesh(*box((0, 0, 0), (3, 1, 1)))) == pytest.approx((4 * 9 + 8 * 1) / (4 * 3 + 8))
    assert crease_length(ds.TriangleMesh(*icosphere(2))) == 0


def test_creases_of_a_smooth_thing_that_are_all_short_are_left_out():
    """A ball of which every fifth vertex stands out, so that half of the creases go on in others."""
    vertices, faces = icosphere(4)
    out = np.random.default_rng(0).random(len(vertices)) < 0.2
    rough = ds.TriangleMesh(vertices * (1 + 0.05 * out[:, None]), faces)
    assert 0.1 < loose_share(rough) < 0.5
    assert not creased(rough, None).is_crease.any()
    assert creased(rough, 38.0) is rough


def test_short_creases_of_what_has_faces_are_lines():
    small = ds.TriangleMesh(*box())
    assert creased(small, None) is small


def test_short_borders_are_cracks():
    lines = torch.tensor([[[0.0, 0, 0], [0.01, 0, 0]], [[0, 0, 0], [1, 0, 0]], [[0, 1, 0], [0.01, 1, 0]]])
    kept, kinds = without_cracks(ds.Sketch(lines), ("border", "border", "crease"), 0.05)
    assert kinds == ("border", "crease")
    torch.testing.assert_close(kept.points, lines[1:])
