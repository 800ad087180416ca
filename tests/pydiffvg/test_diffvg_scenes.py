"""Scenes by DiffVG's classes: areas, colours, order, groups, widths, transforms and what reaches the leaves."""

import math

import pytest
import torch

import diff3ds.pydiffvg as pydiffvg

BLACK = torch.tensor([0.0, 0.0, 0.0, 1.0])
RED = torch.tensor([1.0, 0.0, 0.0, 1.0])
# Curves are chords that lie within .01 px of them: the areas here lose so much by that.
CHORDS = 3e-3
SQUARE = [[4.0, 4.0], [12.0, 4.0], [12.0, 12.0], [4.0, 12.0]]


def drawn(shapes, groups, size=(16, 16), canvas=(16, 16), background=None):
    scene = pydiffvg.RenderFunction.serialize_scene(*canvas, shapes, groups)
    return pydiffvg.RenderFunction.apply(*size, 2, 2, 0, background, *scene)


def group(*ids, fill=None, **values):
    return pydiffvg.ShapeGroup(shape_ids=torch.tensor(ids), fill_color=fill, **values)


def line(x0, y0, x1, y1, width=1.0):
    points = torch.tensor([[x0, y0], [x1, y1]])
    return pydiffvg.Path(torch.tensor([0]), points, is_closed=False, stroke_width=torch.tensor(width))


def area(image):
    return float(image[..., 3].sum())


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (pydiffvg.Circle(torch.tensor(5.0), torch.tensor([8.0, 8.0])), math.pi * 25),
        (pydiffvg.Circle(torch.tensor([5.0]), torch.tensor([8.0, 8.0])), math.pi * 25),
        (pydiffvg.Ellipse(torch.tensor([6.0, 3.0]), torch.tensor([8.0, 8.0])), math.pi * 18),
        (pydiffvg.Rect(torch.tensor([2.5, 3.0]), torch.tensor([6.0, 11.0])), 28.0),
        (pydiffvg.Polygon(torch.tensor(SQUARE), True), 64.0),
        (pydiffvg.Polygon(torch.tensor([[2.0, 2.0], [12.0, 2.0], [2.0, 12.0]]), True), 50.0),
        # A parabola over its chord has two thirds of the area of the triangle of its control points.
        (pydiffvg.Path(torch.tensor([1, 0]), torch.tensor([[2.0, 2.0], [8.0, 14.0], [14.0, 2.0]]), True), 48.0),
        # The first point said again, and list-made whole numbers of any type.
        (pydiffvg.Path(torch.zeros(4), torch.tensor([*SQUARE, SQUARE[0]]), True), 64.0),
        (pydiffvg.Path(torch.zeros(4, dtype=torch.int32), torch.tensor(SQUARE).double(), True), 64.0),
    ],
)
def test_fills_have_their_areas(shape, expected):
    image = drawn([shape], [group(0, fill=RED)])
    assert area(image) == pytest.approx(expected, rel=CHORDS)
    torch.testing.assert_close(image[..., 0], image[..., 3], atol=1e-5, rtol=0)
    assert image[..., 1:3].abs().max() == 0


def test_strokes_have_half_widths():
    image = drawn([line(4, 8, 12, 8)], [group(0, stroke_color=BLACK)])
    assert area(image) == pytest.approx(8 * 2 + math.pi, rel=CHORDS)
    assert image[6:10, 8, 3].tolist() == pytest.approx([0, 1, 1, 0], abs=1e-3)
    for width in (torch.tensor([1.0]), torch.tensor([1.0, 1.0])):
        other = line(4, 8, 12, 8)
        other.stroke_width = width
        torch.testing.assert_close(drawn([other], [group(0, stroke_color=BLACK)]), image)
    assert area(drawn([line(4, 8, 12, 8, width=0.0)], [group(0, stroke_color=BLACK)])) == 0
    cone = line(4, 8, 12, 8)
    cone.stroke_width = torch.tensor([0.5, 2.0])
    column = drawn([cone], [group(0, stroke_color=BLACK)])[..., 3].sum(0)
    # The discs between them: by the middle, where the radius is 1.25, their envelope is a little wider.
    assert float(column[5]) < float(column[8]) < float(column[11])
    assert float(column[8]) == pytest.approx(2 * (0.5 + 1.5 * 4.5 / 8), rel=0.05)


def test_a_group_is_one_layer():
    cross = [line(2, 8, 14, 8), line(8, 2, 8, 14)]
    half = torch.tensor([0.0, 0.0, 0.0, 0.5])
    united = drawn(cross, [group(0, 1, stroke_color=half)])
    assert float(united[8, 8, 3]) == pytest.approx(0.5)
    apart = drawn(cross, [group(0, stroke_color=half), group(1, stroke_color=half)])
    assert float(apart[8, 8, 3]) == pytest.approx(0.75)


def test_later_groups_lie_on_top_and_fillings_on_their_strokes():
    square = pydiffvg.Polygon(torch.tensor(SQUARE), True)
    blue = torch.tensor([0.0, 0.0, 1.0, 1.0])
    image = drawn([square], [group(0, fill=RED), group(0, fill=blue)])
    assert image[8, 8].tolist() == pytest.approx([0, 0, 1, 1])
    image = drawn([square], [group(0, fill=RED, stroke_color=blue)])
    assert image[8, 4].tolist() == pytest.approx([1, 0, 0, 1], abs=1e-3)
    assert image[8, 3].tolist() == pytest.approx([0, 0, 1, 1], abs=1e-3)


def test_rules():
    inner = pydiffvg.Rect(torch.tensor([6.0, 6.0]), torch.tensor([10.0, 10.0]))
    outer = pydiffvg.Polygon(torch.tensor(SQUARE), True)
    assert area(drawn([outer, inner], [group(0, 1, fill=RED)])) == pytest.approx(64 - 16)
    assert area(drawn([outer, inner], [group(0, 1, fill=RED, use_even_odd_rule=False)])) == pytest.approx(64)
    turned = pydiffvg.Polygon(torch.tensor(SQUARE[::-1]), True)
    assert area(drawn([turned, inner], [group(0, 1, fill=RED, use_even_odd_rule=False)])) == pytest.approx(64 - 16)


def test_canvas_and_transforms_scale_widths_too():
    image = drawn([line(4, 8, 12, 8)], [group(0, stroke_color=BLACK)], size=(32, 32))
    assert area(image) == pytest.approx(4 * (16 + math.pi), rel=CHORDS)
    oblong = drawn([pydiffvg.Polygon(torch.tensor(SQUARE), True)], [group(0, fill=RED)], size=(32, 8))
    assert oblong.shape == (8, 32, 4)
    assert oblong[:, :, 3].sum(0).tolist() == [0.0] * 8 + [4.0] * 16 + [0.0] * 8
    half = torch.tensor([[0.5, 0.0, 3.0], [0.0, 0.5, 1.0], [0.0, 0.0, 1.0]])
    image = drawn([line(4, 8, 12, 8)], [group(0, stroke_color=BLACK, shape_to_canvas=half)])
    assert area(image) == pytest.approx((16 + math.pi) / 4, rel=2 * CHORDS)
    assert image[..., 3].sum(1)[4:6].sum() == pytest.approx(area(image))


def test_gradients_of_colours_lie_on_the_canvas():
    stops = {"offsets": torch.tensor([0.0, 1.0]), "stop_colors": torch.stack([RED, BLACK])}
    color = pydiffvg.LinearGradient(torch.tensor([0.0, 0.0]), torch.tensor([16.0, 0.0]), **stops)
    square = pydiffvg.Rect(torch.tensor([0.0, 0.0]), torch.tensor([8.0, 8.0]))
    double = torch.tensor([[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    image = drawn([square], [group(0, fill=color, shape_to_canvas=double)], size=(32, 16))
    expected = 1 - (torch.arange(32) + 0.5) / 32
    torch.testing.assert_close(image[8, :, 0], expected, atol=1e-3, rtol=0)
    around = pydiffvg.RadialGradient(torch.tensor([8.0, 8.0]), torch.tensor([8.0, 4.0]), **stops)
    image = drawn([square], [group(0, fill=around, shape_to_canvas=double)])
    assert float(image[8, 12, 0]) == pytest.approx(1 - math.hypot(4.5 / 8, 0.5 / 4), abs=0.01)
    assert float(image[11, 8, 0]) == pytest.approx(1 - math.hypot(0.5 / 8, 3.5 / 4), abs=0.01)


def test_background_and_empty_lists():
    assert torch.equal(drawn([], [], size=(4, 3)), torch.zeros(3, 4, 4))
    ground = torch.rand(16, 16, 4)
    assert torch.equal(drawn([], [], background=ground), ground)
    square = pydiffvg.Polygon(torch.tensor(SQUARE), True)
    image = drawn([square], [group(0, fill=RED)], background=torch.ones(16, 16, 3))
    assert image[0, 0].tolist() == [1, 1, 1, 1]
    assert image[8, 8].tolist() == pytest.approx([1, 0, 0, 1])


def test_tensors_are_kept_and_gradients_reach_them():
    points = torch.tensor(SQUARE, requires_grad=True)
    width, color = torch.tensor(1.0, requires_grad=True), torch.tensor([0.2, 0.4, 0.6, 0.5], requires_grad=True)
    radius, low = torch.tensor(2.0, requires_grad=True), torch.tensor([1.25, 1.5], requires_grad=True)
    path = pydiffvg.Path(torch.zeros(3, dtype=torch.int64), points * 1.0, is_closed=False, stroke_width=width)
    circle = pydiffvg.Circle(radius, torch.tensor([8.0, 8.0]))
    rect = pydiffvg.Rect(low, torch.tensor([3.0, 3.0]))
    groups = [group(0, stroke_color=color), group(1, 2, fill=RED)]
    image = drawn([path, circle, rect], groups)
    image[..., 3].sum().backward()
    for leaf in (points, width, color, radius, low):
        assert leaf.grad is not None
        assert leaf.grad.isfinite().all()
    assert radius.grad.item() == pytest.approx(2 * math.pi * 2, rel=0.02)
    assert low.grad.tolist() == pytest.approx([-1.5, -1.75], rel=1e-3)
    assert path.stroke_width is width
    assert groups[0].stroke_color is color
    # What is changed in place after construction is what is drawn.
    width.data.zero_()
    assert drawn([path], groups[:1])[..., 3].sum().item() == 0
    # The same scene can be drawn and differentiated twice.
    scene = pydiffvg.RenderFunction.serialize_scene(16, 16, [circle], [group(0, fill=RED)])
    for _ in range(2):
        pydiffvg.RenderFunction.apply(16, 16, 2, 2, 0, None, *scene).sum().backward()


def test_colours_of_whole_numbers_and_ids_of_floats():
    black = torch.tensor([0, 0, 0, 1])
    some = pydiffvg.ShapeGroup(torch.Tensor([0]), None, stroke_color=black)
    assert torch.equal(drawn([line(4, 8, 12, 8)], [some]), drawn([line(4, 8, 12, 8)], [group(0, stroke_color=BLACK)]))
