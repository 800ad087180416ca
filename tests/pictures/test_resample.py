"""Area means against sums by hand, blur against the normal distribution, lenses against the formula turned round."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff3ds.distortion import Distortion
from diff3ds.pictures.reading.lens import undistorted
from diff3ds.pictures.reading.resample import area_means, blurred


def image(values):
    return torch.as_tensor(values)[None, ..., None]


def test_means_count_fractions_of_pixels():
    """Five pixels to two: each takes two and a half."""
    row = image([[1.0, 2.0, 4.0, 8.0, 16.0]])
    expected = [(1 + 2 + 4 / 2) / 2.5, (4 / 2 + 8 + 16) / 2.5]
    torch.testing.assert_close(area_means(row, (1, 2))[0, 0, :, 0], torch.tensor(expected))
    torch.testing.assert_close(area_means(row.transpose(1, 2), (2, 1))[0, :, 0, 0], torch.tensor(expected))


def test_only_the_extent_is_shown():
    """Three and a half pixels to two; of the last only the half that is inside counts."""
    row = image([[1.0, 2.0, 4.0, 100.0]])
    expected = [(1 + 0.75 * 2) / 1.75, (0.25 * 2 + 4 + 0.5 * 100) / 1.75]
    torch.testing.assert_close(area_means(row, (1, 2), (1, 3.5))[0, 0, :, 0], torch.tensor(expected))


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 40), st.integers(1, 40))
def test_means_keep_the_mean_and_linear_images_linear(height, width, h, w):
    """A ramp's mean over a pixel is its value at the pixel's centre, in any size that is not larger."""
    h, w = min(h, height), min(w, width)
    ramp = image(
        (torch.arange(height).double()[:, None] + 0.5) / height * 3 - (torch.arange(width).double() + 0.5) / width
    )
    small = area_means(ramp, (h, w))
    torch.testing.assert_close(small.mean(), ramp.mean(), rtol=0, atol=1e-6)
    if height % h == 0 and width % w == 0:
        expected = (torch.arange(h)[:, None] + 0.5) / h * 3 - (torch.arange(w) + 0.5) / w
        torch.testing.assert_close(small[0, ..., 0], expected.double(), rtol=0, atol=1e-6)


def test_blur_is_the_normal_distribution():
    dot = torch.zeros(1, 21, 21, 1)
    dot[0, 10, 10] = 1
    there = torch.arange(-10.0, 11.0)
    across = torch.exp(-0.5 * (there / 1.3) ** 2) / (1.3 * math.sqrt(2 * math.pi))
    # The filter is cut at 3.5 deviations, where .05 % of it lie outside.
    torch.testing.assert_close(blurred(dot, 1.3)[0, ..., 0], across[:, None] * across, rtol=0, atol=1e-4)
    assert blurred(dot, 0.0) is dot
    # Beyond the image its edge goes on.
    torch.testing.assert_close(blurred(torch.ones(1, 4, 6, 2), 2.0), torch.ones(1, 4, 6, 2))


INTRINSICS = torch.tensor([[300.0, 0, 170], [0, 280, 115], [0, 0, 1]], dtype=torch.float64)
SIZE = (240, 320)
LENSES = [
    Distortion((-0.25, 0.05, 0.0)),
    Distortion((0.2, 0.1, -0.02)),
    Distortion((-0.1, 0.02, 0.05), (0.01, -0.015)),
]


def straightened(u, v, lens):
    """Pixels of a camera without distortion that show what is at (u, v) in the picture: the formula by fixed points."""
    (fx, _, cx), (_, fy, cy), _ = INTRINSICS.tolist()
    (k1, k2, k3), (p1, p2) = lens.radial, lens.tangential
    seen_x, seen_y = (u - cx) / fx, (v - cy) / fy
    x, y = seen_x, seen_y
    for _ in range(200):
        r2 = x**2 + y**2
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        x, y = (
            (seen_x - 2 * p1 * x * y - p2 * (r2 + 2 * x**2)) / radial,
            (seen_y - p1 * (r2 + 2 * y**2) - 2 * p2 * x * y) / radial,
        )
    return fx * x + cx, fy * y + cy


def photograph(lens, distance):
    """What a lens makes of an image with ink where `distance` (a function of the pixel) is about 0."""
    v, u = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) + 0.5 for n in SIZE), indexing="ij")
    return torch.exp(-0.5 * (distance(*straightened(u, v, lens)) / 2) ** 2).float()


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("angle", [35.0, *(pytest.param(a, marks=pytest.mark.slow) for a in (0.0, 80.0))])
def test_straight_lines_become_straight(lens, angle):
    """The centre of the line's ink across, in windows all along it, lies on the line, though the lens bends it."""
    a = math.radians(angle)
    normal, offset = (math.cos(a), math.sin(a)), 60.0
    along = lambda x, y: normal[0] * (x - 160) + normal[1] * (y - 120) - offset  # noqa: E731
    picture = photograph(lens, along)
    straight, known = undistorted(picture[..., None], INTRINSICS, lens, range(240))
    v, u = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) + 0.5 for n in SIZE), indexing="ij")
    off, position = along(u, v), -normal[1] * (u - 160) + normal[0] * (v - 120)
    before, after = [], []
    for center in range(-100, 101, 10):
        near = ((position - center).abs() < 5) & (off.abs() < 12)
        inside = (u[near].min() > 1) & (u[near].max() < 319) & (v[near].min() > 1) & (v[near].max() < 239)
        if inside and bool(known[near].all()):
            before.append(float((off * picture)[near].sum() / picture[near].sum()))
            after.append(float((off * straight[0])[near].sum() / straight[0][near].sum()))
    assert len(after) > 8
    assert max(abs(x) for x in after) < 0.1
    assert max(abs(x) for x in before) > 0.5


def test_what_the_picture_does_not_show_is_not_known():
    """Pincushion distortion: the corners of the straight image come from outside the picture."""
    lens = Distortion((0.3,))
    _, known = undistorted(torch.ones(*SIZE, 1), INTRINSICS, lens, range(240))
    v, u = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) + 0.5 for n in SIZE), indexing="ij")
    x, y = (u - 170) / 300, (v - 115) / 280
    radial = 1 + 0.3 * (x**2 + y**2)
    expected = ((300 * x * radial + 170 - 160).abs() <= 160) & ((280 * y * radial + 115 - 120).abs() <= 120)
    assert torch.equal(known, expected)
    assert 0.5 < known.float().mean() < 0.95
    rows = [undistorted(torch.ones(*SIZE, 1), INTRINSICS, lens, range(i, i + 60))[1] for i in range(0, 240, 60)]
    assert torch.equal(torch.cat(rows), known)


def test_what_lies_beyond_the_fold_is_not_known():
    """r (1 - r^2) grows up to r = 1 / sqrt 3; beyond, the formula shows the same things again."""
    intrinsics = torch.tensor([[100.0, 0, 160], [0, 100, 120], [0, 0, 1]], dtype=torch.float64)
    _, known = undistorted(torch.ones(*SIZE, 1), intrinsics, Distortion((-1.0,)), range(240))
    v, u = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) + 0.5 for n in SIZE), indexing="ij")
    assert torch.equal(known, torch.hypot(u - 160, v - 120) < 100 / math.sqrt(3))
