"""`diff3ds eval` of posed pictures: true curves by EMAP's protocol, scores of held-out pictures, and what is no run."""

import csv
import json
import math

import pytest
import torch
from metrics.test_hed_distance import two_channels

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.formats import load_image, save_png
from diff3ds.library.demo import demo_sketch
from diff3ds.metrics.hed_distance import HedDistance
from diff3ds.tasks.evaluate.evaluate import evaluate
from diff3ds.tasks.evaluate.evaluate_options import JudgeOptions
from diff3ds.tasks.evaluate.runs import find_runs
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions

# The outline of a square of side 1.
CORNERS = [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [1.0, 1.0, 0.5], [0.0, 1.0, 0.5]]
SQUARE = [[CORNERS[k], CORNERS[(k + 1) % 4]] for k in range(4)]


def truth_in(scene, sides=SQUARE, **more):
    scene.mkdir(parents=True)
    (scene / "ground_truth.json").write_text(json.dumps({"curves": [{"points": side} for side in sides], **more}))
    return scene


def run_in(folder, lines, source, **more):
    """What `diff3ds views` leaves, as far as it matters here."""
    points = torch.tensor(lines, dtype=torch.float32).reshape(-1, 2, 3)
    ds.save(folder / "sketch.json", ds.Sketch(points, width=0.01))
    record = {"options": {"source": str(source)}, "target": "edges", "scores": {}, **more}
    (folder / "run.json").write_text(json.dumps(record))
    return folder


def above(lines, height):
    return [[[x, y, z + height] for x, y, z in line] for line in lines]


def test_curves_are_scored_against_the_truth_of_their_scene(tmp_path):
    scenes = [truth_in(tmp_path / "scenes" / name) for name in ("square", "again")]
    out = tmp_path / "out"
    run_in(out / "ours" / "square-1", above(SQUARE, 0.003), scenes[0])
    run_in(out / "ours" / "again-2", above(SQUARE[:2], 0.003), scenes[1] / "transforms_edges.json")
    run_in(out / "theirs" / "square-3", above(SQUARE, 0.015), scenes[0])
    main(["eval", str(out), "-o", str(tmp_path / "table"), "--quiet"])
    with (tmp_path / "table" / "evaluation.csv").open(newline="") as file:
        half, near, far = list(csv.DictReader(file))
    assert [row["subject"] for row in (half, near, far)] == ["again", "square", "square"]
    # Samples of the truth are 5 mm apart and voxels 7.8 mm wide: nearest samples lie up to half of that further along.
    assert 3 <= float(near["acc_mm"]) <= math.hypot(3, 2.5)
    assert 15 <= float(far["comp_mm"]) <= math.hypot(15, 3.9)
    assert [[float(row[f"F{mm}"]) for mm in (5, 10, 20)] for row in (near, far)] == [[1, 1, 1], [0, 0, 1]]
    assert float(half["P5"]) == 1
    assert float(half["R5"]) == pytest.approx(0.5, abs=0.01)
    text = (tmp_path / "table" / "evaluation.md").read_text()
    assert "| ours | 2 |" in text
    assert "protocol of EMAP" in text


def test_a_truth_in_another_unit_says_its_longest_side(tmp_path):
    run = run_in(tmp_path / "out" / "a", above(SQUARE, 0.003 * 40), tmp_path / "scene")
    wide = [[[40 * x, 40 * y, 0.5] for x, y, _ in side] for side in SQUARE]
    scene = truth_in(tmp_path / "scene", wide)
    ds.save(run / "sketch.json", ds.Sketch(torch.tensor(above(wide, 0.003 * 40)), width=0.01))
    with pytest.raises(ValueError, match=r'the curves span 40, .*say in it how long that is, "longest_side": 40'):
        evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions())
    truth = json.loads((scene / "ground_truth.json").read_text())
    (scene / "ground_truth.json").write_text(json.dumps(truth | {"longest_side": 40}))
    (row,) = evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions())
    assert row.scores["F5"] == 1
    assert 3 <= row.scores["acc_mm"] <= math.hypot(3, 2.5)


def test_what_runs_measured_of_held_out_pictures_is_in_the_table(tmp_path):
    (tmp_path / "scene").mkdir()
    measured = {"psnr": 30.0, "ssim": 0.9, "psnr_test": 25.5, "ssim_test": 0.8}
    run_in(tmp_path / "out" / "a", SQUARE, tmp_path / "scene", scores=measured)
    (row,) = evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions())
    assert row.scores == {"PSNR of the fit": 30.0, "SSIM of the fit": 0.9, "PSNR": 25.5, "SSIM": 0.8}


def test_held_out_pictures_beside_the_sketch(tmp_path, monkeypatch):
    """By a network that sees blue and a constant: the mean over the views that the fit has not seen."""
    monkeypatch.setattr("diff3ds.tasks.evaluate.judges.load_hed", two_channels)
    scene = tmp_path / "scene"
    for part, turns in (("train", [0.0, 90.0, 200.0]), ("test", [45.0, 300.0])):
        cameras = ds.orbit(turns, 20.0, 3.0, size=32)
        drawn = ds.render(demo_sketch(), cameras)
        names = [f"{part}/{view}.png" for view in range(len(turns))]
        for name, color, alpha in zip(names, drawn.color, drawn.alpha, strict=True):
            (scene / name).parent.mkdir(parents=True, exist_ok=True)
            save_png(scene / name, torch.cat([color, alpha[..., None]], -1))
        ds.save_transforms(scene / f"transforms_{part}.json", cameras, names)
    out = tmp_path / "out" / "a"
    sketch = run_views(scene, out, ViewsOptions(target="color", strokes=6, steps=2, background="0,0.5,1"))
    (row,) = evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions(hed=True))
    with torch.no_grad():
        pictures = torch.stack([load_image(scene / name) for name in names])
        blue = torch.tensor([0.0, 0.5, 1.0])
        wanted = pictures[..., :3] * pictures[..., 3:] + (1 - pictures[..., 3:]) * blue
        seen = ds.render(sketch, cameras, background=blue).color
        expected = HedDistance(two_channels())(seen, wanted).mean()
    assert row.scores["VGG-HED"] == pytest.approx(float(expected), rel=0.02)
    assert {"PSNR", "VGG-HED"} <= set(row.scores)
    assert "no LPIPS" in (tmp_path / "table" / "evaluation.md").read_text()
    # Turned after the fit, the sketch is not where they were taken.
    record = json.loads((out / "run.json").read_text())
    (out / "run.json").write_text(json.dumps(record | {"placed": {"scale": 2.0}}))
    (row,) = evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions(hed=True))
    assert "VGG-HED" not in row.scores


def test_a_sketch_that_was_turned_or_scaled_is_not_scored_in_another_world(tmp_path):
    placed = {"placed": {"scale": 2.0}}
    run_in(tmp_path / "out" / "a", SQUARE, truth_in(tmp_path / "scene"), **placed)
    with pytest.raises(ValueError, match=r"a: --up or --scale has moved this sketch.* make the run"):
        evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions())


def test_a_sketch_without_strokes_finds_nothing(tmp_path):
    run_in(tmp_path / "out" / "a", [], truth_in(tmp_path / "scene"))
    (row,) = evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions())
    assert row.scores == {f"{k}{mm}": 0 for mm in (5, 10, 20) for k in "PRF"}
    # Not as infinite, which is no JSON.
    assert "Infinity" not in (tmp_path / "table" / "evaluation.json").read_text()


def test_what_cannot_be_scored_is_said(tmp_path):
    def refused(message, kind=ValueError):
        with pytest.raises(kind, match=message):
            evaluate(tmp_path / "out", tmp_path / "table", JudgeOptions())
        assert not (tmp_path / "table").exists()

    run_in(tmp_path / "out" / "a", SQUARE, tmp_path / "scene")
    refused("its scene .*scene is not there", FileNotFoundError)
    (tmp_path / "scene").mkdir()
    refused("scored where the scene has a ground_truth.json")
    truth = tmp_path / "scene" / "ground_truth.json"
    for content, message in (
        ([], 'has "curves", each with "points"'),
        ({"lines": []}, 'has "curves", each with "points"'),
        ({"curves": 3}, 'each of "curves" has "points"'),
        ({"curves": [[0, 0, 0]]}, 'each of "curves" has "points"'),
        ({"curves": []}, "lists of three finite numbers, and at least one"),
        ({"points": []}, "lists of three finite numbers"),
        ({"points": [[0, 1]]}, "lists of three finite numbers"),
        ({"points": [[0, 1, math.nan]]}, "lists of three finite numbers"),
        ({"points": CORNERS, "longest_side": -1}, "longest_side is a length above 0, got -1"),
    ):
        truth.write_text(json.dumps(content))
        refused(message)


def test_things_of_a_scene_and_runs_of_meshes_are_no_runs_to_compare(tmp_path):
    whole = run_in(tmp_path / "out" / "fish", SQUARE, "x", options={"phrase": "a fish in a bowl"})
    (whole / "scene.json").write_text("{}")
    for name in ("1-fish", "2-bowl"):
        run_in(whole / "things" / name, SQUARE, "x", options={"phrase": name})
    mesh = run_in(tmp_path / "out" / "mesh", SQUARE, "cube.obj")
    (mesh / "run.json").write_text(json.dumps({"options": {"source": "cube.obj"}, "scores": {}}))
    run_in(tmp_path / "out" / "demo", SQUARE, "demo")
    # A folder of that name by itself is a method's.
    run_in(tmp_path / "out" / "things" / "cat", SQUARE, "x", options={"phrase": "a cat"})
    assert [(run.subject, run.method) for run in find_runs(tmp_path / "out")] == [
        ("a fish in a bowl", "out"),
        ("a cat", "things"),
    ]
