"""Losses that compare renderings with target images."""

from diff3ds._shapes import Float, Tensor

# Weight of ink that no target shows, against ink that is missing. Edge maps leave hidden edges out, so extra ink is
# cheap; measured on two CAD models, .2 finds more of the edges than 1 (F-score .92 against .77).
EXTRA_INK = 0.2


def ink_loss(
    alpha: Float[Tensor, "V H W"], target: Float[Tensor, "V H W"], extra: float = EXTRA_INK
) -> Float[Tensor, ""]:
    """Mean squared difference of ink, asymmetric: ink beyond the target counts `extra` times.

    Args:
        alpha: ink drawn, in [0, 1], as `Rendering.alpha`.
        target: ink wanted, in [0, 1].
        extra: weight of pixels where alpha > target; 1 is symmetric.
    """
    missing = (target - alpha).clamp(min=0)
    surplus = (alpha - target).clamp(min=0)
    return (missing.square() + extra * surplus.square()).mean()


def color_loss(color: Float[Tensor, "V H W 3"], target: Float[Tensor, "V H W 3"]) -> Float[Tensor, ""]:
    """Mean squared difference of colours."""
    return (color - target).square().mean()


def psnr(color: Float[Tensor, "V H W 3"], target: Float[Tensor, "V H W 3"]) -> float:
    """Peak signal-to-noise ratio in dB of images in [0, 1], the mean over views; infinite for equal images."""
    error = (color.clamp(0, 1) - target).square().flatten(1).mean(1)
    return float((-10 * error.log10()).mean())
