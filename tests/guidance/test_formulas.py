"""The formulas of score distillation against identities and closed forms."""

import pytest
import torch

from diff3ds.guidance import formulas
from diff3ds.guidance.schedule import NoiseSchedule

SHAPE = (4, 3, 5, 6)


def images(count: int, seed: int = 0) -> list[torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return list(torch.randn(count, *SHAPE, generator=generator, dtype=torch.float64))


@pytest.fixture(params=[20, 300, 850])
def alpha_bar(request) -> torch.Tensor:
    return NoiseSchedule.scaled_linear().alpha_bar(torch.full((4,), request.param), torch.zeros(1)).double()


def noisy(clean, noise, alpha_bar):
    return alpha_bar.sqrt() * clean + (1 - alpha_bar).sqrt() * noise


def test_latents_noise_and_v_are_three_views_of_one_thing(alpha_bar):
    clean, noise = images(2)
    mixed = noisy(clean, noise, alpha_bar)
    v = alpha_bar.sqrt() * noise - (1 - alpha_bar).sqrt() * clean
    assert torch.allclose(formulas.epsilon_from_v(v, mixed, alpha_bar), noise)
    assert torch.allclose(formulas.clean_from_epsilon(noise, mixed, alpha_bar), clean, atol=1e-10)
    assert torch.allclose(formulas.epsilon_from_clean(clean, mixed, alpha_bar), noise)


def test_noise_less_noise_is_latents_less_latents(alpha_bar):
    """The paper prints 1 - √ᾱ in the denominator; it is √(1 - ᾱ)."""
    clean, noise, predicted = images(3)
    mixed = noisy(clean, noise, alpha_bar)
    seen = formulas.clean_from_epsilon(predicted, mixed, alpha_bar)
    factor = alpha_bar.sqrt() / (1 - alpha_bar).sqrt()
    assert torch.allclose(predicted - noise, factor * (clean - seen), atol=1e-10)


def test_guidance_counts_from_the_unconditional_prediction():
    conditional, unconditional = images(2)
    assert torch.allclose(formulas.guided(conditional, unconditional, 1.0), conditional)
    assert torch.allclose(formulas.guided(conditional, unconditional, 0.0), unconditional)
    twice = formulas.guided(conditional, unconditional, 2.0)
    assert torch.allclose(twice - conditional, conditional - unconditional)


def test_the_loss_has_the_gradient_it_was_given():
    latents, gradient = images(2)
    latents = latents.float().requires_grad_()
    gradient = gradient.float()
    formulas.loss_of(latents, gradient).backward()
    assert torch.allclose(latents.grad, gradient / 4, atol=1e-6)


def test_the_loss_does_not_follow_the_prediction():
    """A gradient through the target, or through the network, would double or spoil it."""
    latents = images(1)[0].float().requires_grad_()
    formulas.loss_of(latents, 3 * latents).backward()
    assert torch.allclose(latents.grad, 3 * latents.detach() / 4, atol=1e-6)


def test_gradients_are_clipped_and_what_is_not_finite_is_none():
    latents = torch.zeros(1, 1, 1, 4, requires_grad=True)
    gradient = torch.tensor([[[[5.0, -5.0, 0.5, float("nan")]]]])
    formulas.loss_of(latents, gradient, clip=2.0).backward()
    assert latents.grad.flatten().tolist() == [2.0, -2.0, 0.5, 0.0]
    half = torch.zeros(1, 1, 1, 2, dtype=torch.float16, requires_grad=True)
    formulas.loss_of(half, torch.tensor([[[[300.0, -300.0]]]], dtype=torch.float16)).backward()
    assert half.grad.flatten().tolist() == [300.0, -300.0]


def test_an_image_without_a_finite_gradient_makes_the_loss_nan():
    """As 0 it would go unnoticed: a network that predicts NaN moves nothing, and nobody would see why."""
    latents = torch.zeros(2, 1, 1, 2, requires_grad=True)
    for broken in (float("nan"), float("inf")):
        gradient = torch.tensor([[[[1.0, 2.0]]], [[[broken, broken]]]])
        assert formulas.loss_of(latents, gradient).isnan()
        gradient[1, 0, 0, 0] = 3.0
        assert formulas.loss_of(latents, gradient).item() == (1 + 4 + 9) / 2 / 2


def test_reconstruction_without_rescaling_is_sds_with_its_own_weight(alpha_bar):
    clean, noise, predicted = images(3)
    mixed = noisy(clean, noise, alpha_bar)
    gradient = clean - formulas.clean_from_epsilon(predicted, mixed, alpha_bar)
    assert torch.allclose(gradient, formulas.weighted(alpha_bar, "ratio") * (predicted - noise), atol=1e-9)


def test_rescaling_restores_the_contrast_of_all_views_of_an_object():
    guided, conditional = images(2)
    guided = 7 * guided
    guided[:2] *= 3
    full = formulas.rescaled(guided, conditional, 1.0, group=2)
    for rows in (slice(0, 2), slice(2, 4)):
        assert float(full[rows].std()) == pytest.approx(float(conditional[rows].std()))
    # One factor for the object: its views keep their contrasts relative to each other.
    assert torch.allclose(full[0] * (guided[1] / guided[0]), full[1])
    assert torch.equal(formulas.rescaled(guided, conditional, 0.0, group=2), guided)
    assert torch.allclose(formulas.rescaled(guided, conditional, 0.5, group=2), (full + guided) / 2)


def test_perp_neg_goes_sideways_only():
    conditional, unconditional, first, second = images(4)
    weights = torch.tensor([[-1.0, -0.5, 0.0, -2.0], [-0.3, 0.0, -0.7, 0.0]], dtype=torch.float64)
    found = formulas.perp_neg(conditional, unconditional, torch.stack([first, second]), weights)
    main = conditional - unconditional
    added = found - conditional
    assert torch.allclose((added * main).sum((1, 2, 3)), torch.zeros(4, dtype=torch.float64), atol=1e-9)
    for image in range(4):
        expected = torch.zeros_like(main[image])
        for negative, weight in ((first, weights[0]), (second, weights[1])):
            d = negative[image] - unconditional[image]
            share = (d * main[image]).sum() / main[image].square().sum()
            expected += weight[image] * (d - share * main[image])
        assert torch.allclose(added[image], expected)
    # A negative prediction equal to the conditional one says nothing.
    same = formulas.perp_neg(conditional, unconditional, conditional[None], -torch.ones(1, 4, dtype=torch.float64))
    assert torch.allclose(same, conditional)


def test_classifier_score_and_noise_free():
    conditional, unconditional, negative = images(3)
    assert torch.equal(formulas.classifier_score(conditional, unconditional), conditional - unconditional)
    late = torch.tensor([0.0, 1.0, 0.0, 1.0], dtype=torch.float64)
    found = formulas.noise_free(conditional, unconditional, negative, 7.5, late)
    guidance = 7.5 * (conditional - unconditional)
    assert torch.allclose(found[0], (unconditional - negative + guidance)[0])
    assert torch.allclose(found[1], (unconditional + guidance)[1])


def test_ddim_steps_follow_the_noise_both_ways(alpha_bar):
    clean, noise = images(2)
    start = NoiseSchedule.scaled_linear().alpha_bar(torch.full((4,), 500), torch.zeros(1)).double()
    there = formulas.ddim_step(noisy(clean, noise, start), noise, start, alpha_bar)
    assert torch.allclose(there, noisy(clean, noise, alpha_bar))
    back = formulas.ddim_step(there, noise, alpha_bar, start)
    assert torch.allclose(back, noisy(clean, noise, start))
    # With fresh noise of a deviation the total stays what the schedule says.
    part = formulas.ddim_step(noisy(clean, noise, start), noise, start, alpha_bar, 0.05)
    kept = (part - alpha_bar.sqrt() * clean) / noise
    assert torch.allclose(kept.square() + 0.05**2, (1 - alpha_bar).expand_as(kept))
