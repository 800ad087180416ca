"""The autoencoder that latent priors share, their noise schedule in files, and their network's output as ε."""

import numpy as np
import pytest
import tiny
import torch
from needs import needs
from PIL import Image
from torch.nn.functional import interpolate

from diff3ds.camera import orbit
from diff3ds.guidance.denoiser import gaussian
from diff3ds.guidance.networks import latent
from diff3ds.guidance.networks.latent import Autoencoder, place_autoencoder, predict_noise, read_schedule, step_memory
from diff3ds.guidance.poses import spherical
from diff3ds.guidance.recipe import Work
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.weights.locate import Checkpoint

pytestmark = needs("diffusers")

SIZE = 16


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    return tiny.make_vae().eval().requires_grad_(False)


@pytest.fixture
def pictures(generator):
    return torch.rand(3, SIZE, SIZE, 3, generator=generator)


def seeded(seed=1):
    return torch.Generator().manual_seed(seed)


# Autoencoder


def test_encode_is_the_scaled_sample_of_the_posterior(network, pictures):
    """Pictures in [-1, 1]; the noise is drawn here, by the caller's generator."""
    found = Autoencoder(network, SIZE).encode(pictures, seeded())
    posterior = network.encode(2 * pictures.permute(0, 3, 1, 2) - 1).latent_dist
    noise = gaussian(posterior.mean, seeded())
    assert found.shape == (3, 4, 2, 2)
    assert torch.allclose(found, 0.18215 * (posterior.mean + posterior.std * noise), atol=1e-6)
    assert not torch.allclose(found, 0.18215 * posterior.mean, atol=1e-4)


def test_a_seed_means_the_same_latents_bit_for_bit(network, pictures):
    autoencoder = Autoencoder(network, SIZE)
    first, second, other = (autoencoder.encode(pictures, seeded(s)) for s in (1, 1, 2))
    assert torch.equal(first, second)
    assert not torch.equal(first, other)


def test_the_mode_is_not_scaled(network, pictures):
    """Zero-1-to-3 was trained to see the reference so, beside latents that are."""
    found = Autoencoder(network, SIZE).mode(pictures.requires_grad_())
    assert torch.allclose(found, network.encode(2 * pictures.permute(0, 3, 1, 2) - 1).latent_dist.mode(), atol=1e-6)
    assert not found.requires_grad


def test_decode_undoes_the_scale(network, generator):
    latents = torch.randn(2, 4, 2, 2, generator=generator)
    found = Autoencoder(network, SIZE).decode(latents)
    expected = network.decode(latents / 0.18215).sample.permute(0, 2, 3, 1) / 2 + 0.5
    assert found.shape == (2, SIZE, SIZE, 3)
    assert torch.allclose(found, expected.clamp(0, 1), atol=1e-6)


@pytest.mark.parametrize("size", [SIZE, 56])
def test_gradients_through_encode_by_finite_differences(network, generator, size):
    """The noise is held. Differences are taken of the network in float64, by a step whose square does not show."""
    pictures = torch.rand(3, size, size, 3, generator=generator)
    precise = tiny.make_vae().eval().double()
    precise.load_state_dict({name: tensor.double() for name, tensor in network.state_dict().items()})
    noise = gaussian(torch.zeros(3, 4, 2, 2), seeded()).double()

    def value(x):
        resized = interpolate(x.permute(0, 3, 1, 2), (SIZE, SIZE), mode="bilinear", antialias=True)
        posterior = precise.encode(2 * resized - 1).latent_dist
        return (0.18215 * (posterior.mean + posterior.std * noise)).square().sum()

    x = pictures.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(Autoencoder(network, SIZE).encode(x, seeded()).square().sum(), x)
    direction, step = torch.randn(pictures.shape, generator=seeded(5)), 1e-5
    with torch.no_grad():
        ahead, behind = (value(pictures.double() + s * step * direction.double()) for s in (1, -1))
    assert float((gradient * direction).sum()) == pytest.approx(float(ahead - behind) / (2 * step), rel=1e-3)


@pytest.mark.parametrize("size", [(64, 40), (8, 12)])
def test_pictures_of_another_size_are_resized_as_pillow_does(network, generator, size):
    """Bilinearly, and where they shrink by means over all that a pixel covers, so that no thin line is lost."""
    picture = torch.rand(*size, 3, generator=generator)
    channels = [
        Image.fromarray(picture[..., c].numpy()).resize((SIZE, SIZE), Image.Resampling.BILINEAR) for c in range(3)
    ]
    resized = torch.stack([torch.from_numpy(np.array(channel)) for channel in channels], -1)[None]
    autoencoder = Autoencoder(network, SIZE)
    found, expected = (autoencoder.encode(x, seeded()) for x in (picture[None], resized))
    assert torch.allclose(found, expected, atol=1e-5)


def test_thrift_changes_nothing_but_the_memory(pictures):
    torch.manual_seed(0)
    network, results = tiny.make_vae(), []
    for thrifty in (False, True):
        kept = []
        x = pictures.clone().requires_grad_()
        with torch.autograd.graph.saved_tensors_hooks(lambda t, kept=kept: kept.append(t.nbytes) or t, lambda t: t):
            latents = Autoencoder(network, SIZE, thrifty=thrifty).encode(x, seeded())
        latents.square().sum().backward()
        results.append((latents.detach(), x.grad, sum(kept)))
    (wide, wide_gradient, wide_bytes), (thin, thin_gradient, thin_bytes) = results
    assert torch.allclose(wide, thin, atol=1e-5)
    assert torch.allclose(wide_gradient, thin_gradient, atol=1e-4)
    assert thin_bytes < 0.3 * wide_bytes


def test_float16_is_refused_for_gradients(network):
    with pytest.raises(ValueError, match="float16 gradients overflow"):
        Autoencoder(tiny.make_vae().half(), SIZE)
    assert latent.vae_dtype(torch.float16) == torch.float32
    assert latent.vae_dtype(torch.bfloat16) == torch.bfloat16


def test_bfloat16_gives_float32_latents_and_gradients(pictures):
    x = pictures.requires_grad_()
    latents = Autoencoder(tiny.make_vae().bfloat16(), SIZE).encode(x, seeded())
    latents.sum().backward()
    assert latents.dtype == x.grad.dtype == torch.float32
    assert x.grad.abs().sum() > 0


@pytest.mark.parametrize("size", [0, 12, -8])
def test_sizes_are_multiples_of_eight(network, size):
    with pytest.raises(ValueError, match="multiple of 8"):
        Autoencoder(network, size)


# Memory


def test_thrift_is_for_those_short_of_memory(monkeypatch):
    cpu = torch.device("cpu")
    for free, thrifty in ((None, False), (10**12, False), (10**6, True)):
        monkeypatch.setattr(latent, "free_memory", lambda device, free=free: free)
        assert place_autoencoder(tiny.make_vae(), SIZE, cpu, Work()).thrifty is thrifty


def test_memory_of_a_step():
    """Four pictures of 512 pixels keep 12.8 GB for the way back in float32, a tenth when thrifty."""
    full, half = (step_memory(512, Work(), dtype) for dtype in (torch.float32, torch.bfloat16))
    assert full == pytest.approx(12.8e9 + 1.6e9, rel=0.01)
    assert half == pytest.approx(6.4e9 + 1.6e9, rel=0.01)
    assert step_memory(512, Work(), torch.float32, thrifty=True) < 0.3 * full


def test_memory_of_more_conditions_and_of_training():
    """Each condition takes as much as any other; a pass that trains, as much as four; one is done after the other."""
    two, three, five = (step_memory(256, Work(4, conditions), torch.float32) for conditions in (2, 3, 5))
    assert five - three == 2 * (three - two) > 0
    trained = [step_memory(256, Work(4, conditions, trained=True), torch.float32) for conditions in (2, 4, 5)]
    assert trained == [two + 2 * (three - two), trained[0], five]


# Schedules in files


@pytest.mark.parametrize("prediction", ["epsilon", "v_prediction"])
def test_schedule_and_prediction_are_read(tmp_path, prediction):
    tiny.save_scheduler(tmp_path / "scheduler", prediction)
    schedule, found = read_schedule(Checkpoint(tmp_path))
    assert found == prediction
    assert torch.equal(schedule.alpha_bars, NoiseSchedule.scaled_linear().alpha_bars)
    from diffusers import DDPMScheduler

    theirs = DDPMScheduler(beta_start=0.00085, beta_end=0.012, beta_schedule="scaled_linear").alphas_cumprod
    assert torch.allclose(schedule.alpha_bars, theirs, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"beta_schedule": "linear"}, "expected a scaled_linear schedule from beta_start to beta_end, got linear"),
        ({"beta_start": None}, "expected a scaled_linear schedule"),
        ({"num_train_timesteps": 100}, "expected 1000 timesteps"),
        ({"rescale_betas_zero_snr": True}, "neither listed nor rescaled"),
        ({"prediction_type": "sample"}, "must be epsilon or v_prediction, got sample"),
    ],
)
def test_other_schedules_are_refused(tmp_path, changes, message):
    tiny.save_scheduler(tmp_path / "scheduler", "v_prediction")
    tiny.edit_json(tmp_path / "scheduler" / "scheduler_config.json", **changes)
    with pytest.raises(ValueError, match=message):
        read_schedule(Checkpoint(tmp_path))


# ε of a network


class Recorder(torch.nn.Module):
    """Stands for a UNet: its output is its input's first four channels times the mean of its context."""

    def __init__(self):
        super().__init__()
        self.conv_in = torch.nn.Conv2d(8, 4, 1).bfloat16()
        self.seen = []

    def forward(self, sample, timestep, encoder_hidden_states, class_labels=None):
        self.seen.append((sample, timestep, encoder_hidden_states, class_labels))
        return type("Output", (), {"sample": sample[:, :4] * encoder_hidden_states.mean((1, 2))[:, None, None, None]})


def test_conditions_stay_with_their_pictures(generator):
    """Two pictures, three conditions, one pass: rows are condition by condition, and in the network's format."""
    unet, noisy = Recorder(), torch.randn(2, 4, 2, 2, generator=generator)
    contexts = [torch.full((2, 5, 3), float(value)) for value in (1, 2, 4)]
    beside = [torch.full((2, 4, 2, 2), float(value)) for value in (1, 2, 4)]
    labels, times = torch.tensor([[1.0], [2.0]]), torch.tensor([10, 900])
    found = predict_noise(
        unet, noisy, times, contexts, NoiseSchedule.scaled_linear(), "epsilon", labels=labels, beside=beside
    )
    assert found.shape == (3, 2, 4, 2, 2)
    assert found.dtype == torch.float32
    assert torch.allclose(found, noisy * torch.tensor([1, 2, 4])[:, None, None, None, None], rtol=0.01)
    ((sample, timestep, context, seen),) = unet.seen
    assert sample.dtype == context.dtype == seen.dtype == torch.bfloat16
    assert timestep.tolist() == [10, 900] * 3
    assert seen.flatten().tolist() == [1, 2] * 3
    assert sample[:, 4, 0, 0].tolist() == [1, 1, 2, 2, 4, 4]


# Angles of cameras


def test_angles_are_those_of_orbit():
    azimuth, elevation, distance = [0.0, 90.0, -90.0, 179.0, 30.0], [0.0, 10.0, -20.0, 45.0, 89.0], [1, 2, 3, 4, 5]
    found = spherical(orbit(azimuth, elevation, [float(d) for d in distance]))
    for values, expected in zip(found, (azimuth, elevation, distance), strict=True):
        assert torch.allclose(values, torch.tensor(expected, dtype=torch.float64), atol=1e-3)
