"""Structural similarity against closed forms and against a computation by scipy's filters."""

import math

import numpy as np
import pytest
import torch

from diff3ds.metrics.ssim import C1, C2, ssim


def test_equal_images_have_one_and_constant_images_the_luminance_term(generator):
    image = torch.rand(2, 16, 20, 3, generator=generator)
    assert ssim(image, image) == pytest.approx(1, abs=1e-12)
    a, b = 0.3, 0.8
    expected = (2 * a * b + C1) / (a**2 + b**2 + C1)
    constant = ssim(torch.full((1, 16, 16, 3), a), torch.full((1, 16, 16, 3), b))
    assert constant == pytest.approx(expected, rel=1e-6)


def test_an_inverted_image_is_anticorrelated():
    """a and 1 - a of mean a half: the covariance is minus the variance."""
    board = (torch.arange(22)[:, None] + torch.arange(22)) % 2
    image = board[None, :, :, None].expand(1, -1, -1, 3).double()
    # Over the Gaussian window a checkerboard's mean is one half up to 1e-9 or so, and its variance a quarter.
    assert ssim(image, 1 - image) == pytest.approx((C2 - 2 * 0.25) / (C2 + 2 * 0.25), abs=1e-6)


@pytest.mark.parametrize("size", [(11, 11), (13, 29)])
def test_against_the_filters_of_scipy(size):
    ndimage = pytest.importorskip("scipy.ndimage")
    rng = np.random.default_rng(5)
    a = rng.random((*size, 3))
    b = np.clip(a + 0.2 * rng.normal(size=a.shape), 0, 1)

    def mean(values):
        # A radius of 5 pixels; the windows that lie in the image are those 5 pixels from its border.
        return ndimage.gaussian_filter(values, 1.5, radius=5)[5:-5, 5:-5]

    scores = []
    for x, y in zip(np.moveaxis(a, 2, 0), np.moveaxis(b, 2, 0), strict=True):
        mx, my = mean(x), mean(y)
        vx, vy, cov = mean(x * x) - mx**2, mean(y * y) - my**2, mean(x * y) - mx * my
        scores.append((2 * mx * my + 1e-4) * (2 * cov + 9e-4) / ((mx**2 + my**2 + 1e-4) * (vx + vy + 9e-4)))
    assert ssim(torch.from_numpy(a)[None], torch.from_numpy(b)[None]) == pytest.approx(np.mean(scores), abs=1e-12)


def test_only_windows_of_known_pixels_count(generator):
    image = torch.rand(2, 24, 24, 3, generator=generator)
    wrong = image.clone()
    wrong[:, :, 12] = 1 - wrong[:, :, 12]
    known = torch.ones(2, 24, 24, dtype=torch.bool)
    known[:, :, 12] = False
    assert ssim(wrong, image) < 0.99
    assert ssim(wrong, image, known) == pytest.approx(1, abs=1e-12)
    known[0] = False
    assert ssim(wrong, image, known) == pytest.approx(1, abs=1e-12)
    known[1] = False
    assert math.isnan(ssim(wrong, image, known))


def test_images_smaller_than_the_window_are_refused():
    with pytest.raises(ValueError, match="at least 11x11 pixels, got"):
        ssim(torch.zeros(1, 10, 30, 3), torch.zeros(1, 10, 30, 3))
