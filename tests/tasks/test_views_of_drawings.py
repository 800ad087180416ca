"""`diff3ds views` on line drawings: stopped, resumed, overwritten, and found by random curves."""

import json
import shutil

import pytest
import torch
from views_runs import EDGE_FILES, FILES, assert_resumed_ends_as_unbroken, distances, has_something

import diff3ds as ds
from diff3ds.cli import FAULT, STOPPED, main
from diff3ds.formats import load_image, save_png
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions

# Two lines that meet, and a circle.
ENDS = torch.tensor([[[-0.6, -0.5, -0.4], [0.6, -0.4, -0.5]], [[0.6, -0.4, -0.5], [0.5, 0.6, 0.3]]])


def drawn_around(folder):
    """Line drawings in a folder, seen from all around: (the folder, their sketch)."""
    circle = ds.Sketch(*ds.bezier.circle((-0.2, 0.1, 0.4), 0.4, (0, 0.3, 1), dtype=torch.float32))
    sketch = ds.Sketch.concatenate([ds.Sketch(ENDS), circle])
    cameras = ds.orbit(list(range(0, 360, 18)), [(-20.0, 10.0, 45.0)[i % 3] for i in range(20)], 2.6, fov=45, size=96)
    pictures = [f"{i}.png" for i in range(20)]
    thick = ds.Sketch(sketch.points, sketch.weights, width=2 / 96)
    for picture, image in zip(pictures, ds.render(thick, cameras).color, strict=True):
        save_png(folder / picture, image)
    ds.save_transforms(folder / "transforms.json", cameras, pictures)
    return folder, sketch


@pytest.fixture
def drawings(tmp_path):
    """Line drawings on disk, and their sketch."""
    return drawn_around(tmp_path)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run of the drawings that has ended: its folder, to be copied."""
    folder, _ = drawn_around(tmp_path_factory.mktemp("finished"))
    main(["views", str(folder), "-o", str(folder / "out"), "--quiet"])
    return folder / "out"


@pytest.mark.slow
def test_drawings_stopped_and_resumed(drawings):
    folder, truth = drawings
    assert_resumed_ends_as_unbroken(folder, [str(folder), "--quiet"], EDGE_FILES)
    found = ds.load(folder / "whole" / "sketch.json")
    # Two lines, and the circle.
    assert found.chains.counts.sort().values.tolist() == [1, 1, 2]
    assert distances(truth, found).max() < 0.02
    assert distances(found, truth).max() < 0.02
    # A finished run has nothing left to do, and other settings are another run.
    main(["views", str(folder), "-o", str(folder / "whole"), "--resume", "--quiet"])
    done = [json.loads((folder / name / "run.json").read_text())["steps_done"] for name in ("broken", "whole")]
    assert done[0] == done[1] > 0
    assert (folder / "broken" / "sketch.json").read_bytes() == (folder / "whole" / "sketch.json").read_bytes()


STAGES = ["refined", "bridged", "with_pockets"]


def test_ctrl_c_in_a_stage_leaves_what_was_reached_before(drawings, monkeypatch):
    """One run, stopped before its first curves and in one stage after the other: no resumed run begins anew."""

    def stopped(*arguments):
        raise KeyboardInterrupt

    def stops_in(stage: str) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(f"diff3ds.edges.{stage}", stopped)
            with pytest.raises(SystemExit) as end:
                main(command)
        assert end.value.code == STOPPED

    folder, _ = drawings
    command = ["views", str(folder), "-o", str(folder / "out"), "--quiet"]
    stops_in("first_curves.triangulate")
    assert [p.name for p in (folder / "out").iterdir()] == ["edges.safetensors"]
    command.append("--resume")
    for stage in STAGES:
        stops_in(f"reconstruct.{stage}")
        about = json.loads((folder / "out" / "run.json").read_text())
        assert about["stopped_early"]
        # What is carved stays so.
        assert ("carve" in about["stages"]) == (stage == STAGES[0])
        assert len(ds.load(folder / "out" / "sketch.json")) >= 3
        monkeypatch.setattr("diff3ds.edges.first_curves.carve", stopped)
        # Which carves what the curves leave.
        monkeypatch.setattr(
            "diff3ds.edges.reconstruct.second_look", lambda scene, curves: curves[torch.zeros(len(curves)) > 0]
        )
    main(command)
    about = json.loads((folder / "out" / "run.json").read_text())
    assert not about["stopped_early"]
    assert "carve" not in about["stages"]
    assert len(ds.load(folder / "out" / "sketch.json")) == 3


def test_resume_refuses_another_run(drawings, finished, capsys):
    folder, _ = drawings
    shutil.copytree(finished, folder / "out")
    before = (folder / "out" / "sketch.json").read_bytes()
    with pytest.raises(SystemExit) as stopped:
        main(["views", str(folder), "-o", str(folder / "out"), "--resume", "--seed", "5"])
    assert stopped.value.code == FAULT
    assert "had --seed=0, not 5" in capsys.readouterr().err
    assert (folder / "out" / "sketch.json").read_bytes() == before


def test_the_most_important_strokes_come_first_and_others_can_be_left_out(drawings, finished, capsys):
    """The circle, whose line is the longest, and of it as much is in the drawings."""
    folder, _ = drawings
    found = ds.load(finished)
    assert found.chains.counts.tolist() == [2, 1, 1]
    assert found.importance[0] > 0.45
    assert bool((found.importance[1:] <= found.importance[:-1]).all())
    shutil.copytree(finished, folder / "out")
    main(["views", str(folder), "-o", str(folder / "out"), "--resume", "--strokes", "1"])
    few = ds.load(folder / "out")
    assert torch.equal(few.points, found[0].points)
    assert "1 of 3 strokes are kept, the most important ones" in capsys.readouterr().err


def test_a_run_is_not_overwritten_unasked(drawings, finished, capsys):
    """Neither one that ended, nor one that was killed and left its checkpoint alone, of edges or of colours."""
    folder, _ = drawings
    command = ["views", str(folder), "-o", str(folder / "out"), "--quiet"]
    shutil.copytree(finished, folder / "out")
    before = {path.name: path.read_bytes() for path in (folder / "out").iterdir()}
    for left in ("run.json", "edges.safetensors", "checkpoint.safetensors"):
        held = folder / f"only {left}"
        held.mkdir()
        (held / left).write_bytes(b"of another run")
        with pytest.raises(SystemExit) as stopped:
            main([*command[:3], str(held), "--quiet"])
        assert stopped.value.code == FAULT
        assert "holds a run: give another folder (-o), --resume to go on, or --overwrite" in capsys.readouterr().err
        assert [path.read_bytes() for path in held.iterdir()] == [b"of another run"]
    (folder / "out" / "sketch.json").write_bytes(b"of another run")
    main([*command, "--overwrite"])
    assert (folder / "out" / "sketch.json").read_bytes() == before["sketch.json"]


def test_what_an_overwritten_run_has_left_is_no_checkpoint(drawings, finished, capsys):
    """A new run that is killed before its first curves has none; and that of other pictures is refused."""
    folder, _ = drawings
    command = ["views", str(folder), "-o", str(folder / "out"), "--quiet"]
    shutil.copytree(finished, folder / "out")
    old = (folder / "out" / "edges.safetensors").read_bytes()
    options = ViewsOptions(overwrite=True)

    def killed(progress):
        # Until the pictures are read they may be at fault, and the old run stays.
        if progress.stage != "read":
            raise RuntimeError("killed")

    with pytest.raises(RuntimeError, match="killed"):
        run_views(folder, folder / "out", options, killed)
    assert not has_something(folder / "out" / "edges.safetensors")
    (folder / "out" / "edges.safetensors").write_bytes(old)
    save_png(folder / "3.png", load_image(folder / "3.png").flip(0))
    with pytest.raises(SystemExit):
        main([*command, "--resume"])
    assert "the run to resume had pictures=" in capsys.readouterr().err


@pytest.mark.slow
def test_random_curves_find_the_drawing(drawings):
    folder, truth = drawings
    options = ["--init", "random", "--strokes", "24", "--steps", "300", "--quiet"]
    main(["views", str(folder), "-o", str(folder / "out"), *options])
    assert sorted(p.name for p in (folder / "out").iterdir()) == sorted([*FILES, *EDGE_FILES[:1]])
    run = json.loads((folder / "out" / "run.json").read_text())
    assert run["steps"] == 300
    assert run["strokes"] == 24
    # The gradient steps, then those of two refinements.
    assert run["steps_done"] > 300
    found = ds.load(folder / "out" / "sketch.json")
    assert (distances(truth, found) < 0.03).float().mean() > 0.9
    assert (distances(found, truth) < 0.03).float().mean() > 0.9
    with pytest.raises(SystemExit):
        main(["views", str(folder), "-o", str(folder / "out"), *options, "--resume", "--strokes", "25"])


def test_ctrl_c_before_random_curves_are_cleaned_up_leaves_them(drawings, monkeypatch):
    def stopped(*arguments, **options):
        raise KeyboardInterrupt

    folder, _ = drawings
    monkeypatch.setattr("diff3ds.tasks.views.edge_fit.edge_sketch.reconstruct", stopped)
    options = ["--init", "random", "--strokes", "5", "--steps", "3", "--quiet"]
    with pytest.raises(SystemExit) as end:
        main(["views", str(folder), "-o", str(folder / "out"), *options])
    assert end.value.code == STOPPED
    assert len(ds.load(folder / "out" / "sketch.json")) > 0
    assert json.loads((folder / "out" / "run.json").read_text())["steps_done"] == 3
