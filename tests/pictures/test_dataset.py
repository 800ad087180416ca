"""Posed pictures: found, told apart, read in either polarity."""

import json
import subprocess
import sys

import pytest
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.distortion import NO_DISTORTION, Distortion
from diff3ds.formats import save_png
from diff3ds.photogrammetry.find_project import find_project
from diff3ds.photogrammetry.lens_change import LensChange
from diff3ds.pictures.dataset import load_posed
from diff3ds.pictures.pyramid import build_pyramid
from diff3ds.pictures.reading import load_views


@pytest.fixture
def scene():
    cameras = ds.orbit([0, 90, 180], 20, 3.0, size=(40, 60))
    points = torch.tensor([[[-0.6, 0.0, 0.0], [0.0, 0.5, 0.4], [0.6, 0.0, 0.2]]])
    return ds.Sketch(points, width=0.08, color=(0.8, 0.2, 0.1)), cameras


def write(folder, cameras, images, name="transforms.json"):
    names = [f"{name}-{i}.png" for i in range(len(images))]
    for file, image in zip(names, images, strict=True):
        save_png(folder / file, image)
    ds.save_transforms(folder / name, cameras, names)
    return folder / name


@pytest.mark.parametrize("polarity", ["black on white", "white on black", "black on nothing", "white on nothing"])
def test_ink_of_every_polarity(scene, tmp_path, polarity):
    sketch, cameras = scene
    ink = ds.render(ds.Sketch(sketch.points, width=0.05), cameras).alpha
    gray = {"black on white": 1 - ink, "white on black": ink}.get(polarity)
    straight = torch.full((*ink.shape, 3), float(polarity == "white on nothing"))
    images = torch.cat([straight, ink[..., None]], -1) if gray is None else gray[..., None]
    pictures = load_posed(write(tmp_path, cameras, images))
    assert pictures.target == "edges"
    found = pictures.batch([0, 1, 2])
    torch.testing.assert_close(found.alpha, ink, rtol=0, atol=0.5 / 255 + 1e-6)
    torch.testing.assert_close(found.images, (1 - ink)[..., None].expand(-1, -1, -1, 3), rtol=0, atol=0.5 / 255 + 1e-6)


def test_paper_that_is_cut_out_is_no_ink(scene, tmp_path):
    """Black lines on white paper, with nothing around it: the paper is what is opaque, and the lines are the ink."""
    sketch, cameras = scene
    ink = ds.render(sketch, cameras).alpha
    paper = torch.zeros_like(ink)
    paper[:, 8:32, 20:40] = 1
    images = torch.stack([1 - ink] * 3 + [paper], -1)
    found = load_posed(write(tmp_path, cameras, images), "edges").batch([0, 1, 2])
    torch.testing.assert_close(found.alpha, ink * paper, rtol=0, atol=0.5 / 255 + 1e-6)


def test_colored_pictures_over_white(scene, tmp_path):
    sketch, cameras = scene
    seen = ds.render(sketch, cameras)
    straight = sketch.color[0].expand(*seen.alpha.shape, 3)
    pictures = load_posed(write(tmp_path, cameras, torch.cat([straight, seen.alpha[..., None]], -1)))
    assert pictures.target == "color"
    found = pictures.batch([0, 1, 2])
    torch.testing.assert_close(found.images, seen.color, rtol=0, atol=1.5 / 255)
    torch.testing.assert_close(found.alpha, seen.alpha, rtol=0, atol=0.5 / 255 + 1e-6)


def test_a_gray_photograph_is_no_drawing(generator, scene, tmp_path):
    _, cameras = scene
    found = load_posed(write(tmp_path, cameras, torch.rand(3, 40, 60, 1, generator=generator)))
    assert found.target == "color"


def test_the_target_given_wins(scene, tmp_path):
    sketch, cameras = scene
    path = write(tmp_path, cameras, ds.render(sketch, cameras).color)
    assert load_posed(path).target == "color"
    assert load_posed(path, "edges").target == "edges"


def test_large_pictures_are_reduced_with_their_cameras(scene, tmp_path):
    sketch, cameras = scene
    found = load_posed(write(tmp_path, cameras, ds.render(sketch, cameras).color), size=30)
    assert found.cameras.size == (20, 30)
    direct = ds.render(sketch, found.cameras).color
    # The mean of four pixels against one twice as large; the box filter of each is up to .086 off on diagonals.
    assert (found.batch([0, 1, 2]).images - direct).abs().max() < 2 * 0.086
    assert (found.batch([0, 1, 2]).images - direct).square().mean().sqrt() < 0.02


def test_which_file_of_a_folder(scene, tmp_path):
    sketch, cameras = scene
    images = ds.render(sketch, cameras).color
    with pytest.raises(FileNotFoundError, match=r"no file that says .* Found: no pictures either\. What would"):
        find_project(tmp_path, None)
    with pytest.raises(FileNotFoundError, match="no such file or folder"):
        find_project(tmp_path / "none", None)
    odd = write(tmp_path, cameras, images, "transforms_day.json")
    assert find_project(tmp_path, None) == odd
    write(tmp_path, cameras, images, "transforms_night.json")
    with pytest.raises(ValueError, match=r"which of transforms_day\.json, transforms_night\.json"):
        find_project(tmp_path, None)
    color = write(tmp_path, cameras, images, "transforms_color.json")
    edges = write(tmp_path, cameras, images, "transforms_edges.json")
    assert find_project(tmp_path, None) == edges
    assert find_project(tmp_path, "color") == color
    train = write(tmp_path, cameras, images, "transforms_train.json")
    assert find_project(tmp_path, None) == train
    assert find_project(odd, None) == odd


def test_pictures_must_have_the_cameras_shape(scene, tmp_path):
    sketch, cameras = scene
    path = write(tmp_path, cameras, ds.render(sketch, cameras.resize((24, 30))).color)
    with pytest.raises(ValueError, match=r"-0\.png: 24 x 30 .* the cameras say 40 x 60"):
        load_posed(path)


def test_smaller_copies_of_the_pictures_have_their_cameras_scaled(scene, tmp_path):
    """As where a folder of pictures was reduced after its cameras were found; 17 of 40 rows are 25.5 of 60 columns."""
    sketch, cameras = scene
    smaller = cameras.resize((17, 26))
    path = write(tmp_path, cameras, ds.render(sketch, smaller).color)
    with pytest.warns(UserWarning, match=r"not as large as the cameras say \(.*-0.png: 26 x 17 instead of 60 x 40"):
        pictures = load_posed(path)
    assert pictures.cameras.size == (17, 26)
    torch.testing.assert_close(pictures.cameras.intrinsics, smaller.intrinsics.double())


def test_pictures_of_any_size_share_a_canvas(scene, tmp_path):
    """One picture twice as large, one cut to its left third: cameras and pictures still agree."""
    sketch, cameras = scene
    seen = ds.render(sketch, cameras).color
    large = ds.render(sketch, cameras.resize((80, 120))).color[1]
    path = write(tmp_path, cameras, [seen[0], large, seen[2][:, :20]])
    content = json.loads(path.read_text())
    one = content["frames"][1]
    one.update({"w": 120, "h": 80, **{key: 2 * one[key] for key in ("fl_x", "fl_y", "cx", "cy")}})
    content["frames"][2].update({"w": 20, "h": 40})
    path.write_text(json.dumps(content))
    found = load_posed(path, size=60)
    assert found.cameras.size == (40, 60)
    torch.testing.assert_close(found.cameras.intrinsics, cameras.intrinsics.double())
    batch = found.batch([0, 1, 2])
    assert batch.known[:2].all()
    assert torch.equal(batch.known[2], (torch.arange(60) < 20).expand(40, 60))
    expected = torch.where(batch.known[2, ..., None], seen[2], torch.ones(()))
    torch.testing.assert_close(batch.images[2], expected, rtol=0, atol=0.6 / 255)
    # The mean of four pixels against one twice as large; the box filter of each is up to .086 off on diagonals.
    assert (batch.images[1] - seen[1]).abs().max() < 2 * 0.086


def test_memory_and_file_hold_the_same(scene, tmp_path, monkeypatch):
    sketch, cameras = scene
    path = write(tmp_path, cameras, ds.render(sketch, cameras).color)
    names = sorted(tmp_path.iterdir())
    memory = load_posed(path, scratch=tmp_path)
    monkeypatch.setattr(load_views, "MEMORY", 1000)
    file = load_posed(path, scratch=tmp_path / "not" / "yet")
    assert (memory.store.scratch, file.store.scratch) == (None, tmp_path)
    assert torch.equal(memory.store.pixels, file.store.pixels)
    levels = [build_pyramid(cameras, each.store, 4, 2, 0).levels[0].store.pixels for each in (memory, file)]
    assert torch.equal(*levels)
    assert sorted(tmp_path.iterdir()) == names


def test_missing_pictures_and_masks_are_named(scene, tmp_path):
    sketch, cameras = scene
    path = write(tmp_path, cameras, ds.render(sketch, cameras).color)
    content = json.loads(path.read_text())
    content["frames"][0]["mask_path"] = "mask.png"
    path.write_text(json.dumps(content))
    with pytest.raises(FileNotFoundError, match=r"1 of 1 masks are missing: .*mask\.png\. Paths"):
        load_posed(path)
    (tmp_path / "transforms.json-1.png").unlink()
    with pytest.raises(FileNotFoundError, match=r"1 of 3 pictures are missing: .*-1\.png\. Paths"):
        load_posed(path)


def test_views_without_pictures_are_left_out(scene, tmp_path):
    sketch, _ = scene
    cameras = ds.orbit([0, 90, 180, 270], 20, 3.0, size=(40, 60))
    path = write(tmp_path, cameras, ds.render(sketch, cameras).color)
    (tmp_path / "transforms.json-1.png").unlink()
    with pytest.warns(UserWarning, match=r"1 of 4 pictures are missing: .*-1\.png\. .* They are left out"):
        found = load_posed(path)
    expected = cameras[[0, 2, 3]].world_to_camera.double()
    torch.testing.assert_close(found.cameras.world_to_camera, expected, rtol=0, atol=1e-6)
    assert found.names == tuple(f"transforms.json-{i}.png" for i in (0, 2, 3))


@pytest.mark.parametrize("color", [0.0, 1.0, 0.5])
def test_pictures_that_show_nothing(scene, tmp_path, color):
    with pytest.raises(ValueError, match="the pictures show nothing: all pixels of all 3 have one colour"):
        load_posed(write(tmp_path, scene[1], torch.full((3, 40, 60, 3), color)))


def test_what_shows_nothing_says_why(scene, tmp_path):
    """All transparent; and numbers of 8 bits in files of 16."""
    with pytest.raises(ValueError, match="the pictures show nothing: all 3 are transparent everywhere"):
        load_posed(write(tmp_path, scene[1], torch.zeros(3, 40, 60, 4)), "color")
    path = write(tmp_path, scene[1], torch.zeros(3, 40, 60, 1))
    for i in range(3):
        gray = (255 * torch.rand(40, 60, generator=torch.Generator().manual_seed(i))).numpy().astype("uint16")
        Image.fromarray(gray).save(tmp_path / f"transforms.json-{i}.png")
    for target in (None, "color"):
        with pytest.raises(ValueError, match=r"but for 0\.004 of the range .* 8 bits saved as 16 bits"):
            load_posed(path, target)


def test_the_cameras_size_tells_whether_exif_turns(scene, tmp_path):
    """Cameras of the upright pictures, pixels stored on their side."""
    sketch, cameras = scene
    seen = ds.render(sketch, cameras).color
    path = write(tmp_path, cameras, seen)
    expected = load_posed(path).store.pixels
    for i, image in enumerate(seen):
        # Held with its right side down (6): viewers turn it clockwise.
        save_png(tmp_path / "side.png", image.rot90(1))
        with Image.open(tmp_path / "side.png") as picture:
            exif = picture.getexif()
            exif[0x0112] = 6
            picture.save(tmp_path / f"transforms.json-{i}.png", exif=exif)
    assert torch.equal(load_posed(path).store.pixels, expected)


@pytest.mark.parametrize("background", [0.0, 1.0])
def test_some_pictures_may_be_empty(scene, tmp_path, background):
    sketch, cameras = scene
    ink = ds.render(sketch, cameras).alpha
    ink[1] = 0
    found = load_posed(write(tmp_path, cameras, (background - ink).abs()[..., None]))
    assert found.target == "edges"
    torch.testing.assert_close(found.batch([0, 1, 2]).alpha, ink, rtol=0, atol=0.6 / 255)


@pytest.mark.parametrize("background", [0.0, 1.0])
def test_masks_hide_in_drawings_of_either_polarity(scene, tmp_path, background):
    sketch, cameras = scene
    ink = ds.render(sketch, cameras).alpha
    path = write(tmp_path, cameras, (background - ink).abs()[..., None])
    mask = torch.zeros(40, 60, 1)
    mask[:, 30:] = 1
    save_png(tmp_path / "mask.png", mask)
    content = json.loads(path.read_text())
    for frame in content["frames"]:
        frame["mask_path"] = "mask.png"
    path.write_text(json.dumps(content))
    torch.testing.assert_close(
        load_posed(path, masks="object").batch([0, 1, 2]).alpha, ink * mask[..., 0], rtol=0, atol=0.6 / 255
    )


def test_edges_of_coloured_pictures_need_the_colours(scene, tmp_path):
    sketch, cameras = scene
    path = write(tmp_path, cameras, ds.render(sketch, cameras).color)
    found = load_posed(path, "color-edges")
    assert found.target == "color-edges"
    assert torch.equal(found.store.pixels, load_posed(path, "color").store.pixels)


MEASURED = """
import resource, sys
from pathlib import Path
from diff3ds.pictures.dataset import load_posed
from diff3ds.pictures.pyramid import build_pyramid
pictures = load_posed(Path(sys.argv[1]), "color")
pyramid = build_pyramid(pictures.cameras, pictures.store, 4, 2, 0)
assert pyramid.targets(3).images.shape == (2, 512, 512, 3)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024))
"""


@pytest.mark.slow
def test_memory_of_a_view(tmp_path):
    """A coloured view of 512 x 512 takes four bytes a pixel, its pyramid a third of that, and nothing else grows."""
    save_png(tmp_path / "a.png", torch.rand(512, 512, 4, generator=torch.Generator().manual_seed(0)))
    peaks = []
    for views in (40, 140):
        cameras = ds.orbit([3.0 * i for i in range(views)], 20, 3.0, size=512)
        ds.save_transforms(tmp_path / "transforms.json", cameras, ["a.png"] * views)
        command = [sys.executable, "-c", MEASURED, str(tmp_path / "transforms.json")]
        peaks.append(int(subprocess.run(command, capture_output=True, text=True, check=True).stdout))
    # The tenth is for the allocator; float32 would take four times as much.
    assert peaks[1] - peaks[0] < 1.1 * 100 * 512 * 512 * 4 * 4 / 3


def test_pictures_are_read_again_with_another_lens(scene, tmp_path):
    """As if the file had said so, in another size and with masks as before."""
    sketch, cameras = scene
    path = write(tmp_path, cameras, ds.render(sketch, cameras).color)
    content = json.loads(path.read_text())
    content["frames"] = [{**frame, "k1": 0.1, "k2": 0.02} for frame in content["frames"]]
    path.write_text(json.dumps(content))
    found = load_posed(path, size=30)
    assert found.lens == Distortion((0.1, 0.02))
    again = found.again(LensChange(1.1, -0.25))
    for frame in content["frames"]:
        frame |= {"k1": -0.15, "fl_x": 1.1 * frame["fl_x"], "fl_y": 1.1 * frame["fl_y"]}
    path.write_text(json.dumps(content))
    said = load_posed(path, size=30)
    assert torch.equal(again.store.pixels, said.store.pixels)
    assert torch.equal(again.store.known, said.store.known)
    assert not torch.equal(again.store.pixels, found.store.pixels)
    torch.testing.assert_close(again.cameras.intrinsics, said.cameras.intrinsics)


@pytest.mark.parametrize("change", [{"k1": 0.2}, {"fl_x": 61.0}, {"w": 61, "cx": 30.0}])
def test_pictures_of_several_lenses_have_none_in_common(scene, tmp_path, change):
    sketch, cameras = scene
    path = write(tmp_path, cameras, ds.render(sketch, cameras).color)
    assert load_posed(path).lens == NO_DISTORTION
    content = json.loads(path.read_text())
    content["frames"][1] |= change
    if "w" in change:
        save_png(tmp_path / content["frames"][1]["file_path"], torch.zeros(40, 61, 3))
    path.write_text(json.dumps(content))
    assert load_posed(path, "color").lens is None
