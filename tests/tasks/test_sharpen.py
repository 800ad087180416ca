"""The end of a run with the built-in prior: strokes find the lines of finer pictures."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.bezier import evaluate
from diff3ds.cli import STOPPED, main
from diff3ds.formats import load_image
from diff3ds.library import member
from diff3ds.tasks.text_image import sharpen
from diff3ds.tasks.text_image.reference_view import Reference
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.sharpen import Sharpening, likely
from diff3ds.tasks.text_image.subject import Phrase

PLAIN = RunSpec(Phrase("a house"))


def drawn(name: str, seed: int = 0, width: float = 0.05) -> ds.Sketch:
    sketch = member(name, torch.Generator().manual_seed(seed)).sketch
    return replace(sketch, width=torch.full_like(sketch.width, width))


def away(sketch: ds.Sketch, truth: ds.Sketch) -> float:
    """Mean distance both ways between points on the strokes."""
    found, wanted = (evaluate(s.points, s.weights, torch.linspace(0, 1, 65)).reshape(-1, 3) for s in (sketch, truth))
    there, back = cKDTree(wanted).query(found)[0], cKDTree(found).query(wanted)[0]
    return float(there.mean() + back.mean()) / 2


def shaken(sketch: ds.Sketch, amount: float) -> ds.Sketch:
    moved = amount * torch.randn(sketch.points.shape, generator=torch.Generator().manual_seed(1))
    return replace(sketch, points=sketch.points + moved)


def test_the_members_that_look_most_like_it_are_followed():
    members = [drawn("chair", seed) for seed in range(5)]
    assert likely(shaken(members[3], 0.005), members, 1)[0] is members[3]
    assert len(likely(members[0], members)) == sharpen.LIKELY
    assert len(likely(members[0], members[:2])) == 2


def test_strokes_find_their_lines():
    truth = drawn("house")
    start = shaken(truth, 0.03)
    last = list(Sharpening([truth, drawn("house", 1)]).steps(start, PLAIN))[-1].sketch
    assert away(last, truth) < 0.35 * away(start, truth)
    assert torch.allclose(last.width, torch.tensor(sharpen.WIDTH))


@pytest.mark.slow
def test_a_reference_is_followed_too():
    """A picture that shows another house from the front: a strong weight pulls the sketch away from the members."""
    truth, other = drawn("house"), drawn("house", 7, sharpen.WIDTH)
    camera = ds.orbit(0.0, 10.0, 1.9, size=sharpen.SIZE)
    picture = ds.render(other, camera).color[0]

    def difference(weight: float) -> float:
        following = Sharpening([truth], Reference(picture, camera, weight) if weight else None)
        last = list(following.steps(truth, PLAIN))[-1].sketch
        return float((ds.render(last, camera).color[0] - picture).square().mean())

    assert difference(3e5) < 0.5 * difference(0.0)


@pytest.mark.parametrize(
    ("given", "sharpens"),
    [
        ({}, True),
        ({"optimize": ("position", "color")}, True),
        ({"sharpen": False}, False),
        ({"width": 0.05}, False),
        ({"optimize": ("position", "width")}, False),
        ({"optimize": ("color",)}, False),
    ],
)
def test_widths_that_the_user_chose_and_positions_that_stay_are_left_alone(given, sharpens):
    assert with_options(PLAIN, **given).sharpens is sharpens


def command(out, *more: str) -> list[str]:
    few = ["--steps", "4", "--strokes", "8", "--sheet-every", "0", "--quiet"]
    return ["text", "a mug", "--prior", "exemplar", "-o", str(out), *few, *more]


def test_a_stop_in_the_last_steps_is_resumed_to_the_same_sketch(tmp_path, monkeypatch):
    monkeypatch.setattr(sharpen, "STEPS", 5)
    whole, part, without = tmp_path / "whole", tmp_path / "part", tmp_path / "without"
    main(command(whole))
    assert "sharpen" in json.loads((whole / "run.json").read_text())["seconds"]
    steps = Sharpening.steps

    def stops(self, sketch, options):
        for step in steps(self, sketch, options):
            if step.index == 2:
                raise KeyboardInterrupt
            yield step

    with monkeypatch.context() as patch:
        patch.setattr(Sharpening, "steps", stops)
        with pytest.raises(SystemExit) as ended:
            main(command(part))
    assert ended.value.code == STOPPED
    assert json.loads((part / "run.json").read_text())["stopped_early"]
    assert load_image(part / "preview.png").shape[-1] == 3
    assert (part / "sketch.json").read_bytes() != (whole / "sketch.json").read_bytes()
    main(command(part, "--resume"))
    assert (part / "sketch.json").read_bytes() == (whole / "sketch.json").read_bytes()
    main(command(without, "--no-sharpen"))
    assert "sharpen" not in json.loads((without / "run.json").read_text())["seconds"]
    assert not np.array_equal(ds.load(without / "sketch.json").points, ds.load(whole / "sketch.json").points)


def test_a_stop_before_the_first_of_the_last_steps_keeps_the_sketch_so_far(tmp_path, monkeypatch):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(sharpen, "likely", interrupt)
    with pytest.raises(SystemExit) as ended:
        main(command(tmp_path / "run"))
    assert ended.value.code == STOPPED
    run = json.loads((tmp_path / "run" / "run.json").read_text())
    assert (run["steps_done"], run["stopped_early"]) == (4, True)
