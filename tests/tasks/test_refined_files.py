"""What a run writes of refined cameras: a transforms.json that says what was seen, and how far they moved."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.distortion import Distortion
from diff3ds.edges.cameras.coarse_to_fine import Refined
from diff3ds.formats import save_png
from diff3ds.photogrammetry.find_project import sparse_points
from diff3ds.photogrammetry.lens_change import UNCHANGED, LensChange
from diff3ds.pictures.frame import Frame
from diff3ds.tasks.cameras.run_cameras import are_estimated
from diff3ds.tasks.views.edge_fit.refined_cameras import in_world, moves, save_refined
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.transforms import read_views, save_transforms


@pytest.fixture
def source(tmp_path):
    cameras = ds.orbit([0.0, 90.0, 180.0, 270.0], 20.0, 3.0, size=(24, 32))
    for i in range(4):
        Image.fromarray(np.full((24, 32, 3), 60 * i, np.uint8)).save(tmp_path / f"{i}.png")
    save_transforms(tmp_path / "transforms.json", cameras, [f"{i}.png" for i in range(4)])
    return tmp_path / "transforms.json", cameras


def turned(cameras, degrees):
    """The cameras turned about their own axes of sight."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = torch.tensor([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    return replace(cameras, world_to_camera=turn @ cameras.world_to_camera)


def moved(cameras, after, agreement, k1=0.0, lens=None):
    names, refined = ["a", "b", "c", "d"], Refined(after.world_to_camera, after.intrinsics, np.array(agreement), k1)
    return moves(Frame(torch.zeros(3, dtype=torch.float64), 1.0), cameras, after, names, refined, lens)


def test_moves_say_degrees_and_units(source):
    cameras = source[1]
    after = turned(cameras, 0.5)
    after.world_to_camera[1, 0, 3] += 0.25
    found = moved(cameras, after, [5.0, 5.0, 5.0, 5.0])
    about = found.about
    assert about["each"]["a"]["degrees"] == pytest.approx(0.5, abs=1e-3)
    assert about["each"]["b"]["units"] == pytest.approx(0.25, abs=1e-4)
    assert about["each"]["c"]["units"] == pytest.approx(0.0, abs=1e-5)
    assert about["units_most"] == pytest.approx(0.25, abs=1e-4)
    # A shift by .25 at a distance of 3, and a little of the turn.
    focal = float(cameras.intrinsics[0, 0, 0])
    assert about["each"]["b"]["pixels"] == pytest.approx(0.25 / 3 * focal, rel=0.1)
    assert found.right == [0, 1, 2, 3]


def test_distortion_is_said_in_pixels_at_the_corners(source):
    cameras = source[1]
    assert moved(cameras, cameras, [5.0] * 4).about["distortion"] is None
    kept = moved(cameras, cameras, [5.0] * 4, 0.0, Distortion())
    assert kept.about["distortion"] == {"k1": 0.0, "pixels_at_corners": 0.0}
    assert "distortion as given" in kept.lines[0]
    found = moved(cameras, cameras, [5.0] * 4, 0.1, Distortion())
    # A corner that was taken 20 pixels from the middle lies where r + .1 r^3 says so.
    focal = float(cameras.intrinsics[0, 0, 0])
    pixels = found.about["distortion"]["pixels_at_corners"]
    r = (20 - pixels) / focal
    assert focal * (r + 0.1 * r**3) == pytest.approx(20, abs=0.01)
    assert pixels > 0.2
    assert f"distortion k1 +0.1000, {pixels:.1f} pixels at the corners" in found.lines[0]
    assert found.lens == LensChange(1.0, 0.1)


def test_views_that_are_lost_or_moved_far_are_said(source):
    cameras = source[1]
    after = turned(cameras, 0.1)
    after.world_to_camera[1, 0, 3] += 0.5
    found = moved(cameras, after, [5.0, 6.0, 1.2, 7.0])
    assert found.right == [0, 1, 3]
    assert found.about["lost"] == ["c"]
    assert found.about["moved_far"] == ["b"]
    assert "1 of 4 views" in found.lines[1]
    assert found.lines[1].count(" c.") == 1
    assert "b (" in found.lines[2]
    # Where views hardly agree at all, or nothing is known, none is said to be lost.
    for agreement in ([1.2, 1.1, 0.5, 1.0], [math.nan] * 4):
        assert moved(cameras, after, agreement).right == [0, 1, 2, 3]


def test_the_frame_of_a_fit_and_back(source):
    cameras = source[1]
    frame = Frame(torch.tensor([0.3, -0.2, 0.1], dtype=torch.float64), 1.7)
    back = in_world(frame, frame.cameras(cameras), cameras)
    torch.testing.assert_close(back.world_to_camera, cameras.world_to_camera, atol=1e-5, rtol=0)


def test_written_cameras_are_read_from_another_folder(source, tmp_path):
    path, cameras = source
    content = json.loads(path.read_text())
    content["frames"][2] |= {"k1": 0.01}
    path.write_text(json.dumps(content))
    after = turned(cameras, 1.0)
    (tmp_path / "out").mkdir()
    save_refined(
        tmp_path / "out" / "transforms.json", path, "color-edges", [0, 2], after[[0, 2]], LensChange(1.1, -0.02)
    )
    views = read_views(tmp_path / "out" / "transforms.json")
    assert [view.picture.name for view in views] == ["0.png", "2.png"]
    assert all(view.picture.is_file() for view in views)
    torch.testing.assert_close(
        torch.stack([v.world_to_camera for v in views]).float(), after.world_to_camera[[0, 2]], atol=1e-5, rtol=0
    )
    focal = [float(v.intrinsics[0, 0]) for v in views]
    assert focal == pytest.approx([1.1 * float(cameras.intrinsics[0, 0, 0])] * 2, rel=1e-5)
    assert [view.distortion.radial[:1] for view in views] == [(-0.02,), (-0.01,)]


def test_the_option_is_said_to_be_unused_where_it_is(tmp_path):
    assert "--refine-cameras" in ViewsOptions(refine_cameras=True, start=tmp_path).unused("color")
    assert ViewsOptions(refine_cameras=True).unused("color") == []
    assert "--refine-cameras" in ViewsOptions(refine_cameras=True, init="random").unused("edges")
    assert ViewsOptions(refine_cameras=True).unused("edges") == []


def test_cameras_that_were_found_from_photographs_are_refined(tmp_path):
    """Unless strokes are given, or the user says no; those of others are refined if asked for."""
    assert ViewsOptions().refining("edges", estimated=True)
    assert ViewsOptions().refining("color-edges", estimated=True)
    assert not ViewsOptions().refining("color-edges", estimated=False)
    assert not ViewsOptions(keep_cameras=True).refining("edges", estimated=True)
    assert ViewsOptions().refining("color", estimated=True)
    assert not ViewsOptions(start=tmp_path).refining("color", estimated=True)
    assert not ViewsOptions(start=tmp_path).refining("edges", estimated=True)
    assert not ViewsOptions(init="random").refining("edges", estimated=True)
    assert ViewsOptions(refine_cameras=True).refining("edges", estimated=False)
    with pytest.raises(ValueError, match="--refine-cameras or --keep-cameras"):
        ViewsOptions(refine_cameras=True, keep_cameras=True)


def test_refined_cameras_keep_the_points(source, tmp_path):
    path, cameras = source
    (tmp_path / "out").mkdir()
    points = torch.rand(4, 3, dtype=torch.float64)
    out = tmp_path / "out" / "transforms_refined.json"
    save_refined(out, path, "color-edges", [0, 1, 2, 3], cameras, UNCHANGED, points)
    assert torch.equal(sparse_points(out), points)
    assert not are_estimated(out)
    assert not are_estimated(path)
    path.write_text(json.dumps({**json.loads(path.read_text()), "cameras_from_pictures": True}))
    assert are_estimated(path)


@pytest.mark.slow
def test_cameras_of_coloured_pictures_are_refined_before_their_colours_are_fitted(tmp_path, monkeypatch):
    ends = torch.tensor([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    pairs = [(a, b) for i, a in enumerate(ends) for b in ends[i + 1 :] if int((a != b).sum()) == 1]
    box = ds.Sketch(torch.stack([torch.stack([a, b]) for a, b in pairs]), width=0.03, color=(0.8, 0.2, 0.1))
    i = torch.arange(12) + 0.5
    cameras = ds.orbit(137.508 * i, torch.rad2deg(torch.asin(1 - i / 6)), 3.0, fov=45, size=96)
    drawn = ds.render(box, cameras, background=0.0)
    names = [f"{view}.png" for view in range(12)]
    for name, color, alpha in zip(names, drawn.color, drawn.alpha[..., None], strict=True):
        save_png(tmp_path / name, torch.cat([color / alpha.clamp(min=1e-6), alpha], -1))
    wrong = turned(cameras, 0.0)
    wrong.world_to_camera[3, 0, 3] += 0.1
    save_transforms(tmp_path / "transforms.json", wrong, names)
    options = ViewsOptions(target="color", refine_cameras=True, strokes=8, steps=1)
    run_views(tmp_path, tmp_path / "out", options)
    about = json.loads((tmp_path / "out" / "run.json").read_text())["cameras"]
    # It was off by four pixels, of which the others take some.
    off = {name: each["pixels"] for name, each in about["each"].items()}
    assert off.pop("3.png") > 2 * max(off.values())
    views = read_views(tmp_path / "out" / "transforms_refined.json")
    assert [view.picture.name for view in views] == names

    def again(*arguments):
        raise AssertionError("the cameras are refined already")

    monkeypatch.setattr("diff3ds.tasks.views.edge_fit.refined_views.refined_cameras", again)
    run_views(tmp_path, tmp_path / "out", replace(options, resume=True))
    assert json.loads((tmp_path / "out" / "run.json").read_text())["cameras"] == about


@pytest.mark.slow
def test_a_run_leaves_lost_views_out_and_keeps_refined_cameras(tmp_path, monkeypatch):
    """Of twelve drawings of a box one is of another thing."""
    ends = torch.tensor([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    pairs = [(a, b) for i, a in enumerate(ends) for b in ends[i + 1 :] if int((a != b).sum()) == 1]
    box = ds.Sketch(torch.stack([torch.stack([a, b]) for a, b in pairs]), width=0.015)
    other = ds.Sketch(1.2 * torch.rand(12, 2, 3, generator=torch.Generator().manual_seed(0)) - 0.6, width=0.015)
    i = torch.arange(12) + 0.5
    cameras = ds.orbit(137.508 * i, torch.rad2deg(torch.asin(1 - i / 6)), 3.0, fov=45, size=64)
    for view in range(12):
        ink = ds.render(other if view == 4 else box, cameras[[view]]).alpha[0]
        save_png(tmp_path / f"{view}.png", ink[..., None])
    save_transforms(tmp_path / "transforms.json", cameras, [f"{view}.png" for view in range(12)])
    said: list[str] = []
    options = ViewsOptions(refine_cameras=True)
    run_views(tmp_path, tmp_path / "out", options, say=said.append)
    about = json.loads((tmp_path / "out" / "run.json").read_text())["cameras"]
    assert about["lost"] == ["4.png"]
    assert any("1 of 12 views" in line and "4.png" in line for line in said)
    kept = [view.picture.name for view in read_views(tmp_path / "out" / "transforms_refined.json")]
    assert kept == [f"{view}.png" for view in range(12) if view != 4]
    sketch = (tmp_path / "out" / "sketch.json").read_bytes()

    def again(*arguments):
        raise AssertionError("the cameras are refined already")

    monkeypatch.setattr("diff3ds.tasks.views.edge_fit.refined_views.refined_cameras", again)
    run_views(tmp_path, tmp_path / "out", replace(options, resume=True), say=said.append)
    assert (tmp_path / "out" / "sketch.json").read_bytes() == sketch
    assert json.loads((tmp_path / "out" / "run.json").read_text())["cameras"] == about
