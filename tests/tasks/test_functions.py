"""The commands as functions: the same sketches, nothing written without a folder, options by the commands' names."""

import json
import logging

import pytest
import torch

import diff3ds as ds
from diff3ds.formats import save_png

QUICK = {"prior": "exemplar", "steps": 2, "strokes": 4, "size": 32, "redraw": False, "sheet_every": 0}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder that is the current one, with one for temporary files beside it."""
    (tmp_path / "here").mkdir()
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path


def nothing_is_left(here) -> bool:
    return not any((*(here / "here").iterdir(), *(here / "temporary").iterdir()))


@pytest.mark.usefixtures("few_members")
def test_a_phrase(here, capfd, caplog):
    caplog.set_level(logging.INFO, "diff3ds")
    sketch = ds.text_to_sketch("a big mug", seed=3, **QUICK)
    assert nothing_is_left(here)
    assert capfd.readouterr() == ("", "")
    assert "'big' changes nothing" in caplog.text
    again = ds.text_to_sketch("a big mug", here / "out", seed=3, **QUICK)
    assert torch.equal(sketch.points, again.points)
    assert torch.equal(ds.load(here / "out" / "sketch.json").points, again.points)
    assert json.loads((here / "out" / "run.json").read_text())["options"]["seed"] == 3


@pytest.mark.usefixtures("few_members")
def test_a_picture(here):
    mug = ds.library.member("mug", torch.Generator().manual_seed(0)).sketch
    picture = here / "mug.png"
    save_png(picture, ds.render(mug, ds.orbit(30, 15, 2.0, fov=60, size=128)).color[0])
    sketch = ds.image_to_sketch(str(picture), shows="a mug", **QUICK)
    assert isinstance(sketch, ds.Sketch)
    assert nothing_is_left(here)


def test_views(here):
    """Green pictures become green strokes, as options and files say."""
    cameras = ds.orbit([0, 60, 120, 180, 240, 300], 20, 2.0, fov=60, size=32)
    points = torch.rand(3, 4, 3, generator=torch.Generator().manual_seed(0)) - 0.5
    green = ds.Sketch(points, width=0.2, color=(0.0, 0.6, 0.0))
    names = [f"{view}.png" for view in range(len(cameras))]
    for name, image in zip(names, ds.render(green, cameras).color, strict=True):
        save_png(here / name, image)
    ds.save_transforms(here / "transforms.json", cameras, names)
    sketch = ds.views_to_sketch(here, target="color", background="white", strokes=5, steps=2)
    assert 1 <= len(sketch) <= 5
    assert (sketch.color[:, 1] > sketch.color[:, 0] + 0.2).all()
    assert nothing_is_left(here)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stroke": 4}, r"text_to_sketch has no option 'stroke'; it has allow_pickle, .*, strokes, "),
        ({"strokes": "many"}, "strokes must be a whole number or None, got 'many'"),
        ({"strokes": True}, "strokes must be a whole number or None, got True"),
        ({"method": "dream"}, "method must be one of sds, .* or None, got 'dream'"),
        ({"distance": 2.0}, r"distance must be a tuple \(2: a number\), got 2.0"),
        ({"optimize": ["position", "colour"]}, r"optimize must be a tuple \(several of: one of position, "),
        ({"redraw": 1}, "redraw must be True or False, got 1"),
        ({"library": 3}, "library must be a path or None, got 3"),
    ],
)
def test_wrong_options_are_named(options, message, here):
    with pytest.raises(TypeError, match=message):
        ds.text_to_sketch("a mug", **options)
    assert nothing_is_left(here)


def test_wrong_values_are_named_before_anything_is_written(here):
    with pytest.raises(ValueError, match="steps must be positive, got 0"):
        ds.views_to_sketch(None, "out", steps=0)
    with pytest.raises(ValueError, match="resume is for the run in a folder: give out as well"):
        ds.text_to_sketch("a mug", resume=True)
    assert nothing_is_left(here)
