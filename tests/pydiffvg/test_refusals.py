"""What cannot be drawn is refused in a sentence."""

import math

import pytest
import torch

import diff3ds.pydiffvg as pydiffvg
from diff3ds.pydiffvg.scene_classes import FilterType

RED = torch.tensor([1.0, 0.0, 0.0, 1.0])
POINTS = torch.tensor([[1.0, 1.0], [2.0, 3.0], [3.0, 1.0], [4.0, 2.0]])


def path(inner=(2,), points=POINTS, closed=False, width=1.0):
    return pydiffvg.Path(torch.tensor(inner), points, closed, torch.as_tensor(width))


def draw(shapes, groups, **options):
    scene = pydiffvg.RenderFunction.serialize_scene(8, 8, shapes, groups, **options)
    return pydiffvg.RenderFunction.apply(8, 8, 2, 2, 0, None, *scene)


def stroked(*ids, color=RED, **values):
    return pydiffvg.ShapeGroup(torch.tensor(ids), None, stroke_color=color, **values)


NAN = POINTS.clone()
NAN[2, 0] = math.nan
TILTED = torch.eye(3)
TILTED[2, 0] = 0.1
STOPS = {"offsets": torch.tensor([0.0, 1.0]), "stop_colors": torch.zeros(3, 4)}
FAULTS = {
    "shape 0 has 4 points, but its num_control_points ask for 7, its end among them": lambda: (
        [path((2, 2))],
        [stroked(0)],
    ),
    "shape 0 has 4 points, but its num_control_points ask for 6": lambda: ([path((2, 2), closed=True)], [stroked(0)]),
    "num_control_points of shape 0 must be 0, 1 or 2 each, got 3": lambda: ([path((3,))], [stroked(0)]),
    r"points of shape 1 must be a tensor \(P, 2\), got shape \(2, 4\)": lambda: ([path(), path(points=POINTS.T)], []),
    "points of shape 1 must be finite": lambda: ([path(), path(points=NAN)], [stroked(0, 1)]),
    "stroke_width of shape 0 must be finite": lambda: ([path(width=math.inf)], [stroked(0)]),
    "stroke_width of shape 0 must be one, or one for each of its 4 points, got 3": lambda: (
        [path(width=[1.0, 1.0, 1.0])],
        [stroked(0)],
    ),
    "shape_ids of group 1 must be places in the list of 1 shapes, got 1": lambda: ([path()], [stroked(0), stroked(1)]),
    "shape_ids of group 0 must be places in the list of 1 shapes, got -1": lambda: ([path()], [stroked(-1)]),
    "shape_ids of group 0 must be places in the list of 1 shapes, got 0.5": lambda: ([path()], [stroked(0.5)]),
    r"stroke_color of group 0 must be a tensor of shape \(4,\), got shape \(3,\)": lambda: (
        [path()],
        [stroked(0, color=RED[:3])],
    ),
    "colours of group 0 must be finite": lambda: ([path()], [stroked(0, color=RED * math.nan)]),
    r"stop_colors of the stroke_color of group 0 must be a tensor of shape \(2, 4\), got shape \(3, 4\)": lambda: (
        [path()],
        [stroked(0, color=pydiffvg.LinearGradient(**STOPS))],
    ),
    "must be affine, with a last row of 0, 0, 1": lambda: ([path()], [stroked(0, shape_to_canvas=TILTED)]),
    r"shape_to_canvas of group 0 must be a tensor of shape \(3, 3\), got shape \(2, 3\)": lambda: (
        [path()],
        [stroked(0, shape_to_canvas=torch.eye(3)[:2])],
    ),
    r"center of shape 0 must be a tensor of shape \(2,\), got shape \(\)": lambda: (
        [pydiffvg.Circle(torch.tensor(1.0), torch.tensor(1.0))],
        [],
    ),
}  # fmt: skip


@pytest.mark.parametrize("sentence", FAULTS)
def test_wrong_values(sentence):
    with pytest.raises(ValueError, match=sentence):
        draw(*FAULTS[sentence]())


def test_wrong_kinds():
    with pytest.raises(TypeError, match="shape 0 must be one of Path, Polygon, Circle, Ellipse, Rect, got str"):
        draw(["a"], [])
    with pytest.raises(TypeError, match="group 0 must be a ShapeGroup, got Path"):
        draw([path()], [path()])
    some = stroked(0)
    some.stroke_color = "red"
    with pytest.raises(
        TypeError, match="stroke_color of group 0 must be RGBA, a LinearGradient, a RadialGradient or No"
    ):
        draw([path()], [some])


def test_what_is_not_drawn_says_what_to_do_instead():
    box = pydiffvg.PixelFilter(FilterType.box, torch.tensor(0.5))
    assert draw([path()], [stroked(0)], filter=box, use_prefiltering=True).shape == (8, 8, 4)
    with pytest.raises(NotImplementedError, match=r"box of radius 0.5, got hann of radius 1: leave the filter out"):
        draw([], [], filter=pydiffvg.PixelFilter(FilterType.hann, torch.tensor(1.0)))
    with pytest.raises(NotImplementedError, match=r"signed distances .* are not drawn: draw colours"):
        draw([], [], output_type=pydiffvg.OutputType.sdf)
    with pytest.raises(NotImplementedError, match=r"eval_positions are not drawn: .*grid_sample"):
        draw([], [], eval_positions=torch.zeros(3, 2))
    with pytest.raises(NotImplementedError, match="render_grad is not here: add an offset"):
        pydiffvg.RenderFunction.render_grad(1, 2)
    with pytest.raises(AttributeError, match="no 'OptimizableSvg': read a file with svg_to_scene"):
        pydiffvg.OptimizableSvg
    with pytest.raises(ValueError, match=r"what RenderFunction.serialize_scene returned"):
        pydiffvg.RenderFunction.apply(8, 8, 2, 2, 0, None)
    scene = pydiffvg.RenderFunction.serialize_scene(8, 8, [], [])
    with pytest.raises(
        ValueError, match=r"background_image must have shape \(8, 8, 4\), as the picture, got \(4, 8, 4\)"
    ):
        pydiffvg.RenderFunction.apply(8, 8, 2, 2, 0, torch.zeros(4, 8, 4), *scene)
    with pytest.raises(ValueError, match="a canvas has a positive width and height"):
        pydiffvg.RenderFunction.serialize_scene(0, 8, [], [])
