"""What drawings must show before their edges are looked for, and what is measured of them."""

import pytest
import torch

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import save_png
from diff3ds.library.demo import demo_sketch
from diff3ds.pictures.content.line_width import line_width
from diff3ds.pictures.store import store_of
from diff3ds.tasks.views.edge_fit.edges_of_pictures import most_views
from diff3ds.tasks.views.views_options import ViewsOptions


def clouds_of(folder, count):
    """The folder with so many pictures of wide gray clouds: they show something, and no line."""
    cameras = ds.orbit([180.0 * k / count for k in range(count)], 20.0, 2.6, size=64)
    y, x = torch.meshgrid(torch.arange(64.0), torch.arange(64.0), indexing="ij")
    cloud = 1 - 0.9 * torch.exp(-((x - 32) ** 2 + (y - 32) ** 2) / 400)
    for k in range(count):
        save_png(folder / f"{k}.png", cloud[..., None])
    ds.save_transforms(folder / "transforms.json", cameras, [f"{k}.png" for k in range(count)])
    return folder


@pytest.fixture
def clouds(tmp_path):
    return clouds_of(tmp_path, 3)


def refused(folder, *options):
    with pytest.raises(SystemExit) as end:
        main(["views", str(folder), "-o", str(folder / "out"), "--target", "edges", *options])
    assert end.value.code == FAULT


@pytest.mark.parametrize("init", ["carve", "random"])
def test_drawings_without_lines_are_refused(clouds, capsys, init):
    refused(clouds, "--quiet", "--init", init, *(["--steps", "3", "--strokes", "4"] if init == "random" else []))
    assert "the views show no edges that agree" in capsys.readouterr().err


def test_options_that_change_nothing_are_named(clouds, capsys):
    refused(clouds, "--steps", "9", "--background", "white")
    assert "--background white, --steps 9: no effect with --target edges --init carve" in capsys.readouterr().err
    assert ViewsOptions(init="random", steps=9, batch=2).unused("edges") == []
    assert ViewsOptions(init="random", steps=9, background="white").unused("color") == ["--init random"]
    assert ViewsOptions(steps=9, batch=2).unused("color-edges") == ["--steps 9", "--batch 2"]


@pytest.mark.parametrize(("count", "said"), [(7, True), (8, False)])
def test_few_pictures_are_said_to_be_few(tmp_path, capsys, count, said):
    refused(clouds_of(tmp_path, count))
    assert (f"{count} pictures are few: lines are told from chance" in capsys.readouterr().err) == said


def test_the_width_of_lines_does_not_depend_on_threads():
    store = store_of(torch.rand(3, 200, 300, 1, generator=torch.Generator().manual_seed(0)))
    before = torch.get_num_threads()
    widths = []
    for count in (1, 2, 3):
        torch.set_num_threads(count)
        widths.append(line_width(store))
    torch.set_num_threads(before)
    assert len(set(widths)) == 1


def test_fewer_views_are_kept_of_large_pictures():
    assert most_views((512, 512)) == 200
    assert most_views((2160, 3840)) == 48
    assert most_views((65536, 65536)) == 3


@pytest.mark.parametrize("target", ["color", "color-edges"])
def test_the_demo_has_no_colours(target, tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["views", "--demo", "--target", target, "-o", str(tmp_path / "out")])
    assert stopped.value.code == FAULT
    assert "line drawings (--target edges): leave --target out" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("init", ["carve", "random"])
def test_edges_of_orthographic_views_are_refused_before_anything_is_fitted(init, tmp_path, capsys):
    cameras = ds.orbit([0.0, 40.0, 80.0, 120.0], 20.0, 3.0, height=2.0, size=32)
    names = [f"{i}.png" for i in range(4)]
    for name, image in zip(names, ds.render(demo_sketch(), cameras).color, strict=True):
        save_png(tmp_path / name, image)
    ds.save_transforms(tmp_path / "transforms.json", cameras, names)
    with pytest.raises(SystemExit) as stopped:
        main(["views", str(tmp_path), "--target", "edges", "--init", init, "-o", str(tmp_path / "out")])
    assert stopped.value.code == FAULT
    assert "views with perspective, and these are orthographic" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
