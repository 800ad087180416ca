"""What benchmarks/color_views.py compares: occlusion by depth and by creation, in scenes where much is hidden."""

import sys
from pathlib import Path

import pytest
import torch

import diff3ds as ds
from diff3ds.project import project
from diff3ds.render import rasterize

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from color_views import by_creation
from occlusion_scenes import caged_ball, linked_rings, pictures_of

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def stroke(*ends, color=RED):
    return ds.Sketch(torch.tensor([ends]), width=0.2, color=color, width_space="world")


@pytest.mark.parametrize("first", ["near", "far"])
def test_the_later_stroke_covers_the_earlier_whatever_their_depth(first):
    cameras = ds.orbit(0.0, 0.0, 3.0, size=65)
    near = stroke((0.5, -0.6, 0.0), (0.5, 0.6, 0.0), color=RED)
    far = stroke((-0.5, 0.0, -0.6), (-0.5, 0.0, 0.6), color=BLUE)
    sketch = ds.Sketch.concatenate([near, far] if first == "near" else [far, near])
    middle = [rasterize(drawn(sketch, cameras), 65).color[0, 32, 32] for drawn in (project, by_creation)]
    assert middle[0].tolist() == list(RED)
    assert middle[1].tolist() == list(BLUE if first == "near" else RED)


def test_strokes_apart_look_the_same_in_both_orders():
    """Exactly so where all of it has one depth, which a camera straight ahead sees."""
    cameras = ds.orbit(0.0, 0.0, 3.0, size=64)
    bent = stroke((0.2, -0.6, 0.0), (0.2, 0.0, 0.9), (0.2, 0.6, -0.3))
    outside = stroke((0.0, 9.0, 0.0), (0.0, 9.0, 1.0))
    sketch = ds.Sketch.concatenate([bent, outside])
    alpha = [rasterize(drawn(sketch, cameras), 64).alpha for drawn in (project, by_creation)]
    assert alpha[0].sum() > 100
    torch.testing.assert_close(alpha[1], alpha[0], rtol=0, atol=1e-4)


@pytest.mark.parametrize("scene", [linked_rings, caged_ball])
def test_the_scenes_hide_much(scene):
    """In every view the order of depth matters: in another order the picture differs in many pixels."""
    sketch = scene()
    pictures = pictures_of(sketch, 3, 0.0)
    assert pictures.target == "color"
    for view in range(3):
        shown = pictures.batch([view]).pixels
        other = rasterize(by_creation(sketch, pictures.cameras[view]), pictures.cameras.size, background=0.0)
        covered = shown[..., 3] > 0.99
        differs = ((shown[..., :3] - other.color).abs().amax(-1) > 0.1) & covered
        assert differs.sum() > 0.05 * covered.sum()
