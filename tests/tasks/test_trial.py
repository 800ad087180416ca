"""`diff3ds doctor --try`: the small prior is found sound, networks that have learned nothing are not."""

import json
from dataclasses import replace

import pytest
import torch
from rich.console import Console
from tiny import save_mvdream, save_stable_diffusion
from tiny_zero123 import save_zero123

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.guidance.built_in.exemplar import ExemplarDenoiser
from diff3ds.guidance.built_in.small import write_network
from diff3ds.guidance.built_in.small_network import SmallNetwork
from diff3ds.guidance.recipe import Recipe
from diff3ds.library.members import member
from diff3ds.tasks.doctor import trial
from diff3ds.tasks.doctor.trial import Check, Cost, Trial, try_prior
from diff3ds.tasks.doctor.trial_options import TrialOptions
from diff3ds.tasks.doctor.trial_report import trial_as_json, trial_as_tables, verdict
from diff3ds.tasks.doctor.tried_prior import TriedPrior
from diff3ds.tasks.exact_prior.exemplars import WIDTH
from diff3ds.tasks.small_prior.small_prior import trained
from diff3ds.tasks.text_image.conditioned_prior import Network

COST = Cost(0.5, 4000, 2_500_000_000)


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """On a machine that others use two minutes are over soon."""
    monkeypatch.setattr(trial, "PATIENCE", 3600.0)


def printed(found):
    console = Console(width=80, color_system=None)
    with console.capture() as capture:
        console.print(trial_as_tables(found))
    return capture.get()


def of(*sound):
    checks = tuple(Check(f"check {i}", "much", "so much", each) for i, each in enumerate(sound))
    return Trial("mvdream", {"weights": "a/b@1"}, 3.0, COST, checks)


def random_small(path):
    """A file with the small network as training begins, which has learned nothing."""
    known = trained()
    torch.manual_seed(0)
    write_network(path, SmallNetwork(known.network.shape), known.vocabulary, {})
    return path


def exact(weights):
    """A prior that knows a chair and a table by heart; of the weights that are said."""
    known = [member(name, torch.Generator().manual_seed(0)).sketch.replace(width=WIDTH) for name in ("chair", "table")]

    def draw(cameras):
        return torch.stack([ds.render(sketch, cameras).color for sketch in known])

    denoiser = ExemplarDenoiser(draw, torch.tensor([True, False]), 32)
    network = Network({"weights": weights}, torch.device("cpu"), "float32")
    return TriedPrior("small", denoiser, network, Recipe(guidance=7.5), 400, True)


def test_an_exact_prior_is_sound(monkeypatch):
    monkeypatch.setattr(trial, "load_tried", lambda options, shown: exact("by heart"))
    found = try_prior(TrialOptions("small"))
    assert [check.sound for check in found.checks] == 8 * [True]
    assert found.sound
    # It knows the chair to the last pixel.
    assert found.checks[0].found == "100% of them"
    assert {check.found for check in found.checks[1:6]} == {"0% of a guess"}
    assert 0 < found.cost.step < 60


class Guessing(ExemplarDenoiser):
    """Predicts the multiple of the noisy pictures with the least error, and nothing of what it knows."""

    power = None

    def encode(self, images, generator):
        latents = super().encode(images, generator)
        # Of the sharp pictures, which come first.
        self.power = latents.detach().square().mean() if self.power is None else self.power
        return latents

    def predict(self, noisy, timesteps, cameras, branches):
        kept = self.schedule.alpha_bar(timesteps, noisy)
        return ((1 - kept).sqrt() / (kept * self.power + 1 - kept) * noisy).expand(len(branches), *noisy.shape)


def test_the_best_guess_is_measured_as_one_and_not_sound(monkeypatch):
    """Its error is that of the formula, but for the chance of this noise: 1 % in 12,288 numbers."""
    prior = exact("by heart")
    prior.denoiser.__class__ = Guessing
    monkeypatch.setattr(trial, "load_tried", lambda options, shown: prior)
    found = try_prior(TrialOptions("small"))
    guesses = [float(check.found.split("%")[0]) for check in found.checks[1:6]]
    assert guesses == pytest.approx(5 * [100], abs=3)
    assert [check.sound for check in found.checks] == [True, *7 * [False]]


@pytest.mark.slow
def test_the_small_prior_is_sound(capsys):
    main(["doctor", "--try", "small", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["sound"] is True
    assert [check["sound"] for check in found["checks"]] == 8 * [True]
    assert found["cost"]["steps"] == 400
    assert found["cost"]["step"] > 0
    assert found["network"]["precision"] in ("float32", "bfloat16")
    assert {"diff3ds", "torch", "cpu", "diffusers"} <= {finding["name"] for finding in found["software"]}


@pytest.mark.slow
def test_a_network_that_has_learned_nothing_is_not(tmp_path, capsys):
    file = random_small(tmp_path / "small.safetensors")
    with pytest.raises(SystemExit) as ended:
        main(["doctor", "--try", "small", "--weights", str(file), "--json"])
    assert ended.value.code == 1
    found = json.loads(capsys.readouterr().out)
    assert found["sound"] is False
    # Its latents are pixels, and come back whatever it has learned.
    assert [check["sound"] for check in found["checks"]] == [True, *7 * [False]]


def check_random(name, folder):
    """Random weights fail, and what was tried is said."""
    found = try_prior(TrialOptions(name, weights=str(folder), device="cpu"))
    assert found.sound is False
    assert sum(check.sound is False for check in found.checks) >= 5
    # Only a prior that is told poses can be told wrong ones.
    assert any("cameras" in check.name for check in found.checks) is (name != "stable-diffusion")
    assert found.cost.steps == 4000
    assert str(folder) in str(found.network["weights"])


@pytest.mark.parametrize(
    ("name", "save"),
    [("stable-diffusion", save_stable_diffusion), pytest.param("zero123", save_zero123, marks=pytest.mark.slow)],
)
def test_random_weights_of_diffusion_models_are_not(name, save, tmp_path):
    check_random(name, save(tmp_path / "weights"))


@pytest.mark.slow
def test_random_weights_of_mvdream_are_not(tmp_path):
    check_random("mvdream", save_mvdream(tmp_path / "weights", "stock"))


def test_what_there_is_no_time_for_is_said(monkeypatch):
    monkeypatch.setattr(trial, "PATIENCE", -1.0)
    monkeypatch.setattr(trial, "load_tried", lambda options, shown: exact("by heart"))
    found = try_prior(TrialOptions("small"))
    assert found.sound is None
    assert {check.sound for check in found.checks} == {None}
    assert "not tried" in printed(found)


def test_the_verdict_and_the_table():
    assert (of(True, True).sound, of(True, False, None).sound, of(True, None).sound) == (True, False, None)
    assert verdict(of(True)) == "this installation is sound"
    assert verdict(of(True, False)).startswith("not sound, for 1 of 2 checks fail: fetch its weights again")
    assert "take a GPU" in verdict(of(True, None))
    table = printed(of(True, False))
    assert max(len(line) for line in table.splitlines()) <= 80
    for said in ("a/b@1", "2.5 GB", "0.50 s", "4000 steps, about 33 minutes", "NOT SOUND", "check 1"):
        assert said in table
    assert "not known" in printed(replace(of(True), cost=replace(COST, memory=None)))
    assert json.loads(trial_as_json(of(None)))["sound"] is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--try", "exemplar"], "needs one of small, mvdream"),
        (["--try", "dalle"], "prior must be one of small, mvdream"),
        (["--weights", "owner/name"], "name it with --try"),
        (["--try", "mvdream", "--variant", "fp16"], "add --weights"),
        (["--try", "mvdream", "--weights", "owner/not-here"], "diff3ds fetch mvdream --weights owner/not-here"),
        (["--try", "small", "--weights", "missing.safetensors"], "missing.safetensors"),
    ],
)
def test_what_is_refused(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["doctor", *arguments])
    assert ended.value.code in (1, 2)
    assert message in " ".join(capsys.readouterr().err.split())
