"""Examples for the small prior, and its training: what is drawn, that it learns, stops and goes on."""

import json
import math
import os
import pickle
import signal
from multiprocessing.reduction import ForkingPickler
from pathlib import Path

import pytest
import torch
from safetensors import SafetensorError
from safetensors.torch import save_file

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.guidance.built_in.small import angles, read_network, write_network
from diff3ds.library import CATEGORIES, member
from diff3ds.library.phrase import parse
from diff3ds.tasks.exact_prior.sketch_folder import read_sketches
from diff3ds.tasks.progress import Stopped
from diff3ds.tasks.small_prior import prior_data, prior_train
from diff3ds.tasks.small_prior.prior_data import Examples, OwnSketches, combinations, draw_request, inked, said, words
from diff3ds.tasks.small_prior.prior_train import CHECKPOINT, LOG, NETWORK, rate_fraction, train_prior
from diff3ds.tasks.small_prior.train_options import TrainOptions

TINY = {"batch": 2, "depth": 1, "width": 16, "patch": 16, "workers": 0, "checkpoint_every": 100}


def test_an_example_depends_on_the_seed_and_its_index_alone():
    one, again, other = Examples(3, 10)[7], Examples(3, 500)[7], Examples(4, 10)[7]
    assert all(torch.equal(one[name], again[name]) for name in one)
    assert not torch.equal(one["views"], other["views"])
    assert not torch.equal(one["views"], Examples(3, 10)[8]["views"])


def test_an_example_shows_what_its_words_say():
    for index in range(6):
        example = Examples(0, 6)[index]
        named = {word for word, value in zip(words(), example["words"].tolist(), strict=True) if value}
        categories = named & set(CATEGORIES)
        assert len(categories) == 1
        (category,) = categories
        assert all(word.startswith(f"{category}: ") or word.startswith("stretch ") for word in named - categories)
        assert example["views"].shape == (4, 64, 64)
        assert example["views"].min() >= 0
        assert 0.9 < example["views"].max() <= 1
        turns = example["cameras"][:, 0].diff().remainder(2 * math.pi)
        assert torch.allclose(turns, torch.full((3,), math.pi / 2), atol=1e-4)
        assert len(example["cameras"][:, 1:].unique(dim=0)) == 1 or torch.allclose(
            example["cameras"][:, 1:], example["cameras"][:1, 1:], atol=1e-5
        )


@pytest.mark.parametrize("index", [0, pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)])
def test_the_kind_that_words_say_is_seen_in_the_views(index):
    """By the recogniser of drawings, which knows nothing of examples; in pictures large enough for it."""
    example = Examples(0, 6, size=256)[index]
    named = {word for word, value in zip(words(), example["words"].tolist(), strict=True) if value}
    paper = (255 * (1 - example["views"][0])).to(torch.uint8).numpy()
    assert ds.recognise(paper).guesses[0].kind in named


def test_views_are_those_of_the_cameras_that_are_said(monkeypatch):
    """A ring on the ground in front of the object is seen where its camera says."""
    cameras = ds.orbit([0.0, 90.0], 15.0, 1.9, size=64)
    sketch = ds.Sketch(torch.tensor([[[0.0, 0.5, 0], [0, 0.5, 0.1], [0, 0.5, 0.2], [0, 0.5, 0.3]]]))
    seen = inked(sketch, cameras)
    columns = (seen.sum(1) * torch.arange(64)).sum(1) / seen.sum((1, 2))
    # From +x the stroke at y = +.5 is on the right; from +y it is in the middle.
    assert columns[0] > 40
    assert columns[1] == pytest.approx(31.5, abs=1)
    assert torch.allclose(angles(cameras)[:, 0], torch.tensor([0.0, math.pi / 2]), atol=1e-6)


def test_some_combinations_are_left_out_of_the_training():
    left = {c: combinations(c, True) for c in CATEGORIES}
    count = sum(len(kinds) for kinds in left.values())
    everything = sum(len(c.combinations()) for c in CATEGORIES.values())
    # The issue asks for a tenth of all.
    assert 0.07 < count / everything < 0.13
    assert all(len(names) > 1 for kinds in left.values() for names in kinds)
    for name in CATEGORIES:
        assert set(left[name]) | set(combinations(name, False)) == set(CATEGORIES[name].combinations())
    generator = torch.Generator().manual_seed(0)
    drawn = [draw_request(generator) for _ in range(1000)]
    assert {request.category for request in drawn} == set(CATEGORIES)
    assert not [r for r in drawn if r.attributes in left[r.category]]
    assert {a.name for r in drawn for a in CATEGORIES[r.category].attributes if a.name in r.attributes}


def test_phrases_have_words():
    assert said(parse("a chair with armrests")) == {"chair": 1.0, "chair: armrests": 1.0}
    assert said(parse("a tall red lamp")) == {"lamp": 1.0, "stretch z": pytest.approx(math.log(1.35))}
    with pytest.raises(ValueError, match="one thing, not 2"):
        said(parse("two mugs"))


def test_the_rate_rises_stays_and_falls_to_nothing():
    assert rate_fraction(0, 1000) == 1 / prior_train.WARM_UP
    assert rate_fraction(500, 1000) == 1
    assert rate_fraction(800, 1000) == pytest.approx(0.5)
    assert rate_fraction(1000, 1000) == 0


@pytest.mark.slow
def test_a_network_learns(tmp_path, monkeypatch):
    """What it can learn at once: where there is ink at all. Noise alone has a loss of 1."""
    monkeypatch.setattr(prior_train, "typical_ink", lambda subjects: (0.21, 0.39))
    path = train_prior(tmp_path, TrainOptions(steps=180, rate=0.02, **(TINY | {"batch": 2, "width": 32, "patch": 8})))
    log = json.loads((tmp_path / LOG).read_text())
    assert log["steps"] == 180
    values = log["loss"]["values"]
    assert values[0] > 0.9
    # Means of ten steps with two pictures each, which scatter by .2 and differ between kinds of processors.
    assert sum(values[-6:]) / 6 < 0.8
    network, vocabulary = read_network(path)
    assert vocabulary.words == words()
    assert network.shape.width == 32


def test_a_training_that_is_resumed_is_the_same_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.setattr(prior_train, "typical_ink", lambda subjects: (0.21, 0.39))
    whole = train_prior(tmp_path / "whole", TrainOptions(steps=8, **TINY))

    class Interrupted(torch.optim.AdamW):
        """Ctrl-C comes in the fourth step, when some of the weights have moved."""

        moves = 0

        def step(self, closure=None):
            Interrupted.moves += 1
            if Interrupted.moves == 4:
                signal.raise_signal(signal.SIGINT)
            super().step(closure)

    # Processes that shells start in the background ignore it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    with monkeypatch.context() as patch:
        patch.setattr(torch.optim, "AdamW", Interrupted)
        with pytest.raises(Stopped):
            train_prior(tmp_path / "parts", TrainOptions(steps=8, **TINY))
    signal.signal(signal.SIGINT, before)
    assert json.loads((tmp_path / "parts" / LOG).read_text())["steps"] == 4
    parts = train_prior(tmp_path / "parts", TrainOptions(steps=8, resume=True, **TINY))
    first, second = read_network(whole)[0].state_dict(), read_network(parts)[0].state_dict()
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert (
        json.loads((tmp_path / "whole" / LOG).read_text())["loss"]
        == json.loads((tmp_path / "parts" / LOG).read_text())["loss"]
    )


def test_a_disk_that_fills_up_during_a_training_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(prior_train, "typical_ink", lambda subjects: (0.21, 0.39))
    path = train_prior(tmp_path / "prior", TrainOptions(steps=1, **TINY))

    def full(*arguments):
        raise SafetensorError("I/O error: No space left on device (os error 28)")

    monkeypatch.setattr("safetensors.torch.save_file", full)
    with pytest.raises(OSError, match="make room"):
        train_prior(tmp_path / "prior", TrainOptions(steps=2, resume=True, **TINY))
    with pytest.raises(OSError, match="make room"):
        write_network(path, *read_network(path), {})


@pytest.mark.slow
def test_workers_change_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(prior_train, "typical_ink", lambda subjects: (0.21, 0.39))
    alone = train_prior(tmp_path / "alone", TrainOptions(steps=2, **TINY))
    helped = train_prior(tmp_path / "helped", TrainOptions(steps=2, **(TINY | {"workers": 1})))
    first, second = read_network(alone)[0].state_dict(), read_network(helped)[0].state_dict()
    assert all(torch.equal(first[name], second[name]) for name in first)


@pytest.mark.slow
def test_threads_change_nothing(tmp_path, monkeypatch):
    """A batch of three parts, the last one smaller."""
    monkeypatch.setattr(prior_train, "typical_ink", lambda subjects: (0.21, 0.39))
    alone = train_prior(tmp_path / "alone", TrainOptions(steps=2, threads=1, **(TINY | {"batch": 10})))
    helped = train_prior(tmp_path / "helped", TrainOptions(steps=2, threads=3, **(TINY | {"batch": 10})))
    first, second = read_network(alone)[0].state_dict(), read_network(helped)[0].state_dict()
    assert all(torch.equal(first[name], second[name]) for name in first)


@pytest.mark.parametrize("sees", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_the_gradients_of_parts_are_those_of_the_whole_batch(monkeypatch, sees):
    monkeypatch.setattr(prior_train, "typical_ink", lambda subjects: (0.21, 0.39))
    monkeypatch.setattr(prior_train, "half_is_fast", lambda device: False)
    monkeypatch.setattr(prior_train, "WITH_REFERENCE", float(sees))
    training = prior_train.Training(TrainOptions(**(TINY | {"batch": 6})), prior_data.BuiltIn(), torch.device("cpu"))
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in training.network.parameters():
            parameter += 0.1 * torch.randn(parameter.shape, generator=generator)
    examples = [Examples(0, 6)[i] for i in range(6)]
    batch = {name: torch.stack([example[name] for example in examples]) for name in examples[0]}
    wanted, *given = training._task(batch, generator)
    loss = (training.network(*given) - wanted).square().mean()
    loss.backward()
    expected = [p.grad for p in training.network.parameters()]
    training.network.zero_grad()
    assert training._descend([wanted, *given]) == pytest.approx(loss.item(), rel=1e-5)
    for known, parameter in zip(expected, training.network.parameters(), strict=True):
        assert (known is None) == (parameter.grad is None)
        assert known is None or torch.allclose(parameter.grad, known, rtol=1e-3, atol=1e-6)
    assert (training.network.reference.weight.grad is None) != sees


@pytest.mark.slow
def test_the_command_trains_and_shows_samples(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(prior_train, "typical_ink", lambda subjects: (0.21, 0.39))
    out = tmp_path / "prior"
    arguments = "--steps 2 --batch 1 --depth 1 --width 16 --patch 16 --workers 0 --checkpoint-every 2"
    arguments = arguments.split()
    main(["prior", "train", "-o", str(out), *arguments])
    assert "--prior small --weights" in capsys.readouterr().err
    assert sorted(p.name for p in out.iterdir()) == sorted([CHECKPOINT, LOG, NETWORK, "samples"])
    assert [p.name for p in (out / "samples").iterdir()] == ["step_000002.png"]
    for wrong, message in (
        ([], "holds a run"),
        (["--resume", "--rate", "0.1"], "had another rate"),
        (["--resume", "--steps", "1"], "2 steps are done"),
        (["--overwrite", "--rate", "2"], "rate must lie in"),
        (["--overwrite", "--width", "30"], "multiple"),
    ):
        with pytest.raises(SystemExit):
            main(["prior", "train", "-o", str(out), *arguments, *wrong])
        assert message in capsys.readouterr().err
    for meta in ("", "[]", '{"identity": [], "words": []}'):
        save_file({"losses": torch.zeros(1)}, out / CHECKPOINT, {"diff3ds": meta})
        with pytest.raises(SystemExit):
            main(["prior", "train", "-o", str(out), *arguments, "--resume"])
        assert "not a checkpoint of this training" in capsys.readouterr().err
    (out / CHECKPOINT).write_bytes(b"damaged")
    with pytest.raises(SystemExit):
        main(["prior", "train", "-o", str(out), *arguments, "--resume"])
    assert "not a checkpoint of this training" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["prior", "train", "-o", str(out / LOG), *arguments])
    assert "is a file, not a folder" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["prior", "train", "-o", str(tmp_path / "none"), "--resume"])
    assert "no checkpoint" in capsys.readouterr().err


@pytest.mark.slow
def test_the_typical_ink_of_the_built_in_subjects():
    """The tests of training take it as known: it is that of the first pictures, and of others to their scatter."""
    mean, spread = prior_data.typical_ink(prior_data.BuiltIn(), count=64)
    views = torch.stack([Examples(0, 64)[i]["views"] for i in range(64)])
    assert (mean, spread) == pytest.approx((float(views.mean()), float(views.std())))
    assert (mean, spread) == pytest.approx((0.21, 0.39), abs=0.03)


def test_sizes_agree_with_those_of_the_exemplars():
    from diff3ds.tasks.exact_prior import exemplars

    assert prior_data.SIZE == exemplars.SIZE
    assert exemplars.GROUP == prior_data.GROUP


@pytest.mark.slow
def test_a_network_learns_a_folder_of_ones_own(tmp_path, capsys):
    folder, out = tmp_path / "sketches", tmp_path / "prior"
    folder.mkdir()
    for name, category in (("gizmo_1", "mug"), ("round_gizmo_with_lid", "lamp"), ("widget", "key")):
        ds.save(folder / f"{name}.json", member(category, torch.Generator().manual_seed(0)).sketch)
    small = ["--batch", "1", "--depth", "1", "--width", "16", "--patch", "16", "--workers", "0"]
    arguments = ["prior", "train", "--library", str(folder), "-o", str(out), "--checkpoint-every", "2", *small]
    main([*arguments, "--steps", "2"])
    learned = read_network(out / NETWORK)[1].words
    assert sorted(learned) == sorted(["gizmo", "widget", "gizmo: round", "gizmo: lid", *prior_data.AXES])
    drawing = ["--prior", "small", "--weights", str(out / NETWORK), "-o", str(tmp_path / "run"), "--quiet"]
    main(["text", "a tall round gizmo", *drawing, "--steps", "2", "--strokes", "4", "--sheet-every", "0"])
    assert (tmp_path / "run" / "sketch.json").exists()
    with pytest.raises(SystemExit):
        main(["text", "a mug", *drawing[:-3], "-o", str(tmp_path / "other")])
    assert "nothing in" in capsys.readouterr().err
    ds.save(folder / "widget.json", member("sword", torch.Generator().manual_seed(0)).sketch)
    with pytest.raises(SystemExit):
        main([*arguments, "--steps", "4", "--resume"])
    assert "another library_sha256" in capsys.readouterr().err


def test_own_sketches_vary_as_a_whole(tmp_path):
    ds.save(tmp_path / "mug.json", member("mug", torch.Generator().manual_seed(0)).sketch)
    subjects = OwnSketches(read_sketches(tmp_path))
    drawn = [subjects.draw(torch.Generator().manual_seed(i)) for i in range(20)]
    for sketch, values in drawn:
        assert values["mug"] == 1
        assert all(abs(value) <= math.log(1.35) + 1e-6 for name, value in values.items() if name in prior_data.AXES)
        assert ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 9)).norm(dim=-1).max() < 1
    heights = [float((s.points.amax((0, 1)) - s.points.amin((0, 1)))[2]) for s, _ in drawn]
    assert max(heights) > 1.1 * min(heights)


def test_what_is_there_is_not_lost(tmp_path, monkeypatch):
    """A network without its checkpoint; pictures of a training that is overwritten; weights, if a gradient is NaN."""
    monkeypatch.setattr(prior_train, "typical_ink", lambda subjects: (0.21, 0.39))
    (tmp_path / NETWORK).write_bytes(b"weeks of work")
    with pytest.raises(ValueError, match=f"holds {NETWORK}: give another folder"):
        train_prior(tmp_path, TrainOptions(steps=1, **TINY))
    assert (tmp_path / NETWORK).read_bytes() == b"weeks of work"
    (tmp_path / "samples").mkdir()
    (tmp_path / "samples" / "step_000001.png").write_bytes(b"old")
    train_prior(tmp_path, TrainOptions(steps=2, overwrite=True, **TINY))
    assert not list((tmp_path / "samples").iterdir())
    held = (tmp_path / NETWORK).read_bytes()

    def broken(self, part):
        found, loss = gradients(self, part)
        return (found[0] * math.nan, *found[1:]), loss

    gradients = prior_train.Training._gradients
    monkeypatch.setattr(prior_train.Training, "_gradients", broken)
    with pytest.raises(FloatingPointError, match="loss of step 2, or a gradient, is not finite"):
        train_prior(tmp_path, TrainOptions(steps=3, resume=True, **(TINY | {"checkpoint_every": 1})))
    assert (tmp_path / NETWORK).read_bytes() == held


def test_a_folder_travels_to_another_process_without_open_files(tmp_path):
    """torch hands over each tensor as an open file, of which systems allow a thousand."""
    for name in ("chair", "mug"):
        ds.save(tmp_path / f"{name}.json", member(name, torch.Generator().manual_seed(0)).sketch)
    held = read_sketches(tmp_path)
    before = len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").exists() else 0
    packed = bytes(ForkingPickler.dumps(held))
    assert b"rebuild_storage" not in packed
    assert not before or len(os.listdir("/proc/self/fd")) == before
    arrived = pickle.loads(packed)
    assert arrived.names == held.names
    for one, other in zip(arrived.members, held.members, strict=True):
        assert all(torch.equal(value, other.sketch.tensors()[name]) for name, value in one.sketch.tensors().items())
