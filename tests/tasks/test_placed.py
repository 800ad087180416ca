"""Sketches turned upright and scaled: by cameras, by their own lines, with cameras that see them as before."""

import json
import math

import numpy as np
import pytest
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.photogrammetry.line_axes import line_axes
from diff3ds.photogrammetry.placing import centers_of, distance_between, moved, up_of
from diff3ds.tasks.views.placed import Placing, along_lines
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.transforms import read_views, save_views

TILTED = torch.linalg.qr(torch.tensor([[1.0, 0.2, 0.3], [-0.4, 1.0, 0.1], [0.2, 0.5, 1.0]], dtype=torch.float64))[0]
TILTED = TILTED * TILTED.det()


def about(axis, degrees):
    """A rotation matrix (Rodrigues)."""
    x, y, z = torch.nn.functional.normalize(torch.tensor(axis, dtype=torch.float64), dim=0).tolist()
    cross = torch.tensor([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]], dtype=torch.float64)
    a = math.radians(degrees)
    return torch.eye(3, dtype=torch.float64) + math.sin(a) * cross + (1 - math.cos(a)) * cross @ cross


def box():
    """The edges of a box, and a bent stroke."""
    corners = torch.tensor([[x, y, z] for x in (-0.4, 0.4) for y in (-0.3, 0.3) for z in (0.0, 0.5)])
    ends = [(a, b) for i, a in enumerate(corners) for b in corners[i + 1 :] if int((a != b).sum()) == 1]
    lines = torch.stack([torch.stack([a + (b - a) * t / 3 for t in range(4)]) for a, b in ends])
    bent = torch.tensor([[[0.0, 0, 0], [0.2, 0.3, 0.1], [0.4, 0.1, 0.4], [0.1, 0.2, 0.6]]])
    return ds.Sketch(torch.cat([lines, bent]).double(), width=0.02)


def turned(sketch, rotation):
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3, :3] = rotation
    return sketch.transform(matrix)


def test_axes_of_lines_among_others(generator):
    """Half of the length is along three axes, two of them short; the other lines go anywhere."""
    along = TILTED.repeat_interleave(torch.tensor([10, 3, 3]), 0)
    along = along + 0.003 * torch.randn(16, 3, generator=generator, dtype=torch.float64)
    any_ = torch.randn(16, 3, generator=generator, dtype=torch.float64)
    directions = torch.nn.functional.normalize(torch.cat([along, any_]), dim=1)
    directions *= torch.sign(torch.randn(32, 1, generator=generator, dtype=torch.float64))
    found = line_axes(directions, torch.ones(32, dtype=torch.float64))
    assert (found.axes @ TILTED.mT).abs().amax(1).min() > math.cos(math.radians(0.3))
    assert torch.linalg.det(found.axes) == pytest.approx(1.0)
    assert found.share.sum() >= 0.5
    assert line_axes(directions[:2], torch.ones(2, dtype=torch.float64)) is None


def test_photographs_that_were_held_aside_do_not_tilt_the_world(tmp_path):
    cameras = ds.orbit([36.0 * i for i in range(10)], [20.0, 35.0] * 5, 2.0, size=(24, 32))
    names = [f"{i}.png" for i in range(10)]
    for name in names:
        Image.new("RGB", (32, 24)).save(tmp_path / name)
    ds.save_transforms(tmp_path / "transforms.json", cameras, names)
    views = moved(read_views(tmp_path / "transforms.json"), torch.zeros(3).double(), TILTED, 1.0)
    quarter = torch.tensor([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]], dtype=torch.float64)
    for view in views[:2]:
        view.world_to_camera[:3] = quarter @ view.world_to_camera[:3]
    assert up_of(views) @ TILTED[:, 2] > math.cos(math.radians(0.3))


def test_lines_turn_the_sketch_the_rest_of_the_way():
    """Cameras say up but for 4 degrees; the box ends up along the axes, its x nearest to where it was."""
    sketch = turned(box(), about([1.0, 2.0, 0.5], 4.0))
    placing = Placing(torch.eye(3, dtype=torch.float64), 1.0, {}, "")
    found = along_lines(placing, sketch, ViewsOptions(up="auto"))
    torch.testing.assert_close(found.sketch(sketch).points, box().points, rtol=0, atol=1e-5)
    assert found.about["lines_follow"] == pytest.approx(1.0)
    assert "of the lines follow" in found.line
    # Lines that go anywhere, and axes that no camera has upright, say nothing.
    aslant = turned(box(), about([1.0, 0.0, 0.0], 40.0))
    assert torch.equal(along_lines(placing, aslant, ViewsOptions(up="auto")).turn, placing.turn)
    bent = box()[[12]]
    assert "lines say nothing" in along_lines(placing, bent, ViewsOptions(up="auto")).line


@pytest.mark.parametrize("lens", [{"fov": 40.0}, {"height": 2.0}])
def test_placed_cameras_see_the_placed_sketch_as_before(lens):
    cameras = ds.orbit([0.0, 100.0], [20.0, 50.0], 3.0, size=48, **lens).to(torch.float64)
    placing = Placing(TILTED, 25.4, {}, "")
    before = ds.render(box(), cameras).color
    torch.testing.assert_close(ds.render(placing.sketch(box()), placing.cameras(cameras)).color, before)


def test_a_run_in_the_users_unit(tmp_path):
    """Cameras of an orbit in a tilted world, 500 mm apart by the user: upright and in mm in the end."""
    cameras = ds.orbit([0.0, 90.0, 180.0, 270.0], [20.0, 30.0, 10.0, 25.0], 2.0, size=(24, 32))
    names = [f"{i}.png" for i in range(4)]
    for name, image in zip(names, ds.render(box().to(torch.float32), cameras).color, strict=True):
        Image.fromarray((255 * image).byte().numpy()).save(tmp_path / name)
    ds.save_transforms(tmp_path / "transforms.json", cameras, names)
    tilted = moved(read_views(tmp_path / "transforms.json"), torch.zeros(3).double(), TILTED, 1.0)
    save_views(tmp_path / "transforms.json", tilted)
    few = {"target": "color", "strokes": 4, "steps": 2}
    plain = run_views(tmp_path, tmp_path / "plain", ViewsOptions(**few))
    said = []
    options = ViewsOptions(**few, up="auto", scale=500.0, between=("0", "2.png"))
    found = run_views(tmp_path, tmp_path / "out", options, say=said.append)
    views = read_views(tmp_path / "out" / "transforms_placed.json")
    assert distance_between(views, ("0", "2")) == pytest.approx(500.0)
    torch.testing.assert_close(up_of(views), torch.tensor([0.0, 0, 1]).double(), rtol=0, atol=1e-6)
    assert any("all lengths times" in line for line in said)
    np.testing.assert_array_equal(*(np.array(Image.open(tmp_path / n / "preview.png")) for n in ("plain", "out")))
    factor = 500 / distance_between(tilted, ("0", "2"))
    torch.testing.assert_close(found.points.norm(dim=-1), factor * plain.points.norm(dim=-1), rtol=1e-4, atol=1e-3)
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert run["placed"]["scale"] == pytest.approx(factor)
    # Two points of the world do as well as two cameras.
    points = tuple(",".join(map(str, c.tolist())) for c in centers_of(tilted)[[0, 2]])
    assert 500 / distance_between(tilted, points) == pytest.approx(factor)


def test_what_cannot_be_placed_is_refused(tmp_path):
    with pytest.raises(ValueError, match="scale and between belong together"):
        ViewsOptions(scale=2.0)
    with pytest.raises(ValueError, match="two different places, got 'a' twice"):
        ViewsOptions(scale=2.0, between=("a", "a"))
    with pytest.raises(ValueError, match="leave --up and --scale out"):
        ViewsOptions(up="auto", start=tmp_path)
    with pytest.raises(ValueError, match="the embedded scene is upright"):
        run_views(None, tmp_path / "out", ViewsOptions(up="auto"))
    assert not (tmp_path / "out").exists()
