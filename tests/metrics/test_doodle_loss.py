"""3Doodle's loss: zero for equal images, its weights, the same warps for both images, gradients."""

import pytest
import torch
from tiny_networks import features, resnet

from diff3ds.metrics import doodle_loss
from diff3ds.metrics.augment import random_warps
from diff3ds.metrics.clip_resnet import clip_resnet
from diff3ds.metrics.doodle_loss import DoodleLoss
from diff3ds.metrics.vgg_distance import VggDistance


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    """VGG16 looks at small images here: at its own size a step takes seconds."""
    monkeypatch.setattr(doodle_loss, "VGG_SIZE", 32)


@pytest.fixture(scope="module")
def networks():
    return clip_resnet(resnet(), "test"), VggDistance(features("vgg"), "3doodle")


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.mark.slow
def test_equal_images_have_no_loss(networks, images):
    """The warps of both images are the same: with others the loss would not vanish."""
    loss = DoodleLoss(*networks, warps=2)
    assert float(loss(images, images, seeded())) == pytest.approx(0, abs=1e-4)
    assert float(loss(images, images.roll(1, 0), seeded())) > 0.1
    cosine, distance = loss.plain(images, images)
    assert float(cosine) == pytest.approx(1, abs=1e-5)
    assert float(distance) == 0


def test_weights_and_the_mean_over_warps(networks, images):
    """Without warps the loss is the weighted sum of both terms; a warp of each image counts as much as the image."""
    a, b = images[:2], images[1:]
    cosine, distance = DoodleLoss(*networks).plain(a, b)
    bare = DoodleLoss(*networks, clip_weight=75.0, vgg_weight=2.0, warps=0)(a, b, seeded())
    assert float(bare) == pytest.approx(float(75 * (1 - cosine) + 2 * distance), rel=1e-5)
    # Terms alone, with one warp: twice the mean less the plain term is the warp's; it depends on the generator only.
    one = DoodleLoss(*networks, clip_weight=0.0, vgg_weight=1.0, warps=1)
    warped = [2 * one(a, b, seeded(s)) - distance for s in (0, 0, 1)]
    assert torch.equal(warped[0], warped[1])
    assert not torch.equal(warped[0], warped[2])
    assert min(warped) > 0


def test_each_network_sees_warps_of_its_own(networks, images):
    """As in 3Doodle; and a weight of 0 changes nothing for the other term."""
    a, b = images[:2], images[1:]
    generator = seeded()
    clips, vggs = (random_warps(2, generator) for _ in range(2))
    alone = [DoodleLoss(*networks, clip_weight=c, vgg_weight=v, warps=1) for c, v in ((1.0, 0.0), (0.0, 1.0))]
    assert torch.equal(alone[0](a, b, seeded()), 1 - alone[0]._cosine(a, b, clips))
    assert torch.equal(alone[1](a, b, seeded()), alone[1]._distance(a, b, vggs))


def test_published_weights_are_the_defaults(networks):
    loss = DoodleLoss(*networks)
    assert (loss.clip_weight, loss.vgg_weight, loss.warps) == (75.0, 1.0, 4)


@pytest.mark.slow
def test_gradients_reach_the_drawing_alone(networks, images, generator):
    loss = DoodleLoss(*networks, warps=1)
    networks[0].double()
    networks[1].stack.double()
    try:
        a, b = (0.2 + 0.6 * images[:2]).double().split(1)
        a.requires_grad_()
        b.requires_grad_()
        gradient, other = torch.autograd.grad(loss(a, b, seeded()), (a, b), allow_unused=True)
        assert other is None
        direction = torch.randn(a.shape, generator=generator, dtype=torch.float64)
        step, at = 1e-7, a.detach()
        difference = loss(at + step * direction, b, seeded()) - loss(at - step * direction, b, seeded())
        assert float((gradient * direction).sum()) == pytest.approx(float(difference.detach()) / (2 * step), rel=1e-3)
    finally:
        networks[0].float()
        networks[1].stack.float()
