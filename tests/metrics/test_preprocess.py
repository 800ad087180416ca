"""Preprocessing of images for networks, against Pillow's and closed forms."""

import numpy as np
import pytest
import torch
from PIL import Image

from diff3ds.metrics.preprocess import CLIP_MEAN, CLIP_STD, channels_first, normalized, square


@pytest.mark.parametrize(("height", "width", "size"), [(60, 80, 32), (81, 60, 32), (20, 24, 32), (512, 512, 224)])
def test_as_pillow_does(height, width, size, generator):
    pixels = torch.randint(0, 256, (height, width, 3), generator=generator, dtype=torch.uint8)
    # Hard edges overshoot, which Pillow cuts off.
    pixels[: height // 2, : width // 2] = 255
    pixels[height // 2 :, width // 2 :] = 0
    short = min(height, width)
    picture = Image.fromarray(pixels.numpy()).resize((size * width // short, size * height // short), Image.BICUBIC)
    left, top = round((picture.width - size) / 2), round((picture.height - size) / 2)
    expected = np.asarray(picture.crop((left, top, left + size, top + size))).astype(float)
    got = square(pixels[None].float() / 255, size)[0].movedim(0, -1).numpy() * 255
    # Pillow rounds to bytes after each of its two passes, and its coefficients to 22 bits.
    assert np.abs(got - expected).max() < 1.6
    assert np.abs(got - expected).mean() < 0.4


@pytest.mark.parametrize(("length", "first"), [(5, 0), (6, 1), (7, 2), (8, 2), (9, 2), (10, 3), (11, 4), (12, 4)])
@pytest.mark.parametrize("upright", [False, True])
def test_the_middle_is_where_torchvision_has_it(length, first, upright):
    """int(round((length - 4) / 2.0)), written out: odd differences go to the even start."""
    ramp = (torch.arange(length) / 16).expand(4, length)[..., None].repeat(1, 1, 3)
    images = (ramp.transpose(0, 1) if upright else ramp)[None]
    kept = square(images, 4)[0, 0] * 16
    kept = kept.mT if upright else kept
    assert kept[0].tolist() == list(range(first, first + 4))


def test_an_image_of_the_size_stays_as_it_is(generator):
    image = torch.rand(2, 32, 32, 3, generator=generator)
    assert torch.equal(square(image, 32).movedim(1, -1), image)


def test_gradients(generator):
    image = 0.3 + 0.4 * torch.rand(1, 9, 12, 3, generator=generator, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda x: square(x, 5), image.requires_grad_())


def test_normalised_by_mean_and_deviation(generator):
    mean, std = torch.tensor(CLIP_MEAN), torch.tensor(CLIP_STD)
    values = torch.randn(2, 4, 5, 3, generator=generator)
    pixels = channels_first(mean + std * values)
    assert torch.allclose(normalized(pixels, CLIP_MEAN, CLIP_STD).movedim(1, -1), values, atol=1e-6)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("shape", [(4, 4, 3), (1, 3, 4, 4), (0, 4, 4, 3)])
def test_what_is_no_batch_of_images_is_refused(shape):
    with pytest.raises(ValueError, match=r"must have the shape \(B, H, W, 3\)"):
        square(torch.zeros(shape), 4)
