"""Noise schedules and annealed timesteps against published values."""

import pytest
import torch

from diff3ds.guidance.denoiser import draw_timesteps
from diff3ds.guidance.formulas import weighted
from diff3ds.guidance.recipe import TimeAnnealing
from diff3ds.guidance.schedule import NoiseSchedule

# t, ᾱ, √ᾱ, √(1 - ᾱ), 1 - ᾱ, √ᾱ (1 - ᾱ), σ / α: of Stable Diffusion, MVDream and Zero-1-to-3.
GOLDEN = [
    (0, 0.999150, 0.999575, 0.029155, 0.000850, 0.000850, 0.029168),
    (20, 0.981314, 0.990613, 0.136696, 0.018686, 0.018510, 0.137991),
    (100, 0.894223, 0.945634, 0.325234, 0.105777, 0.100026, 0.343932),
    (300, 0.590501, 0.768440, 0.639921, 0.409499, 0.314676, 0.832753),
    (500, 0.276332, 0.525673, 0.850687, 0.723668, 0.380413, 1.618280),
    (850, 0.023299, 0.152640, 0.988282, 0.976701, 0.149084, 6.474578),
    (980, 0.005844, 0.076445, 0.997074, 0.994156, 0.075998, 13.043088),
    (999, 0.004660, 0.068265, 0.997667, 0.995340, 0.067947, 14.614647),
]


@pytest.mark.parametrize(("t", "bar", "kept", "noise", "sds", "fantasia", "ratio"), GOLDEN)
def test_scaled_linear_schedule(t, bar, kept, noise, sds, fantasia, ratio):
    schedule = NoiseSchedule.scaled_linear()
    found = schedule.alpha_bar(torch.tensor([t]), torch.zeros(1))
    ones = torch.ones(1, 1, 1, 1)
    assert len(schedule) == 1000
    assert float(found) == pytest.approx(bar, abs=1e-6)
    assert float(schedule.add_noise(ones, 0 * ones, torch.tensor([t]))) == pytest.approx(kept, abs=1e-6)
    assert float(schedule.add_noise(0 * ones, ones, torch.tensor([t]))) == pytest.approx(noise, abs=1e-6)
    for name, expected in (("sds", sds), ("fantasia3d", fantasia), ("ratio", ratio), ("uniform", 1.0)):
        assert float(weighted(found, name)) == pytest.approx(expected, rel=2e-5, abs=1e-6)


def test_noise_is_added_in_float32_whatever_the_model_computes_in():
    schedule = NoiseSchedule.scaled_linear()
    latents = torch.full((1, 1, 1, 1), 1.0, dtype=torch.float16)
    noisy = schedule.add_noise(latents, torch.zeros_like(latents), torch.tensor([20]))
    assert noisy.dtype == torch.float32
    assert float(noisy) == pytest.approx(0.990613, abs=1e-6)


@pytest.mark.parametrize(
    ("step", "bounds"),
    [
        (0, (850, 850)),
        (900, (662, 712)),
        (1800, (475, 575)),
        (2700, (288, 438)),
        (3600, (100, 300)),
        (3999, (100, 300)),
    ],
)
def test_the_annealing_of_the_paper(step, bounds):
    low, high = TimeAnnealing().bounds(step, 4000)
    assert (low, high) == bounds


def test_annealing_scales_with_the_number_of_steps_and_can_be_left_out():
    assert TimeAnnealing().bounds(90, 400) == TimeAnnealing().bounds(900, 4000)
    assert TimeAnnealing(share=0).bounds(0, 400) == (100, 300)
    constant = TimeAnnealing(low=0.02, high=0.98, final_low=0.02, final_high=0.98)
    assert constant.bounds(0, 10) == constant.bounds(9, 10) == (20, 980)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"low": 0.9}, "0 < low <= high < 1, got 0.9 and 0.85"), ({"final_low": 0.0}, "got 0.0"), ({"share": 2}, "share")],
)
def test_bounds_that_make_no_sense(wrong, message):
    with pytest.raises(ValueError, match=message):
        TimeAnnealing(**wrong)


def test_views_of_an_object_share_a_timestep():
    generator = torch.Generator().manual_seed(0)
    drawn = torch.stack([draw_timesteps(100, 300, 8, 4, generator) for _ in range(500)])
    assert torch.equal(drawn[:, 0], drawn[:, 3])
    assert not torch.equal(drawn[:, 0], drawn[:, 4])
    # Both bounds belong to it.
    assert (int(drawn.min()), int(drawn.max())) == (100, 300)
    single = draw_timesteps(100, 300, 8, 1, generator)
    assert len(single.unique()) > 4


def test_a_noisier_schedule_has_a_share_of_the_signal():
    plain = NoiseSchedule.scaled_linear()
    noisier = plain.noisier(0.1)
    ratio = [schedule.alpha_bars.double() / (1 - schedule.alpha_bars.double()) for schedule in (plain, noisier)]
    assert torch.allclose(ratio[1] / ratio[0], torch.tensor(0.1, dtype=torch.float64), rtol=1e-3)
    assert torch.allclose(plain.noisier(1.0).alpha_bars, plain.alpha_bars, rtol=1e-6)
