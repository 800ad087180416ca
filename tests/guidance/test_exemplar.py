"""The exact prior of a finite set of members against its closed form, and what every method makes of it."""

import math
from dataclasses import dataclass, replace
from typing import get_args

import pytest
import torch

import diff3ds as ds
from diff3ds.guidance import formulas
from diff3ds.guidance.built_in.exemplar import ExemplarDenoiser
from diff3ds.guidance.denoiser import gaussian
from diff3ds.guidance.methods import ScoreQuery, score
from diff3ds.guidance.objective import ScoreDistillation, step_generator
from diff3ds.guidance.recipe import Method, Recipe, TimeAnnealing

SIZE, MEMBERS = 8, 3


def draw(cameras: ds.Cameras) -> torch.Tensor:
    """Members are soft discs of different radius, darker from one side than from the other."""
    height, width = cameras.size
    y, x = torch.meshgrid(*(2 * (torch.arange(n) + 0.5) / n - 1 for n in (height, width)), indexing="ij")
    shade = 0.4 + 0.3 * torch.nn.functional.normalize(cameras.centers, dim=1)[:, 0]
    discs = [torch.sigmoid(8 * (radius - (x**2 + y**2).sqrt())) for radius in (0.3, 0.5, 0.8)]
    return torch.stack([1 - shade[:, None, None] * disc for disc in discs])[..., None].expand(-1, -1, -1, -1, 3)


@pytest.fixture
def prior() -> ExemplarDenoiser:
    return ExemplarDenoiser(draw, torch.tensor([False, True, True]), SIZE, group=2)


@pytest.fixture
def cameras() -> ds.Cameras:
    return ds.orbit([0.0, 90.0, 180.0, 270.0], 10.0, size=SIZE)


def test_pixels_are_standardised_and_come_back(prior, cameras):
    images = draw(cameras)[1]
    latents = prior.encode(images, torch.Generator())
    assert torch.allclose(prior.decode(latents), images, atol=1e-6)
    many = torch.cat(
        [prior.encode(x, torch.Generator()) for x in draw(ds.orbit([45.0 * i for i in range(8)], 15, 1.9, size=SIZE))]
    )
    assert abs(float(many.mean())) < 1e-5
    assert float(many.std()) == pytest.approx(1, abs=1e-5)
    larger = draw(cameras.resize(4 * SIZE))[1]
    assert float((prior.encode(larger, torch.Generator()) - latents).abs().mean()) < 0.1


def test_gradients_pass_through_the_encoder(prior, cameras):
    images = draw(cameras)[1].clone().requires_grad_()
    latents = prior.encode(images, torch.Generator())
    upstream = torch.randn(latents.shape, generator=torch.Generator().manual_seed(0))
    (gradient,) = torch.autograd.grad((latents * upstream).sum(), images)
    shifted = prior.encode(images.detach() + 0.125 * upstream.movedim(1, -1), torch.Generator())
    assert float(((shifted - latents.detach()) * upstream).sum()) == pytest.approx(
        float((gradient * 0.125 * upstream.movedim(1, -1)).sum()), rel=1e-4
    )


@pytest.mark.parametrize("timestep", [100, 500, 900])
def test_predictions_are_the_posterior_mean_over_members(prior, cameras, timestep):
    """Written out with loops, Gaussians and Bayes' rule."""
    generator = torch.Generator().manual_seed(timestep)
    clean = [prior.encode(x, generator).double() for x in draw(cameras)]
    timesteps = torch.full((4,), timestep)
    noisy = 0.5 * torch.randn(4, 3, SIZE, SIZE, generator=generator)
    conditional, unconditional = prior.predict(noisy, timesteps, cameras, ("conditional", "negative")).double()
    bar = float(prior.schedule.alpha_bars[timestep])
    for group in (slice(0, 2), slice(2, 4)):
        logs = [-float((noisy[group] - math.sqrt(bar) * x[group]).square().sum()) / (2 * (1 - bar)) for x in clean]
        for found, rows in ((conditional, (1, 2)), (unconditional, (0, 1, 2))):
            most = max(logs[i] for i in rows)
            weights = {i: math.exp(logs[i] - most) for i in rows}
            mean = sum(w * clean[i][group] for i, w in weights.items()) / sum(weights.values())
            expected = (noisy[group] - math.sqrt(bar) * mean) / math.sqrt(1 - bar)
            assert torch.allclose(found[group], expected.double(), atol=2e-4)


def test_predictions_are_the_score_of_the_mixture(prior, cameras):
    """ε = -√(1 - ᾱ) ∇ log p(z_t) (Song and Ermon 2019), by automatic differentiation of the mixture."""
    timesteps = torch.full((4,), 850)
    noisy = torch.randn(4, 3, SIZE, SIZE, generator=torch.Generator().manual_seed(3)).requires_grad_()
    kept = prior.schedule.alpha_bar(timesteps, noisy)
    members = torch.stack([prior.encode(x, torch.Generator()) for x in draw(cameras)])
    differences = (noisy - kept.sqrt() * members).square() / (2 * (1 - kept))
    density = -differences.reshape(MEMBERS, 2, -1).sum(2)
    density = density.logsumexp(0).sum()
    (score,) = torch.autograd.grad(density, noisy)
    (predicted,) = prior.predict(noisy.detach(), timesteps, cameras, ("unconditional",))
    assert torch.allclose(predicted, -(1 - kept).sqrt() * score, atol=1e-4)


def test_views_of_a_group_decide_together(prior, cameras):
    """What the first view shows changes what is expected of the second, and nothing of the other group."""
    timesteps = torch.full((4,), 600)
    noisy = torch.zeros(4, 3, SIZE, SIZE)
    other = noisy.clone()
    other[0] = prior.encode(draw(cameras)[2], torch.Generator())[0]
    (before,), (after,) = (prior.predict(x, timesteps, cameras, ("unconditional",)) for x in (noisy, other))
    assert float((before[1] - after[1]).abs().max()) > 1e-2
    assert torch.equal(before[2:], after[2:])


def test_views_must_fill_groups_and_a_member_must_fit(prior):
    three = ds.orbit([0.0, 90.0, 180.0], size=SIZE)
    with pytest.raises(ValueError, match="sees 2 views of an object at once: give a multiple of 2, got 3"):
        prior.predict(torch.zeros(3, 3, SIZE, SIZE), torch.zeros(3, dtype=torch.long), three, ("conditional",))
    with pytest.raises(ValueError, match="none of the members fits"):
        ExemplarDenoiser(draw, torch.zeros(MEMBERS, dtype=torch.bool), SIZE)


# Methods


def look_at(
    prior: ExemplarDenoiser, cameras: ds.Cameras, member: int, timestep: int, seed: int = 0, **other
) -> ScoreQuery:
    latents = prior.encode(draw(cameras)[member], torch.Generator())
    values = {"guidance": 1.0, "rescale": 0.5, **other}
    timesteps = torch.full((4,), timestep)
    return ScoreQuery(prior, latents, timesteps, 100, cameras, generator=torch.Generator().manual_seed(seed), **values)


@pytest.fixture
def only() -> ExemplarDenoiser:
    """A prior that knows a single object."""
    return ExemplarDenoiser(lambda c: draw(c)[1:2], torch.tensor([True]), SIZE, group=2)


# All but vsd, which trains a network, and this prior is none.
@pytest.mark.parametrize("method", [m for m in get_args(Method) if m != "vsd"])
def test_what_is_right_already_is_left_alone(only, cameras, method):
    query = look_at(only, cameras, 1, 300)
    found = score(method, replace(query, latents=only.encode(draw(cameras)[1], torch.Generator())))
    # Inversion ends near the latents only, because its steps are finite.
    assert float(found.gradient.abs().max()) < (0.02 if method in ("ism", "sdi", "asd") else 2e-3)


@pytest.mark.parametrize("method", ["sds", "reconstruction", "asd", "sdi"])
def test_a_prior_of_one_object_pulls_straight_towards_it(only, cameras, method):
    wanted = only.encode(draw(cameras)[1], torch.Generator())
    start = only.encode(draw(cameras)[2], torch.Generator())
    found = score(method, replace(look_at(only, cameras, 1, 500), latents=start))
    away = start - wanted
    assert float(torch.cosine_similarity(found.gradient.flatten(1), away.flatten(1)).min()) > 0.999
    assert torch.allclose(found.clean, wanted, atol=0.05)


def test_interval_score_matching_pulls_towards_what_fits(cameras):
    """With one object alone it is 0: every step of the inversion ends where the object's own noise would be."""
    both = ExemplarDenoiser(lambda c: draw(c)[:2], torch.tensor([False, True]), SIZE, group=2)
    query = look_at(both, cameras, 0, 500, guidance=7.5)
    found = score("ism", query)
    away = query.latents - both.encode(draw(cameras)[1], torch.Generator())
    assert float(torch.cosine_similarity(found.gradient.flatten(1), away.flatten(1)).min()) > 0.99


def test_sds_is_the_prediction_less_the_noise(prior, cameras):
    query = look_at(prior, cameras, 0, 700, seed=4, guidance=3.0)
    noise = gaussian(query.latents, torch.Generator().manual_seed(4))
    noisy = prior.schedule.add_noise(query.latents, noise, query.timesteps)
    conditional, baseline = prior.predict(noisy, query.timesteps, cameras, ("conditional", "negative"))
    expected = baseline + 3 * (conditional - baseline) - noise
    assert torch.equal(score("sds", query).gradient, expected)
    # Reconstruction without rescaling is the same, in latents (paper, with its misprint corrected).
    kept = query.alpha_bar(query.timesteps)
    again = score("reconstruction", look_at(prior, cameras, 0, 700, seed=4, guidance=3.0, rescale=0.0))
    assert torch.allclose(again.gradient, formulas.weighted(kept, "ratio") * expected, atol=1e-3)


def test_classifier_scores_are_what_the_phrase_adds(prior, cameras):
    """Nothing, where the conditional and the unconditional posterior agree; without bound by the noise otherwise."""
    agree = score("csd", look_at(prior, cameras, 1, 100))
    assert float(agree.gradient.abs().max()) < 1e-4
    differ = score("csd", look_at(prior, cameras, 0, 100))
    assert float(differ.gradient.abs().max()) > 0.1
    noise_free = score("nfsd", look_at(prior, cameras, 0, 700, guidance=0.0))
    # With equal unconditional and negative predictions nothing is left of it at high noise without guidance.
    assert float(noise_free.gradient.abs().max()) == 0


# The objective


@dataclass(frozen=True)
class Picture:
    color: torch.Tensor


def objective(prior, **recipe) -> ScoreDistillation:
    return ScoreDistillation(prior, Recipe(guidance=1.0, **recipe), steps=10, seed=7)


def test_the_loss_pulls_images_towards_the_members(only, cameras):
    images = draw(cameras)[2].clone()
    for step in range(40):
        images.requires_grad_()
        (gradient,) = torch.autograd.grad(objective(only)(Picture(images), cameras, min(step, 9)), images)
        images = (images - 0.05 * gradient * len(cameras) * only._spread**2).detach()
    assert float((images - draw(cameras)[1]).abs().max()) < 0.1


def test_a_step_repeats_bit_for_bit_and_steps_differ(prior, cameras):
    images = draw(cameras)[0].clone().requires_grad_()
    values = [objective(prior, method="sds")(Picture(images), cameras, step) for step in (3, 3, 4)]
    gradients = [torch.autograd.grad(value, images)[0] for value in values]
    assert torch.equal(gradients[0], gradients[1])
    assert not torch.equal(gradients[0], gradients[2])
    seeds = {step_generator(seed, step).initial_seed() for seed in range(20) for step in range(20)}
    assert len(seeds) == 400


def test_weights_and_limits_act_on_the_gradient(prior, cameras):
    def gradient(**recipe) -> torch.Tensor:
        images = draw(cameras)[0].clone().requires_grad_()
        constant = TimeAnnealing(0.85, 0.85, 0.85, 0.85)
        loss = objective(prior, method="sds", annealing=constant, **recipe)(Picture(images), cameras, 0)
        return torch.autograd.grad(loss, images)[0]

    plain = gradient(weighting="uniform")
    assert torch.allclose(gradient(weighting="sds"), 0.976701 * plain, rtol=1e-4, atol=1e-7)
    limit = 0.01
    assert float(gradient(clip=limit).abs().max()) == pytest.approx(limit / len(cameras) / prior._spread, rel=1e-4)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"rescale": 1.5}, "rescale must lie in"),
        ({"clip": 0.0}, "clip must be positive"),
        ({"guidance": math.inf}, "guidance must be finite"),
    ],
)
def test_recipes_that_make_no_sense(wrong, message):
    with pytest.raises(ValueError, match=message):
        Recipe(**wrong)
