"""Random warps: exact at known points, within their limits, repeatable."""

import torch

from diff3ds.metrics.augment import _homography, random_warps, warped


def coordinates(size):
    """An image whose red and green are the place in [-1, 1]², linear so that bilinear sampling is exact."""
    place = (torch.arange(size, dtype=torch.float64) * 2 + 1) / size - 1
    y, x = torch.meshgrid(place, place, indexing="ij")
    return torch.stack([x, y, torch.ones_like(x)])[None]


def test_the_identity_changes_nothing(generator):
    image = torch.rand(2, 3, 16, 16, generator=generator)
    assert torch.allclose(warped(image, torch.eye(3).expand(2, 3, 3), 16), image, atol=1e-6)


def test_a_homography_takes_corners_to_corners(generator):
    source = torch.rand(4, 2, generator=generator, dtype=torch.float64) + torch.tensor([[0, 0], [2, 0], [2, 2], [0, 2]])
    target = torch.tensor([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], dtype=torch.float64)
    (matrix,) = _homography(source[None], target[None])
    found = torch.cat([source, torch.ones(4, 1)], 1) @ matrix.T
    assert torch.allclose(found[:, :2] / found[:, 2:], target, atol=1e-12)


def test_pixels_come_from_where_the_map_says(generator):
    warps = random_warps(20, generator)
    seen = warped(coordinates(64).expand(20, -1, -1, -1), warps, 32)
    place = (torch.arange(32) * 2 + 1) / 32 - 1
    for row, column in ((5, 20), (16, 16), (30, 3)):
        found = warps @ torch.tensor([place[column], place[row], 1.0])
        found = found[:, :2] / found[:, 2:]
        inside = (found.abs() < 1 - 1 / 64).all(1)
        assert torch.allclose(seen[inside, :2, row, column].float(), found[inside], atol=1e-4)
        outside = (found.abs() > 1 + 1 / 64).any(1)
        assert float(seen[outside, :, row, column].abs().sum()) == 0
    # Both happen.
    assert 0.3 < float((seen[:, 2] > 0.999).double().mean()) < 0.999


def test_warps_shrink_by_half_at_most_and_repeat():
    """The image's corners come to lie in their own quadrant, half way in at most; the crop shows 80 %."""
    warps = random_warps(500, torch.Generator().manual_seed(1))
    assert torch.equal(warps, random_warps(500, torch.Generator().manual_seed(1)))
    corners = torch.tensor([[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]])
    there = torch.linalg.solve(warps[:, None], corners[..., None].expand(500, 4, 3, 1))[..., 0]
    there = there[..., :2] / there[..., 2:]
    # Undo the crop: its place is at most 1 - sqrt(.8) off the middle, its half side sqrt(.8).
    side = 0.8**0.5
    assert float((there * side).abs().max()) <= 1 + (1 - side) + 1e-4
    assert float((there[:, 2] * side).min()) >= 0.5 - (1 - side) - 1e-4
    # Without a share of perspective the three last rows would all be (0, 0, 1).
    assert float(warps[:, 2, :2].abs().mean()) > 0.05


def test_gradients(generator):
    image = torch.rand(1, 3, 6, 6, generator=generator, dtype=torch.float64, requires_grad=True)
    warps = random_warps(1, generator)
    assert torch.autograd.gradcheck(lambda x: warped(x, warps, 5), image)
