"""The benchmark of a step with random weights (benchmarks/step_cost.py): tiny on the CPU, and as large as it says."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from needs import needs

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import random_mvdream
import step_cost

from diff3ds.guidance.networks.latent import VAE_WEIGHTS
from diff3ds.guidance.networks.multiview_attention import check_joined

pytestmark = needs("diffusers", "ftfy")

# Weights of the UNet of Stable Diffusion 2.1, and of the two layers that tell MVDream's of 16 numbers of a camera.
STABLE_DIFFUSION, CAMERA = 865_910_724, 16 * 1280 + 1280 + 1280 * 1280 + 1280


def weights(model: torch.nn.Module) -> int:
    return sum(p.numel() for p in model.parameters())


def test_full_size():
    """Counted without memory."""
    import diffusers

    with torch.device("meta"):
        unet = diffusers.UNet2DConditionModel.from_config(random_mvdream.UNET)
        vae = diffusers.AutoencoderKL.from_config(random_mvdream.VAE)
    assert weights(unet) == STABLE_DIFFUSION + CAMERA
    assert weights(vae) == VAE_WEIGHTS


def test_every_weight_is_written(monkeypatch):
    """Memory that nobody wrote would be NaN here; and the prior predicts with all four views."""
    empty = torch.nn.Module.to_empty

    def poisoned(self, *, device):
        made = empty(self, device=device)
        for tensor in (*made.parameters(), *made.buffers()):
            tensor.data.fill_(float("nan"))
        return made

    monkeypatch.setattr(torch.nn.Module, "to_empty", poisoned)
    prior = random_mvdream.random_mvdream("tiny", torch.device("cpu"), torch.bfloat16)
    for model in (prior.unet, prior._autoencoder._network):
        assert {p.dtype for p in model.parameters()} == {torch.bfloat16}
        assert all(p.isfinite().all() for p in model.parameters())
    check_joined(prior.unet)
    assert (prior.size, prior.group) == (32, 4)


def test_a_tiny_run():
    """The command's own run of a few steps: each is timed, and all that is printed has a value."""
    figures = step_cost.random_steps("tiny", torch.device("cpu"), torch.bfloat16, steps=3)
    assert all(low > 0 for name in ("step", "without the prior", "renderer") for low in figures[f"{name}, ms"])
    # torch alone takes more.
    assert figures["memory, GB"] > 0.1
    assert len(step_cost.step_seconds(step_cost.FreePrior(32, 4), torch.device("cpu"), 3)) == 3


def test_a_step_is_timed_until_the_device_is_done(monkeypatch):
    """By a clock that only a wait for the device moves."""
    clock = SimpleNamespace(now=0.0)

    def wait(device):
        assert device == torch.device("cpu")
        clock.now += 0.25

    monkeypatch.setattr(step_cost, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    monkeypatch.setattr(step_cost, "_wait", wait)
    assert step_cost.step_seconds(step_cost.FreePrior(32, 4), torch.device("cpu"), 3) == [0.25] * 3


def test_figures_follow_from_the_times(monkeypatch):
    def step_seconds(prior, device, steps):
        return [0.002, 0.002, 0.004] if isinstance(prior, step_cost.FreePrior) else [0.04, 0.02, 0.05]

    monkeypatch.setattr(step_cost, "step_seconds", step_seconds)
    monkeypatch.setattr(step_cost, "render_seconds", lambda *_: [0.001, 0.003, 0.001])
    figures = step_cost.random_steps("tiny", torch.device("cpu"), torch.bfloat16)
    assert figures["step, ms"] == pytest.approx([40, 30, 45])
    assert figures["percent renderer"] == pytest.approx(2.5)
    assert figures["percent without the prior"] == pytest.approx(5)
    assert figures["4,000 steps, min"] == pytest.approx(4000 * 0.04 / 60)
