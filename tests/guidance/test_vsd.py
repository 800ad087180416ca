"""The trained second network of variational score distillation, on a tiny MVDream and a tiny Stable Diffusion."""

import itertools

import pytest
import tiny
import torch
from needs import needs

from diff3ds.camera import orbit
from diff3ds.guidance.built_in.exemplar import ExemplarDenoiser
from diff3ds.guidance.networks.latent import Autoencoder
from diff3ds.guidance.networks.mvdream import MVDream
from diff3ds.guidance.networks.stable_diffusion import StableDiffusion
from diff3ds.guidance.objective import ScoreDistillation, step_generator
from diff3ds.guidance.recipe import Recipe
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.guidance.vsd import RATE, Particles

pytestmark = needs("diffusers", "peft", "ftfy")

CAMERAS = orbit([0.0, 90.0, 180.0, 270.0], 15.0, 1.9)
TIMES = torch.full((4,), 500)


def make(kind, dtype=torch.float32, **changes):
    """A prior with the same random weights every time."""
    torch.manual_seed(0)
    autoencoder, schedule = Autoencoder(tiny.make_vae(), 64), NoiseSchedule.scaled_linear()
    if kind == "mvdream":
        return MVDream(tiny.make_mvdream_unet().to(dtype), autoencoder, torch.randn(3, 7, 32), schedule)
    return StableDiffusion(
        tiny.make_unet().to(dtype), autoencoder, torch.randn(6, 7, 32), schedule, "epsilon", **changes
    )


@pytest.fixture
def latents(generator):
    return torch.randn(4, 4, 8, 8, generator=generator)


def seeded(seed=1):
    return torch.Generator().manual_seed(seed)


@pytest.mark.parametrize("kind", ["stable diffusion", pytest.param("mvdream", marks=pytest.mark.slow)])
def test_at_first_it_is_the_prior_and_training_leaves_the_prior_alone(kind, latents):
    prior = make(kind)
    before = prior.predict(latents, TIMES, CAMERAS, ("conditional", "negative"))
    particles = Particles(prior)
    assert torch.equal(prior.predict(latents, TIMES, CAMERAS, ("conditional", "negative")), before)
    with torch.no_grad():
        assert torch.allclose(particles.predict(latents, TIMES, CAMERAS), before[0], atol=1e-5)
    for _ in range(3):
        particles.learn(latents, CAMERAS, seeded())
    with torch.no_grad():
        assert torch.equal(prior.predict(latents, TIMES, CAMERAS, ("conditional", "negative")), before)
        assert not torch.allclose(particles.predict(latents, TIMES, CAMERAS), before[0], atol=1e-4)


@pytest.mark.slow
def test_it_learns_to_denoise_what_it_is_shown(latents):
    """The same noise each time, so that every step must lower the loss."""
    particles = Particles(make("stable diffusion"))
    losses = [particles.learn(latents, CAMERAS, seeded()) for _ in range(8)]
    assert all(after < before for before, after in itertools.pairwise(losses))


@pytest.mark.slow
def test_half_precision_is_trained_in_float32(latents):
    """A step of 1e-4 on a weight of bfloat16 that is larger than 0.03 would be lost."""
    prior = make("stable diffusion", torch.bfloat16)
    particles = Particles(prior)
    assert {tensor.dtype for tensor in particles.state().values()} == {torch.float32}
    assert prior.unet.conv_in.weight.dtype == torch.bfloat16
    losses = [particles.learn(latents, CAMERAS, seeded()) for _ in range(8)]
    assert losses[-1] < losses[0]
    # What starts at 0 moves by the step size at first: Adam's first step is the gradient's sign.
    moved = [t.abs().max() for name, t in particles.state().items() if name.endswith("lora_B.default.weight")]
    assert all(RATE < 1.01 * value < 10 * RATE for value in moved)


def test_a_state_goes_on_bit_for_bit(latents):
    through = Particles(make("stable diffusion"), seed=3)
    for step in range(2):
        through.learn(latents, CAMERAS, seeded(step))
    kept = through.state()
    through.learn(latents, CAMERAS, seeded(2))
    resumed = Particles(make("stable diffusion"), seed=4)
    resumed.restore(kept)
    assert resumed.learned == 2
    resumed.learn(latents, CAMERAS, seeded(2))
    first, second = through.state(), resumed.state()
    assert first.keys() == second.keys()
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert any(not torch.equal(first[name], kept[name]) for name in first)


def test_the_seed_sets_the_start():
    first, same, other = (Particles(make("stable diffusion"), seed).state() for seed in (1, 1, 2))
    assert all(torch.equal(first[name], same[name]) for name in first)
    assert any(not torch.equal(first[name], other[name]) for name in first)


def test_the_state_of_another_network_is_refused():
    with pytest.raises(ValueError, match="the state of another network"):
        Particles(make("mvdream")).restore(Particles(make("stable diffusion")).state())


def test_priors_that_cannot_learn_are_refused():
    with pytest.raises(ValueError, match="does not go with perpendicular negatives"):
        Particles(make("stable diffusion", perp_neg=True))
    without = ExemplarDenoiser(lambda cameras: torch.rand(1, len(cameras), 8, 8, 3), torch.tensor([True]), size=8)
    with pytest.raises(ValueError, match="needs a prior with a network"):
        Particles(without)


@pytest.mark.slow
def test_the_objective_is_what_the_prior_says_less_what_the_particles_say(latents):
    """The first step: particles are the prior's conditional prediction, so only guidance moves the pictures."""
    prior = make("mvdream")

    class Rendering:
        color = torch.rand(4, 32, 32, 3, generator=seeded()).requires_grad_()

    recipe = Recipe(method="vsd", guidance=7.5, weighting="uniform")
    objective = ScoreDistillation(prior, recipe, steps=10, seed=3)
    loss = objective(Rendering(), CAMERAS, 0)
    loss.backward()
    generator = step_generator(3, 0)
    encoded = prior.encode(Rendering.color, generator).detach()
    times = torch.randint(850, 851, (1,), generator=generator).repeat(4)
    noisy = prior.schedule.add_noise(encoded, torch.randn(encoded.shape, generator=generator), times)
    conditional, negative = make("mvdream").predict(noisy, times, CAMERAS, ("conditional", "negative"))
    expected = 6.5 * (conditional - negative)
    assert float(loss.detach()) == pytest.approx(float(expected.square().sum()) / 8, rel=1e-3)
    assert Rendering.color.grad.abs().sum() > 0
    assert objective.particles.learned == 1
    with pytest.raises(ValueError, match="has learned for 1 steps, this is step 5: such a run cannot be resumed"):
        objective(Rendering(), CAMERAS, 5)


def test_only_vsd_trains_a_network():
    assert ScoreDistillation(make("mvdream"), Recipe(method="sds"), steps=10).particles is None
