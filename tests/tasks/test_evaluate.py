"""Runs to tables of scores: values against the metrics themselves, formats, the list of phrases, errors."""

import csv
import json
import math
import re
from pathlib import Path

import pytest
import torch
from metrics.tiny_networks import features, heads, save, save_blip, save_clip
from needs import needs

import diff3ds as ds
from diff3ds.formats import load_image, save_png
from diff3ds.metrics.blip import BlipScore
from diff3ds.metrics.clip import ClipScore
from diff3ds.metrics.lpips import Lpips
from diff3ds.pictures.reading.resample import area_means
from diff3ds.tasks.evaluate.evaluate import evaluate, prompt_file, read_prompts
from diff3ds.tasks.evaluate.evaluate_options import EvaluateOptions, JudgeOptions
from diff3ds.tasks.evaluate.runs import find_runs
from diff3ds.tasks.evaluate.score_table import Row, markdown, summaries

pytestmark = needs("transformers", "ftfy")


SMALL = EvaluateOptions(size=64)


@pytest.fixture(scope="module")
def networks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("judges")
    return {
        "clip": (str(save_clip(folder / "tiny-16")), str(save_clip(folder / "tiny-32", patch=16))),
        "blip": str(save_blip(folder / "tiny-blip")),
        "alexnet": str(save(folder / "alexnet.safetensors", features("alex"))),
        "lpips_alex": str(save(folder / "alex.safetensors", heads("alex"))),
        "device": "cpu",
    }


def sketch(seed):
    return ds.Sketch.random(12, generator=torch.Generator().manual_seed(seed), radius=0.9, width=0.03)


def add_run(folder, seed, reference=None, **options):
    """What `diff3ds text` and `diff3ds image` leave behind, as far as it matters here."""
    ds.save(folder / "sketch.json", sketch(seed))
    (folder / "run.json").write_text(json.dumps({"options": options | {"fov": 60.0}}))
    if reference is not None:
        save_png(folder / "reference.png", reference)
    return folder


@pytest.fixture
def phrases(tmp_path):
    """Two methods, two phrases."""
    for seed, (method, phrase) in enumerate((m, p) for m in ("ours", "theirs") for p in ("a chair", "a cat")):
        add_run(tmp_path / "runs" / method / phrase.replace(" ", "-"), seed, phrase=phrase)
    return tmp_path / "runs"


def views_of(some):
    around = [0.0, 45, 90, 135, 180, 225, 270, 315]
    return ds.render(some, ds.orbit(around, 15.0, 2.0, fov=60.0, size=64)).color


def test_scores_of_phrases(networks, phrases, tmp_path):
    rows = evaluate(phrases, tmp_path / "out", JudgeOptions(**networks), SMALL)
    assert [(r.method, r.run, r.subject) for r in rows] == [
        ("ours", "ours/a-cat", "a cat"),
        ("ours", "ours/a-chair", "a chair"),
        ("theirs", "theirs/a-cat", "a cat"),
        ("theirs", "theirs/a-chair", "a chair"),
    ]
    with torch.no_grad():
        for row, seed in zip(rows, (1, 0, 3, 2), strict=True):
            views = views_of(sketch(seed))
            expected = {f"CLIP-T tiny-{n}": ClipScore(tmp) for n, tmp in zip((16, 32), clips(networks), strict=True)}
            expected["BLIP-ITC tiny-blip"] = BlipScore(Path(networks["blip"]))
            # LPIPS needs a picture.
            assert list(row.scores) == list(expected)
            for name, judge in expected.items():
                assert row.scores[name] == pytest.approx(float(judge.text(views, row.subject).mean()), abs=1e-5)
    assert len({round(r.scores["CLIP-T tiny-16"], 6) for r in rows}) == 4


def clips(networks):
    return [Path(text) for text in networks["clip"]]


@pytest.mark.slow
def test_scores_of_pictures(networks, tmp_path, generator):
    """LPIPS looks from where the picture was taken: a run whose picture is its own drawing has none there."""
    elevation = 25.0
    camera = ds.orbit(0.0, elevation, 2.0, fov=60.0, size=64)
    own = ds.render(sketch(5), camera).color[0]
    noise = torch.rand(64, 64, 3, generator=generator)
    add_run(tmp_path / "runs" / "own", 5, own, picture="thing.png", view_elevation=elevation)
    add_run(tmp_path / "runs" / "other", 5, noise, picture="x/noise.jpg", view_elevation=elevation)
    rows = evaluate(tmp_path / "runs", tmp_path / "out", JudgeOptions(**networks), SMALL)
    assert [(r.method, r.subject) for r in rows] == [("runs", "noise"), ("runs", "thing")]
    assert list(rows[0].scores) == ["CLIP-I tiny-16", "CLIP-I tiny-32", "LPIPS-alex"]
    # Bytes of the PNG file.
    assert rows[1].scores["LPIPS-alex"] < 1e-3 < 0.1 < rows[0].scores["LPIPS-alex"]
    with torch.no_grad():
        for row, name in zip(rows, ("other", "own"), strict=True):
            picture = load_image(tmp_path / "runs" / name / "reference.png")
            cosine = ClipScore(clips(networks)[0]).image(views_of(sketch(5)), picture).mean()
            assert row.scores["CLIP-I tiny-16"] == pytest.approx(float(cosine), abs=1e-5)
    distance = Lpips("alex", features("alex"), heads("alex"))
    picture = load_image(tmp_path / "runs" / "other" / "reference.png")
    large = [torch.nn.functional.interpolate(x[None].movedim(-1, 1), (224, 224), mode="bilinear").movedim(1, -1)
             for x in (own, picture)]  # fmt: skip
    assert rows[0].scores["LPIPS-alex"] == pytest.approx(float(distance(*large)), rel=1e-3)
    # From elsewhere the drawing is another.
    add_run(tmp_path / "runs" / "own", 5, own, picture="thing.png", view_elevation=0.0)
    rows = evaluate(tmp_path / "runs", tmp_path / "out", JudgeOptions(**networks), SMALL)
    assert rows[1].scores["LPIPS-alex"] > 0.01


def test_large_views_become_area_means(networks, tmp_path):
    """LPIPS at 224 pixels, whatever the size of the views."""
    camera = ds.orbit(0.0, 0.0, 2.0, fov=60.0, size=448)
    drawn = ds.render(sketch(5), camera).color
    white = torch.ones(448, 448, 3)
    add_run(tmp_path / "runs" / "a", 5, white, picture="white.png")
    chosen = {k: v for k, v in networks.items() if k in ("alexnet", "lpips_alex", "device")}
    (row,) = evaluate(tmp_path / "runs", tmp_path / "out", JudgeOptions(**chosen), EvaluateOptions(size=448))
    distance = Lpips("alex", features("alex"), heads("alex"))
    expected = distance(area_means(drawn, (224, 224)), torch.ones(1, 224, 224, 3))
    assert row.scores["LPIPS-alex"] == pytest.approx(float(expected), rel=1e-4)


def test_pictures_that_were_not_kept_are_read_again(networks, tmp_path, generator):
    """From the options of the run: with the mask that cut the object out."""
    save_png(tmp_path / "thing.png", torch.rand(64, 64, 3, generator=generator))
    mask = torch.zeros(64, 64, 3)
    mask[10:54, 10:54] = 1
    save_png(tmp_path / "mask.png", mask)
    add_run(tmp_path / "runs" / "a", 5)
    options = {"picture": str(tmp_path / "thing.png"), "mask": str(tmp_path / "mask.png")}
    (tmp_path / "runs" / "a" / "run.json").write_text(json.dumps({"options": options}))
    (row,) = evaluate(tmp_path / "runs", tmp_path / "out", JudgeOptions(**networks), SMALL)
    assert row.subject == "thing"
    assert row.scores["LPIPS-alex"] > 0


# Tables


def test_means_and_spread_by_method():
    rows = [Row("a", f"a/{i}", str(i), 1, {"x": v}) for i, v in enumerate((1.0, 2.0, 6.0))]
    rows += [Row("b", "b/0", "0", 1, {"y": 4.0}), Row("a", "a/3", "p", 1, {"z": 0.5})]
    found = summaries(rows)
    assert list(found) == ["a", "b"]
    assert list(found["a"]) == ["x", "z"]
    assert found["a"]["x"].mean == 3
    assert found["a"]["x"].spread == pytest.approx(math.sqrt((4 + 1 + 9) / 2))
    assert found["a"]["x"].runs == 3
    assert (found["b"]["y"].spread, found["a"]["z"].runs) == (None, 1)
    text = markdown(rows, {"views": "8"})
    assert "| a | 3 | 3.0000 ± 2.6458 |  | 0.5000 |" in text
    assert "| b | 1 |  | 4.0000 |  |" in text
    assert "- views: 8" in text


def test_three_formats_with_the_same_numbers(networks, phrases, tmp_path):
    rows = evaluate(phrases, tmp_path / "out", JudgeOptions(**networks), SMALL)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [f"evaluation.{s}" for s in ("csv", "json", "md")]
    content = json.loads((tmp_path / "out" / "evaluation.json").read_text())
    with (tmp_path / "out" / "evaluation.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == len(content["runs"]) == len(rows) == 4
    for line, run, row in zip(lines, content["runs"], rows, strict=True):
        assert run["scores"] == row.scores
        assert {name: float(line[name]) for name in row.scores} == row.scores
        assert (line["method"], line["subject"], line["strokes"]) == (row.method, row.subject, "12")
    mean = content["methods"]["ours"]["CLIP-T tiny-16"]["mean"]
    assert mean == pytest.approx(sum(r.scores["CLIP-T tiny-16"] for r in rows[:2]) / 2)
    text = (tmp_path / "out" / "evaluation.md").read_text()
    assert f"{mean:.4f} ±" in text
    # What a reader must know to compare: the views, and that BLIP's score is this checkpoint's.
    assert "elevation 15, distance 2, field of view 60, 64 pixels, on white" in text
    assert "BLIP-ITC tiny-blip" in text
    assert "comparable for this checkpoint only" in text
    assert re.search(r"- prompts: all runs", text)


# The list of phrases


def test_our_own_phrases_are_35_and_not_the_papers():
    path = prompt_file("own")
    assert len(read_prompts(path)) == 35
    assert "not those of the Diff3DS paper" in path.read_text()


def test_a_list_chooses_the_runs(networks, phrases, tmp_path):
    (tmp_path / "list.txt").write_text("# one phrase\n\n  a cat \n")
    options = EvaluateOptions(str(tmp_path / "list.txt"), size=64)
    rows = evaluate(phrases, tmp_path / "out", JudgeOptions(**networks), options)
    assert [r.subject for r in rows] == ["a cat", "a cat"]
    (tmp_path / "list.txt").write_text("a cat\na dog\na horse\n")
    with pytest.raises(ValueError, match="ours has no run of 'a dog' and 1 more of the list"):
        evaluate(phrases, tmp_path / "none", JudgeOptions(**networks), options)


@pytest.mark.parametrize(("text", "message"), [("# none\n", "no phrases in it"), ("a\nb\na\n", "'a' is there twice")])
def test_bad_lists_are_refused(text, message, tmp_path):
    (tmp_path / "list.txt").write_text(text)
    with pytest.raises(ValueError, match=message):
        read_prompts(tmp_path / "list.txt")


# Errors, before any work


def test_no_weights_are_an_error_that_says_what_to_give(phrases, tmp_path):
    with pytest.raises(ValueError, match="--clip openai/clip-vit-base-patch16"):
        evaluate(phrases, tmp_path / "out", JudgeOptions())
    with pytest.raises(ValueError, match="LPIPS needs both --alexnet and --lpips-alex: give --lpips-alex as well"):
        JudgeOptions(alexnet="x")
    with pytest.raises(ValueError, match="give --vgg16 as well"):
        JudgeOptions(lpips_vgg="x")


def test_missing_weights_are_found_before_anything_is_drawn(networks, phrases, tmp_path, monkeypatch):
    def never(*arguments, **options):
        raise AssertionError("drawn")

    monkeypatch.setattr("diff3ds.tasks.evaluate.evaluate.render", never)
    for changes, message in (
        ({"clip": ("openai/clip-vit-base-patch16",)}, "hf download openai/clip-vit-base-patch16"),
        ({"blip": str(tmp_path / "none")}, "BLIP: weights must be a folder or file that exists"),
        ({"blip": networks["clip"][0]}, "a blip model is needed here"),
        ({"alexnet": networks["lpips_alex"]}, "lacks features.0.bias"),
        ({"device": "abacus"}, "no device 'abacus'"),
    ):
        with pytest.raises((FileNotFoundError, ValueError), match=message):
            evaluate(phrases, tmp_path / "out", JudgeOptions(**(networks | changes)), SMALL)
    only = {k: v for k, v in networks.items() if k in ("alexnet", "lpips_alex")}
    with pytest.raises(ValueError, match="the runs are of phrases, which these networks cannot score: give --clip"):
        evaluate(phrases, tmp_path / "out", JudgeOptions(**only), SMALL)
    assert not (tmp_path / "out").exists()


def test_folders_without_runs_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such folder"):
        find_runs(tmp_path / "none")
    with pytest.raises(ValueError, match="no run of a phrase or a picture or posed pictures"):
        find_runs(tmp_path)
    folder = add_run(tmp_path / "a", 0, phrase="a cat")
    add_run(tmp_path / "views", 0, source="transforms.json")
    assert [run.folder.name for run in find_runs(tmp_path)] == ["a"]
    (folder / "sketch.json").unlink()
    with pytest.raises(ValueError, match=r"has a run.json but no sketch.json"):
        find_runs(tmp_path)
    (folder / "run.json").write_text("[]")
    with pytest.raises(ValueError, match=r"not the run.json of a run"):
        find_runs(tmp_path)
