"""Losses against their definitions."""

import math

import pytest
import torch

from diff3ds.losses import composite_loss, ink_loss, psnr


def test_extra_ink_counts_less_than_missing_ink():
    blank, full = torch.zeros(1, 2, 2), torch.full((1, 2, 2), 0.5)
    assert float(ink_loss(blank, full)) == pytest.approx(0.25)
    assert float(ink_loss(full, blank)) == pytest.approx(0.25 * 0.2)
    assert float(ink_loss(full, blank, extra=1.0)) == pytest.approx(0.25)


def test_gradient_of_the_ink_loss(generator):
    alpha = torch.rand(2, 3, 4, generator=generator, dtype=torch.float64, requires_grad=True)
    target = torch.rand(2, 3, 4, generator=generator, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda a: ink_loss(a, target), alpha)


def test_psnr():
    target = torch.zeros(2, 4, 4, 3)
    color = target.clone()
    color[0] = 0.1
    color[1] = 0.01
    assert psnr(color, target) == pytest.approx((20 + 40) / 2, rel=1e-5)
    assert psnr(target, target) == math.inf


def test_only_known_pixels_count():
    known = torch.tensor([[[True, False]], [[True, True]]])
    target = torch.zeros(2, 1, 2)
    drawn = torch.tensor([[[0.1, 0.9]], [[0.2, 0.3]]])
    assert float(ink_loss(drawn, target, 1.0, known)) == pytest.approx((0.01 + 0.04 + 0.09) / 3)
    color = drawn[..., None].expand(2, 1, 2, 3)
    expected = (-10 * math.log10(0.01) - 10 * math.log10((0.04 + 0.09) / 2)) / 2
    assert psnr(color, torch.zeros(2, 1, 2, 3), known) == pytest.approx(expected, rel=1e-5)
    assert float(ink_loss(drawn, target, 1.0, torch.zeros(2, 1, 2, dtype=torch.bool))) == 0


@pytest.mark.parametrize("shape", [(3,), (2, 5, 6, 3)])
def test_composite_loss_over_a_background_is_that_of_composited_images(generator, shape):
    drawn, target = (torch.rand(2, 5, 6, 4, generator=generator, dtype=torch.float64) for _ in range(2))
    background = torch.rand(shape, generator=generator, dtype=torch.float64)
    over = [x[..., :3] + (1 - x[..., 3:]) * background for x in (drawn, target)]
    loss = composite_loss(drawn[..., :3], drawn[..., 3], target, background)
    squared = (over[0] - over[1]).square().mean(-1)
    torch.testing.assert_close(loss, squared.mean())
    known = torch.rand(2, 5, 6, generator=generator) < 0.5
    loss = composite_loss(drawn[..., :3], drawn[..., 3], target, background, known)
    torch.testing.assert_close(loss, squared[known].mean())


def test_composite_loss_is_the_expectation_over_backgrounds(generator):
    """Gauss's two nodes are exact: the loss is quadratic in the background."""
    drawn, target = (torch.rand(2, 5, 6, 4, generator=generator, dtype=torch.float64) for _ in range(2))
    losses = [
        composite_loss(drawn[..., :3], drawn[..., 3], target, torch.full((3,), 0.5 + side / math.sqrt(12)).double())
        for side in (-1, 1)
    ]
    # The nodes are known to float32 only.
    torch.testing.assert_close(
        composite_loss(drawn[..., :3], drawn[..., 3], target), sum(losses) / 2, rtol=1e-6, atol=0
    )
