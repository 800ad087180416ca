"""The benchmarks' drawings without hidden lines: what a box hides is known."""

import sys
from pathlib import Path

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.library.shapes import box
from diff3ds.sketch import Sketch

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from other_drawings import SHAPES, SIZE, depth_behind, shape_drawing, slabs_of, solid_drawing


@pytest.fixture(scope="module")
def cube() -> Sketch:
    """The edges of a cube of side 1."""
    strokes = box((0, 0, 0), (1, 1, 1)).strokes
    return Sketch((strokes[..., :3] / strokes[..., 3:]).float(), strokes[..., 3].float())


def test_depth_behind_the_surface_of_a_cube(cube):
    """Straight through, slanting through, from the surface outwards, and past it."""
    points = np.array([[-0.5, 0.0, 0.1], [0.0, 0.1, 0.2], [0.5, 0.2, 0.3], [-0.5, 0.0, 0.9]])
    eye = np.array([3.0, 0.0, 0.1])
    # Slabs overlap: a ray that is nearly level counts up to twice where they do.
    found = depth_behind(points, eye, slabs_of(cube))
    slanting = 0.5 / 3 * np.linalg.norm(eye - points[1])
    assert found[0] == pytest.approx(1, rel=0.02)
    assert slanting - 1e-6 <= found[1] <= 2 * slanting
    assert found[2] == pytest.approx(0, abs=1e-6)
    assert found[3] == 0


def test_three_edges_of_a_cube_are_hidden(cube):
    """From above a corner three edges end in the one that is hidden; the ink is that of the nine others."""
    camera = ds.orbit(45.0, 30.0, 3.0, size=SIZE)
    middles = (cube.points[:, 0] + cube.points[:, 3]) / 2
    back = ((middles - torch.tensor([-0.5, -0.5, -0.5])).abs() < 1e-6).sum(1) == 2
    assert int(back.sum()) == 3
    wanted = ds.render(cube[~back], camera).color[0]
    found = solid_drawing(cube, camera, outlined=False)
    # Of a hidden edge the piece nearest to the visible ones, no deeper than SURFACE, is drawn.
    ink = float((1 - wanted).sum())
    assert float((found - wanted).abs().sum()) < 0.12 * ink
    whole = ds.render(cube, camera).color[0]
    assert float((whole - wanted).abs().sum()) > 0.2 * ink


def test_the_outline_of_a_cube_is_six_of_its_edges(cube):
    """They are drawn already: with the outline there is ink in hardly any other place."""
    camera = ds.orbit(45.0, 30.0, 3.0, size=SIZE)
    plain, outlined = (solid_drawing(cube, camera, outlined)[..., 0] < 0.5 for outlined in (False, True))
    near = torch.nn.functional.max_pool2d(plain[None].float(), 13, 1, 6)[0] > 0
    assert float((outlined & ~near).sum()) < 0.02 * float(plain.sum())


def test_shapes_are_lines_and_shake(cube):
    for name in SHAPES:
        exact, shaken = (shape_drawing(name, how) for how in (None, np.random.default_rng(0)))
        assert 0.003 < float((exact < 0.5).float().mean()) < 0.06
        assert not torch.equal(exact, shaken)
        assert torch.equal(shaken, shape_drawing(name, np.random.default_rng(0)))
