"""SVG drawings as flat sketches, and the sheet that shows them as they are drawn."""

import pytest
import torch

import diff3ds as ds
import diff3ds.pydiffvg as pydiffvg

DRAWING = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="32" height="24"><g fill="none" stroke-linecap="round"'
    ' stroke-linejoin="round"><path d="M4 4L20 4Q28 4 28 12" stroke="red" stroke-width="3"/>'
    '<circle cx="7" cy="7" r="4" stroke="blue" stroke-opacity=".5" stroke-width="1" transform="scale(2)"/></g>{}</svg>'
)


def test_a_drawing_on_its_sheet_looks_as_drawn(tmp_path):
    path = tmp_path / "drawing.svg"
    path.write_text(DRAWING.format(""))
    sketch = ds.load(path)
    assert len(sketch) == 2
    assert sketch.chains.closed.tolist() == [False, True]
    assert sketch.points[:2, [0, 3], :2].tolist() == [[[4, 4], [20, 4]], [[20, 4], [28, 12]]]
    assert sketch.width.tolist() == [3, 2]
    assert sketch.opacity.tolist() == [1, 0.5]
    seen = ds.render(sketch, ds.sheet(32, 24), background=(1, 1, 1)).color[0]
    width, height, shapes, groups = pydiffvg.svg_to_scene(path)
    scene = pydiffvg.RenderFunction.serialize_scene(width, height, shapes, groups)
    drawn = pydiffvg.RenderFunction.apply(width, height, 2, 2, 0, torch.ones(height, width, 4), *scene)
    assert seen.shape == (24, 32, 3)
    assert (seen - drawn[..., :3]).abs().mean() < 0.01
    assert (seen - drawn[..., :3]).abs().max() < 0.15


def test_painters_order_and_pixels():
    ends = torch.tensor([[[2.0, 4, 0], [14, 4, 0]], [[8, 1, 0], [8, 7, 0]]])
    sketch = ds.Sketch(ends, width=2.0, color=torch.eye(3)[:2], width_space="world")
    image = ds.render(sketch, ds.sheet(16, 8), background=(1, 1, 1)).color[0]
    assert image[3, 4].tolist() == pytest.approx([1, 0, 0], abs=1e-3)
    assert image[4, 8].tolist() == pytest.approx([0, 1, 0], abs=1e-3)
    assert image[3, 0].tolist() == pytest.approx([1, 1, 1])
    with pytest.raises(ValueError, match="size must be a positive int"):
        ds.sheet(0, 4)


def test_what_has_no_stroke(tmp_path):
    path = tmp_path / "drawing.svg"
    path.write_text(DRAWING.format('<rect width="4" height="4"/>'))
    with pytest.warns(UserWarning, match="left out are 1 filled shapes without a stroke"):
        ds.load(path)
    path.write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><rect width="4" height="4"/></svg>')
    with pytest.raises(ValueError, match="nothing in it has a stroke"):
        ds.load(path)
