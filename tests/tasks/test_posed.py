"""Posed pictures: found, told apart, read in either polarity."""

import pytest
import torch

import diff3ds as ds
from diff3ds.formats import save_png
from diff3ds.tasks.posed import find_transforms, load_posed


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


@pytest.mark.parametrize("polarity", ["black on white", "white on black", "transparent"])
def test_ink_of_every_polarity(scene, tmp_path, polarity):
    sketch, cameras = scene
    ink = ds.render(sketch, cameras).alpha
    gray = {"black on white": 1 - ink, "white on black": ink}.get(polarity)
    images = torch.cat([torch.zeros(*ink.shape, 3), ink[..., None]], -1) if gray is None else gray[..., None]
    pictures = load_posed(write(tmp_path, cameras, images))
    assert pictures.target == "edges"
    found = pictures.batch([0, 1, 2])
    torch.testing.assert_close(found.alpha, ink, rtol=0, atol=0.5 / 255 + 1e-6)
    torch.testing.assert_close(found.images, (1 - ink)[..., None].expand(-1, -1, -1, 3), rtol=0, atol=0.5 / 255 + 1e-6)


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
    with pytest.raises(FileNotFoundError, match=r"no transforms\.json in this folder"):
        find_transforms(tmp_path, None)
    with pytest.raises(FileNotFoundError, match="no such file or folder"):
        find_transforms(tmp_path / "none", None)
    odd = write(tmp_path, cameras, images, "transforms_day.json")
    assert find_transforms(tmp_path, None) == odd
    write(tmp_path, cameras, images, "transforms_night.json")
    with pytest.raises(ValueError, match=r"which of transforms_day\.json, transforms_night\.json"):
        find_transforms(tmp_path, None)
    color = write(tmp_path, cameras, images, "transforms_color.json")
    edges = write(tmp_path, cameras, images, "transforms_edges.json")
    assert find_transforms(tmp_path, None) == edges
    assert find_transforms(tmp_path, "color") == color
    train = write(tmp_path, cameras, images, "transforms_train.json")
    assert find_transforms(tmp_path, None) == train
    assert find_transforms(odd, None) == odd


def test_pictures_must_have_the_cameras_size(scene, tmp_path):
    sketch, cameras = scene
    path = write(tmp_path, cameras, ds.render(sketch, cameras.resize((20, 30))).color)
    with pytest.raises(ValueError, match=r"-0\.png: 20 x 30 .* the cameras say 40 x 60"):
        load_posed(path)
