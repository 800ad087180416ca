"""Losses that compare renderings with target images."""

from diff3ds._shapes import Bool, Float, Tensor

# Weight of ink that no target shows, against ink that is missing. Edge maps leave hidden edges out, so extra ink is
# cheap; measured on two CAD models, .2 finds more of the edges than 1 (F-score .92 against .77).
EXTRA_INK = 0.2


def ink_loss(
    alpha: Float[Tensor, "V H W"],
    target: Float[Tensor, "V H W"],
    extra: float = EXTRA_INK,
    known: Bool[Tensor, "V H W"] | None = None,
) -> Float[Tensor, ""]:
    """Mean squared difference of ink, asymmetric: ink beyond the target counts `extra` times.

    Args:
        alpha: ink drawn, in [0, 1], as `Rendering.alpha`.
        target: ink wanted, in [0, 1].
        extra: weight of pixels where alpha > target; 1 is symmetric.
        known: pixels that count; default all.
    """
    missing = (target - alpha).clamp(min=0)
    surplus = (alpha - target).clamp(min=0)
    return _mean(missing.square() + extra * surplus.square(), known)


def color_loss(
    color: Float[Tensor, "V H W 3"], target: Float[Tensor, "V H W 3"], known: Bool[Tensor, "V H W"] | None = None
) -> Float[Tensor, ""]:
    """Mean squared difference of colours, over the pixels that are known; default all."""
    return _mean((color - target).square().mean(-1), known)


def composite_loss(
    color: Float[Tensor, "V H W 3"],
    alpha: Float[Tensor, "V H W"],
    target: Float[Tensor, "V H W 4"],
    background: Float[Tensor, " 3"] | Float[Tensor, "V H W 3"] | None = None,
    known: Bool[Tensor, "V H W"] | None = None,
) -> Float[Tensor, ""]:
    """Mean squared difference of drawings and pictures with alpha, both put over a background.

    With c the difference of colours times alpha, and a that of alpha, it is (c - a b)^2 over the background b.

    Args:
        color: drawn over black: colour times alpha.
        alpha: drawn.
        target: RGB times alpha, and alpha.
        background: colour, of all pixels or of each; None for the expectation over all colours, which fits alpha as
            well: values that are uniform in [0, 1] have the mean 1/2 and the variance 1/12.
        known: pixels that count; default all.
    """
    c, a = color - target[..., :3], (alpha - target[..., 3])[..., None]
    error = (c - a / 2).square() + a.square() / 12 if background is None else (c - a * background).square()
    return _mean(error.mean(-1), known)


def psnr(
    color: Float[Tensor, "V H W 3"], target: Float[Tensor, "V H W 3"], known: Bool[Tensor, "V H W"] | None = None
) -> float:
    """Peak signal-to-noise ratio in dB of images in [0, 1], the mean over views; infinite for equal images.

    Only pixels that are known count; default all.
    """
    error = (color.clamp(0, 1) - target).square().mean(-1)
    masks = [None] * len(error) if known is None else list(known)
    values = [_mean(e, mask) for e, mask in zip(error, masks, strict=True)]
    return sum(float(-10 * value.log10()) for value in values) / len(values)


def _mean(values: Float[Tensor, "*S"], known: Bool[Tensor, "*S"] | None) -> Float[Tensor, ""]:
    """Mean over the known pixels; 0 if there are none."""
    if known is None:
        return values.mean()
    return (values * known).sum() / known.sum().clamp(min=1)
