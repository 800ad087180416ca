"""Straight strokes, whose coverage, depth and gradients are known in closed form."""

from dataclasses import replace

import pytest
import torch
from scenes import draw, noise, strokes_at, tracked

# Columns (or rows) of a 32 px image that a stroke from 4 to 28 crosses without its ends, for half widths up to 2.
INSIDE = slice(8, 24)


def overlap(center: float, half_width: float, count: int = 32) -> torch.Tensor:
    """Share of each unit interval that a strip covers."""
    start = torch.arange(count, dtype=torch.float64)
    low, high = start.clamp(min=center - half_width), (start + 1).clamp(max=center + half_width)
    return (high - low).clamp(min=0)


def strip(center: float, half_width: float, **options):
    """From x = 4 to 28 at this y."""
    return strokes_at([[[4.0, center], [28.0, center]]], half_width=half_width, **options)


@pytest.mark.parametrize(("half_width", "center"), [(0.025, 16.0), (0.025, 16.3), (0.5, 15.5), (1.7, 16.2)])
def test_coverage_along_the_axes_is_exact(backend, antialiasing, half_width, center):
    """Two views: along x, and mirrored along y."""
    across = strip(center, half_width)
    both = replace(across, cubics=torch.cat([across.cubics, across.cubics[..., [1, 0, 2, 3]]]))
    alpha = draw(both, 32, backend, antialiasing).alpha
    alpha = torch.stack([alpha[0, :, INSIDE], alpha[1, INSIDE].T])
    expected = overlap(center, half_width).expand(2, 32)
    torch.testing.assert_close(alpha.mean(2), expected, rtol=0, atol=noise(backend, antialiasing, 16))
    if antialiasing == "analytic":
        assert alpha.std(2).max() < 1e-6


def test_thick_stroke_fills_the_image(backend, antialiasing):
    image = draw(strip(16.0, 100.0, opacity=0.5, color=0.2), 32, backend, antialiasing, background=1.0)
    torch.testing.assert_close(image.alpha, torch.full_like(image.alpha, 0.5), rtol=0, atol=1e-6)
    torch.testing.assert_close(image.color, torch.full_like(image.color, 0.6), rtol=0, atol=1e-6)


def test_gradient_of_ink(backend, antialiasing):
    """Of the ink above y = 16 within 16 columns: only the upper edge of the stroke, at 16.2 - 1.7, is there."""
    strokes = strip(16.2, 1.7, opacity=0.5, color=0.25)
    cubics, half_width, color, opacity = tracked(strokes)
    image = draw(strokes, 32, backend, antialiasing, background=0.0)
    rows, columns = slice(0, 16), INSIDE
    (image.alpha[0, rows, columns].sum() + image.color[0, rows, columns].sum()).backward()
    # With colour c, d(alpha + 3 c alpha) = 1.75 times that of alpha, which is 0.5 a pixel of area.
    per_area, area = 0.5 * 1.75, 16 * 1.5
    tolerance = 1e-9 if antialiasing == "analytic" else 16 * noise(backend, antialiasing, 16)
    assert half_width.grad.item() == pytest.approx(16 * per_area, abs=tolerance)
    assert color.grad.flatten().tolist() == pytest.approx([0.5 * area] * 3, abs=tolerance)
    assert opacity.grad.item() == pytest.approx(1.75 * area, abs=tolerance)
    # Down by one pixel takes 16 pixels of area away (Y = y Z, Z = 1 at all control points).
    assert cubics.grad[0, 0, :, 1].sum().item() == pytest.approx(-16 * per_area, abs=tolerance)
    assert cubics.grad[0, 0, :, 0].sum().item() == pytest.approx(0, abs=tolerance)


@pytest.mark.parametrize("angle", [0.0, 20.0, 45.0])
def test_outline_of_a_straight_stroke(backend, angle):
    """Total ink is 2 r L + pi r^2: Monte Carlo sums its outline, all of equal worth, without noise to speak of."""
    direction = torch.tensor([angle, 90 + angle]).deg2rad().cos().double()
    ends = torch.stack([16 - 9 * direction, 16 + 9 * direction])[None]
    strokes = strokes_at(ends, half_width=2.5)
    cubics, half_width, _, opacity = tracked(strokes)
    draw(strokes, 32, backend, "montecarlo").alpha.sum().backward()
    assert half_width.grad.item() == pytest.approx(2 * 18 + 2 * torch.pi * 2.5, rel=1e-3)
    # All control points along the stroke, each as far as it is from the middle: dL = L.
    share = torch.tensor([-9, -3, 3, 9]).double()[:, None] * direction
    assert (cubics.grad[0, 0, :, :2] * share).sum().item() == pytest.approx(18 * 2 * 2.5, rel=5e-3)
    assert opacity.grad.item() == pytest.approx(2 * 2.5 * 18 + torch.pi * 2.5**2, rel=0.01)


def test_depth_of_a_slanted_line(backend, antialiasing):
    """1 / z is linear on the screen; the closest point to a pixel centre lies in its column."""
    depth = torch.tensor([[1.5, 4.0]], requires_grad=True, dtype=torch.float64)
    strokes = strokes_at([[[4.0, 16.2], [28.0, 16.2]]], depth=depth, half_width=1.7, opacity=0.7)
    image = draw(strokes, 32, backend, antialiasing)
    share = (torch.arange(32).double()[INSIDE] + 0.5 - 4) / 24
    expected = 1 / ((1 - share) / depth[0, 0] + share / depth[0, 1])
    rows = image.alpha[0, :, INSIDE].amin(1) > 0.01
    assert rows.sum() == 4
    # The kernels end on a step of up to .03 px along the tangent, which z leaves by .03² z"/2 < 1e-5; a sample has the
    # depth of its own column.
    tolerance = 1e-5 if antialiasing == "analytic" else 0.02
    difference = image.depth[0, rows][:, INSIDE] - expected
    assert difference.abs().max() < tolerance
    assert (image.depth[0][image.alpha[0] <= 1e-6] == 0).all()
    # Rows that are covered whole: in the others Monte Carlo draws samples by chance.
    rows = image.alpha[0, :, INSIDE].amin(1) > 0.69
    got = torch.autograd.grad(image.depth[0, rows][:, INSIDE].sum(), depth, retain_graph=True)[0]
    truth = torch.autograd.grad(rows.sum() * expected.sum(), depth)[0]
    torch.testing.assert_close(got, truth, rtol=1e-6 if antialiasing == "analytic" else 0.01, atol=0)


def test_widths_in_world_units(backend, antialiasing):
    """At one depth a width in world units is the one in pixels over that depth."""
    line = [[[5.0, 9.0], [27.0, 21.0]]]
    world = strokes_at(line, depth=2.5, half_width=4.0, width_space="world")
    image = strokes_at(line, depth=2.5, half_width=1.6)
    a, b = (draw(s, 32, backend, antialiasing) for s in (world, image))
    torch.testing.assert_close(a.alpha, b.alpha, rtol=0, atol=1e-12)
    torch.testing.assert_close(a.depth, b.depth, rtol=0, atol=1e-12)


def test_no_width_and_no_opacity(backend, antialiasing):
    """Nothing is drawn; the analytic mode still knows what more width or opacity would bring."""
    for half_width, opacity in ((0.0, 1.0), (1e-10, 1.0), (1.5, 0.0)):
        strokes = strip(16.2, half_width, opacity=opacity)
        tensors = tracked(strokes)
        image = draw(strokes, 32, backend, antialiasing, background=1.0)
        assert image.alpha.max() < 1e-9
        assert (image.color - 1).abs().max() < 1e-9
        image.alpha[0, :, INSIDE].sum().backward()
        assert all(t.grad.isfinite().all() for t in tensors)
        if antialiasing == "analytic" and half_width > 0:
            # A quotient of differences of about 1e-9: digits of float64 are lost.
            assert tensors[1].grad.item() == pytest.approx(2 * 16 * opacity, rel=1e-5)
            assert tensors[3].grad.item() == pytest.approx(2 * 16 * half_width, rel=1e-5)
