"""The recipe of 3Doodle with tiny networks: it descends, resumes, writes a run, and says what weights are missing."""

import dataclasses
import json

import pytest
import torch
from metrics.tiny_networks import features, resnet, save

import diff3ds as ds
from diff3ds.formats import save_png
from diff3ds.metrics import doodle_loss
from diff3ds.optimize.fit import fit
from diff3ds.pictures.dataset import load_posed
from diff3ds.tasks.views.color_fit.doodle import DOT, far_apart, load_doodle_loss, plan_doodle, run_doodle, without_dots
from diff3ds.tasks.views.views_options import DoodleOptions

VIEWS, SIZE = 12, 64


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    """VGG16 looks at small images here: at its own size a step takes seconds."""
    monkeypatch.setattr(doodle_loss, "VGG_SIZE", 32)


@pytest.fixture(scope="module")
def options(tmp_path_factory):
    """With tiny or random networks."""
    folder = tmp_path_factory.mktemp("networks")
    tower = save(folder / "rn.safetensors", resnet())
    vgg = save(folder / "vgg.safetensors", features("vgg"))
    return DoodleOptions(
        str(tower), str(vgg), strokes=8, steps=4, augmentations=1, size=SIZE, width=2.0, device="cpu", batch=2
    )


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """A red bar and a blue one from all around, on white."""
    folder = tmp_path_factory.mktemp("pictures")
    points = torch.tensor([[[-0.8, 0, -0.3], [0.8, 0, -0.3]], [[0.0, -0.8, 0.2], [0.0, 0.8, 0.4]]])
    color = torch.tensor([[0.9, 0.2, 0.1], [0.1, 0.3, 0.8]])
    bars = ds.Sketch(points, width=0.3, color=color, width_space="world")
    cameras = ds.orbit([360 * i / VIEWS for i in range(VIEWS)], [(-20.0, 0.0, 20.0)[i % 3] for i in range(VIEWS)], 3.0,
                       fov=45, size=SIZE)  # fmt: skip
    for i in range(VIEWS):
        save_png(folder / f"{i}.png", ds.render(bars, cameras[i]).color[0])
    ds.save_transforms(folder / "transforms.json", cameras, [f"{i}.png" for i in range(VIEWS)])
    return folder


def test_a_run_and_its_folder(options, pictures, tmp_path):
    reports = []
    sketch = run_doodle(pictures, tmp_path / "run", options, reports.append)
    assert len(sketch) == 8
    assert [r.done for r in reports] == [1, 2, 3, 4]
    found = json.loads((tmp_path / "run" / "run.json").read_text())
    assert found["options"]["recipe"] == "3doodle"
    assert found["options"]["clip_weight"] == 75
    assert set(found["scores"]) == {"clip_rn101", "vgg_3doodle"}
    assert -1 <= found["scores"]["clip_rn101"] <= 1
    assert torch.equal(ds.load(tmp_path / "run" / "sketch.json").points, sketch.points)
    for name in ("sketch.svg", "sketch.step", "preview.png"):
        assert (tmp_path / "run" / name).stat().st_size > 100
    with pytest.raises(ValueError, match="holds a run"):
        run_doodle(pictures, tmp_path / "run", options)


@pytest.mark.slow
def test_a_resumed_run_ends_as_one_that_never_stopped(options, pictures, tmp_path):
    def stop(progress):
        if progress.done == 2:
            raise RuntimeError("broken off")

    whole = run_doodle(pictures, tmp_path / "whole", options)
    with pytest.raises(RuntimeError, match="broken off"):
        run_doodle(pictures, tmp_path / "broken", options, stop)
    again = run_doodle(pictures, tmp_path / "broken", dataclasses.replace(options, resume=True))
    assert torch.equal(again.points, whole.points)
    with pytest.raises(ValueError, match="vgg_weight"):
        run_doodle(pictures, tmp_path / "broken", dataclasses.replace(options, resume=True, vgg_weight=2.0))


@pytest.mark.slow
def test_the_loss_falls(options, pictures):
    """By CLIP's term alone, through a random tower; from dots, which show nothing, to strokes that it likes better."""
    chosen = dataclasses.replace(options, vgg_weight=0.0, steps=25, rate=0.01, batch=VIEWS, augmentations=0)
    loss = load_doodle_loss(chosen)
    plan = plan_doodle(load_posed(pictures / "transforms.json", "color", SIZE), chosen, loss)
    losses = [step.loss for step in fit(plan.start, plan.objective, plan.pyramid.cameras, plan.config)]
    assert losses[-1] < 0.8 * losses[0]


def test_strokes_start_as_dots_on_the_object(options, pictures):
    loss = load_doodle_loss(options)
    plan = plan_doodle(load_posed(pictures / "transforms.json", "color", SIZE), options, loss)
    start = plan.frame.to_world(plan.start)
    # Three steps of at most .011 along each axis, in radii of the scene.
    assert float((start.points - start.points[:, :1]).abs().max()) <= 3 * 0.011 * plan.frame.radius + 1e-6
    # Within the hull of the bars: half as thick as they are, and the cells of the grid.
    for x, y, z in start.points[:, 0].tolist():
        along_x = abs(x) < 1.0 and abs(y) < 0.25 and abs(z + 0.3) < 0.25
        along_y = abs(y) < 1.0 and abs(x) < 0.25 and abs(z - 0.3) < 0.35
        assert along_x or along_y
    assert plan.config.final_rate == 1
    assert float(start.width[0]) == pytest.approx(2 / SIZE)
    assert float(start.color.abs().max()) == 0


def test_points_far_apart():
    """On a line of 0 to 8 from 0: the other end, the middle, the quarters."""
    points = torch.zeros(9, 3)
    points[:, 0] = torch.arange(9.0)
    seeds = (torch.Generator().manual_seed(s) for s in range(200))
    order = next(o for o in (far_apart(points, 5, g).tolist() for g in seeds) if o[0] == 0)
    assert order[:3] == [0, 8, 4]
    assert set(order[3:]) == {2, 6}
    # More strokes than points: some points come again, nothing breaks.
    assert len(far_apart(points[:2], 5, torch.Generator())) == 5


def test_dots_are_left_out():
    line = torch.tensor([[-1.0, 0, 0], [1.0, 0, 0]])
    sketch = ds.Sketch(torch.stack([line * (DOT / 2), line * (0.7 * DOT), line * (0.72 * DOT)]))
    # The norm of (-s, 0, 0) and (s, 0, 0) is s times the square root of 2.
    assert len(without_dots(sketch)) == 1
    assert torch.equal(without_dots(sketch).points[0], sketch.points[2])
    assert len(without_dots(sketch[:2])) == 1


def test_missing_weights_are_said_before_anything_is_written(options, pictures, tmp_path):
    for name, text, message in (
        (
            "clip_rn101",
            "timm/resnet101_clip.openai",
            r"hf download timm/resnet101_clip.openai open_clip_model.safetensors",
        ),
        ("vgg16", str(tmp_path / "none"), "VGG16: weights must be a folder or file that exists"),
        ("vgg16", options.clip_rn101, r"it lacks features.0.bias"),
        ("clip_rn101", options.vgg16, "not CLIP's ResNet by OpenAI's names"),
    ):
        with pytest.raises((FileNotFoundError, ValueError), match=message):
            run_doodle(pictures, tmp_path / "run", dataclasses.replace(options, **{name: text}))
        assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"steps": 0}, "steps must be positive"),
        ({"augmentations": -1}, "augmentations must not be negative"),
        ({"clip_weight": 0.0, "vgg_weight": 0.0}, "one of them positive"),
        ({"background": "plaid"}, "background must be"),
    ],
)
def test_bad_options_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        DoodleOptions(**change)
