"""`diff3ds text` of several things: the folder of the run, Ctrl-C and going on."""

import json
from dataclasses import replace

import pytest
import torch

from diff3ds import load, load_surface
from diff3ds.tasks.progress import Stopped
from diff3ds.tasks.text_image.prior_options import PriorOptions
from diff3ds.tasks.text_image.run_spec import CameraOptions, DescentOptions, OutputOptions, RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text import run_text

PHRASE = "an old table with a mug on it and two chiars"


def spec(phrase: str = PHRASE, prior: str = "exemplar", **output) -> RunSpec[Phrase]:
    descent = DescentOptions(steps=3, redraw=False)
    options = OutputOptions(sheet_every=0, **output)
    return RunSpec(Phrase(phrase), PriorOptions(prior), cameras=CameraOptions(size=32), descent=descent, output=options)


@pytest.mark.usefixtures("few_members")
def test_each_thing_is_a_run_and_they_are_placed(tmp_path) -> None:
    said: list[str] = []
    sketch = run_text(spec(), tmp_path / "run", say=said.append)
    things = sorted(path.name for path in (tmp_path / "run/things").iterdir())
    assert things == ["1_table", "2_mug", "3_chair"]
    table, mug, chair = (load(tmp_path / "run/things" / name / "sketch.json") for name in things)
    assert len(sketch) == len(table) + len(mug) + 2 * len(chair)
    # Placed, never bent: the two chairs face their table from both sides, half a turn and a shift apart, so that
    # each of their strokes has a twin.
    shapes = sketch.points - sketch.points[:, :1]
    turned = (shapes * torch.tensor([-1.0, -1.0, 1.0])).flatten(1)
    apart = torch.cdist(shapes.flatten(1), turned, compute_mode="donot_use_mm_for_euclid_dist").fill_diagonal_(1)
    assert (apart.amin(1) < 1e-5).sum() == 2 * len(chair)
    assert "'chiars' is taken for 'chairs'" in said
    assert "'old' changes nothing: lines do not show it" in said
    info = json.loads((tmp_path / "run/run.json").read_text())
    assert info["options"]["phrase"] == PHRASE
    assert len(info["things"]) == 3
    assert torch.equal(load(tmp_path / "run/sketch.json").points, sketch.points)
    # What is not drawn again as a member has no surface.
    assert not (tmp_path / "run/surface.glb").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("few_members")
def test_what_is_drawn_again_as_members_has_their_surface(tmp_path) -> None:
    """Boxes have corners where their strokes end, in the scene as in the things; a run over it leaves none."""
    drawn_again = replace(spec("a present on a house"), descent=DescentOptions(steps=30))
    sketch = run_text(drawn_again, tmp_path / "run")
    for folder in (tmp_path / "run", *(tmp_path / "run/things").iterdir()):
        surface, ends = load_surface(folder / "surface.glb"), load(folder / "sketch.json").points[:, [0, 3]]
        away = torch.cdist(torch.from_numpy(surface.vertices).float(), ends.reshape(-1, 3)).amin(1)
        assert float(away.median()) < 1e-3
    assert float(sketch.points.norm(dim=-1).max()) < 1
    run_text(replace(spec("a house"), output=OutputOptions(sheet_every=0, overwrite=True)), tmp_path / "run")
    assert not (tmp_path / "run/surface.glb").exists()


@pytest.mark.slow
def test_a_stopped_scene_is_usable_and_goes_on_to_the_same(tmp_path) -> None:
    whole = run_text(spec(), tmp_path / "whole")

    def stop(progress) -> None:
        if progress.stage.startswith("a mug") and progress.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(Stopped):
        run_text(spec(), tmp_path / "run", report=stop)
    info = json.loads((tmp_path / "run/run.json").read_text())
    assert info["stopped_early"]
    assert 0 < len(load(tmp_path / "run/sketch.json")) < len(whole)
    with pytest.raises(ValueError, match="holds a run: give another folder"):
        run_text(spec(), tmp_path / "run")
    with pytest.raises(ValueError, match="a run of another phrase"):
        run_text(spec("a chair and a table", resume=True), tmp_path / "run")
    again = run_text(spec(resume=True), tmp_path / "run")
    assert torch.equal(again.points, whole.points)
    alone = run_text(spec("a chair", overwrite=True), tmp_path / "run")
    assert not (tmp_path / "run/things").exists()
    assert len(alone) < len(whole)


@pytest.mark.slow
def test_the_small_network_draws_scenes_too(tmp_path) -> None:
    sketch = run_text(spec("a mug on a table", prior="small"), tmp_path / "run")
    assert len(sketch)
    assert (tmp_path / "run/things/2_table/sketch.json").exists()
