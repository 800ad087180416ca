"""The formulas of score distillation, each once. Latents are z, noise ε, predictions of the noise e.

A distillation moves the latents of a rendering along a gradient with respect to them, which is made of predictions
and never passes through the network (Poole et al. 2023). `alpha_bar` is `NoiseSchedule.alpha_bar`, (B, 1, 1, 1).
"""

import math

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.guidance.recipe import Weighting

Images = Float[Tensor, "B C H W"]
PerImage = Float[Tensor, "B 1 1 1"]

# Keeps a ratio of standard deviations finite.
TINY = 1e-8
# Below this squared norm a direction counts as none.
LEAST_SQUARE = 1e-6


def epsilon_from_v(v: Images, noisy: Images, alpha_bar: PerImage) -> Images:
    """ε of a network that predicts v = √ᾱ ε - √(1 - ᾱ) z (Salimans and Ho 2022)."""
    return alpha_bar.sqrt() * v + (1 - alpha_bar).sqrt() * noisy


def clean_from_epsilon(epsilon: Images, noisy: Images, alpha_bar: PerImage) -> Images:
    """The latents ẑ₀ without noise that a prediction of the noise stands for."""
    return (noisy - (1 - alpha_bar).sqrt() * epsilon) / alpha_bar.sqrt()


def epsilon_from_clean(clean: Images, noisy: Images, alpha_bar: PerImage) -> Images:
    """The noise that a prediction of the latents stands for."""
    return (noisy - alpha_bar.sqrt() * clean) / (1 - alpha_bar).sqrt()


def guided(conditional: Images, baseline: Images, guidance: float) -> Images:
    """Classifier-free guidance, e_unc + λ (e_cond - e_unc): λ = 1 is the conditional prediction itself.

    Some implementations write e_cond + s (e_cond - e_unc), which is this with λ = s + 1.
    """
    return baseline + guidance * (conditional - baseline)


def weighted(alpha_bar: PerImage, weighting: Weighting) -> PerImage:
    """w(t): 1 - ᾱ (sds), 1 (uniform), √ᾱ (1 - ᾱ) (fantasia3d), or √(1 - ᾱ) / √ᾱ (ratio), that of reconstruction."""
    if weighting == "sds":
        return 1 - alpha_bar
    if weighting == "fantasia3d":
        return alpha_bar.sqrt() * (1 - alpha_bar)
    if weighting == "ratio":
        return ((1 - alpha_bar) / alpha_bar).sqrt()
    return torch.ones_like(alpha_bar)


def loss_of(latents: Images, gradient: Images, clip: float | None = None) -> Float[Tensor, ""]:
    """A loss whose gradient with respect to the latents is `gradient` / B: half the squared distance to z - gradient.

    An entry of the gradient that is not finite counts as 0. An image with no finite one makes the loss NaN, so that a
    run with a broken prior stops instead of going on unmoved; on a GPU nothing waits for it.

    Args:
        clip: entries of the gradient are limited to ± this.
    """
    gradient = gradient.detach().float()
    sound = gradient.isfinite().flatten(1).any(1).all()
    gradient = gradient.nan_to_num(0.0, 0.0, 0.0)
    if clip is not None:
        gradient = gradient.clamp(-clip, clip)
    latents = latents.float()
    target = (latents - gradient).detach()
    loss = 0.5 * (latents - target).square().sum() / len(latents)
    return torch.where(sound, loss, torch.full_like(loss, math.nan))


def rescaled(guided: Images, conditional: Images, fraction: float, group: int) -> Images:
    """Guided latents ẑ₀ with their contrast brought a fraction of the way to that of the conditional ones.

    A large guidance weight exaggerates contrast (Lin et al. 2024, section 3.4). The standard deviations are over all
    views of an object.
    """
    spread = [x.reshape(-1, group * x[0].numel()).std(1) + TINY for x in (conditional, guided)]
    factor = (spread[0] / spread[1]).repeat_interleave(group)[:, None, None, None]
    return guided * (fraction * factor + 1 - fraction)


def perpendicular(direction: Images, main: Images) -> Images:
    """The part of each image's direction that is at right angles to its main one."""
    along = (direction * main).sum((1, 2, 3), keepdim=True)
    return direction - along / main.square().sum((1, 2, 3), keepdim=True).clamp(min=LEAST_SQUARE) * main


def perp_neg(
    conditional: Images, unconditional: Images, negatives: Float[Tensor, "M B C H W"], weights: Float[Tensor, "M B"]
) -> Images:
    """A conditional prediction away from negative ones, but only at right angles to itself (Armandpour et al. 2023).

    Guidance with it, e_unc + λ (this - e_unc), is the published formula e_unc + λ (d + Σ wᵢ perp(dᵢ, d)).
    """
    main = conditional - unconditional
    turned = main.clone()
    for negative, weight in zip(negatives, weights, strict=True):
        turned = turned + weight[:, None, None, None] * perpendicular(negative - unconditional, main)
    return unconditional + turned


def classifier_score(conditional: Images, unconditional: Images) -> Images:
    """Classifier score distillation: e_cond - e_unc, what the phrase adds (Yu et al. 2024)."""
    return conditional - unconditional


def noise_free(
    conditional: Images, unconditional: Images, negative: Images, guidance: float, late: Float[Tensor, " B"]
) -> Images:
    """Noise-free score distillation: δ_D + λ (e_cond - e_unc) (Katzir et al. 2024).

    Args:
        late: 1 for images at low noise (t < 200), whose δ_D is e_unc; 0 for others, whose δ_D is e_unc - e_neg.
    """
    domain = unconditional - (1 - late[:, None, None, None]) * negative
    return domain + guidance * (conditional - unconditional)


def ddim_step(
    noisy: Images, epsilon: Images, now: PerImage, then: PerImage, deviation: PerImage | float = 0.0
) -> Images:
    """Noisy latents brought from ᾱ = `now` to `then`, up or down (Song et al. 2021, equation 12), without noise.

    Args:
        deviation: standard deviation of the noise that the caller adds.
    """
    clean = clean_from_epsilon(epsilon, noisy, now)
    kept = (1 - then - torch.as_tensor(deviation) ** 2).clamp(min=0)
    return then.sqrt() * clean + kept.sqrt() * epsilon
