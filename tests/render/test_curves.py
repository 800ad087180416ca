"""Curved strokes against densely sampled curves and exact circles."""

import functools
import math

import numpy as np
import pytest
import torch
from oracles import box_coverage, cell_centers, covered, distances
from scenes import SHAPES, draw, noise, strokes_at, tracked

from diff3ds.bezier import circle


@functools.cache
def distances_from(shape: str) -> np.ndarray:
    """Of the centres of 40 x 40 pixels from a curve, once for all widths and backends."""
    points, weights = SHAPES[shape]
    cubic = strokes_at([points], weights=weights).cubics[0, 0].numpy()
    return distances(cubic, cell_centers((40, 40), 1).reshape(-1, 2))[0]


@pytest.mark.parametrize("half_width", [0.025, 1.3, 7.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_coverage_is_that_of_the_closest_point(backend, shape, half_width):
    """Cusps, loops and bends tighter than the width included."""
    points, weights = SHAPES[shape]
    strokes = strokes_at([points], weights=weights, half_width=half_width)
    alpha = draw(strokes, 40, backend).alpha[0].numpy()
    # The kernels promise 1e-4 px, but take what folds back within .01 px (FOLD_TOL) as a line.
    tolerance = 0.01 if backend != "reference" and shape == "all but a point" else 1e-4
    assert np.abs(alpha.ravel() - box_coverage(distances_from(shape), half_width)).max() < tolerance


@functools.cache
def loops():
    """256 turned at random, and their picture by the reference, once for all kernels."""
    g = torch.Generator().manual_seed(0)
    loop = torch.tensor([[-4.2, 5.1], [14.5, -7.6], [-14.5, -7.6], [4.2, 5.1]], dtype=torch.float64)
    turn = 2 * math.pi * torch.rand(256, generator=g, dtype=torch.float64)
    rotation = torch.stack([turn.cos(), -turn.sin(), turn.sin(), turn.cos()], -1).reshape(-1, 2, 2)
    tiles = 16 * torch.cartesian_prod(torch.arange(16), torch.arange(16)) + 8
    strokes = strokes_at(loop @ rotation + tiles[:, None], half_width=0.4)
    return strokes, draw(strokes, 256, "reference").alpha


def test_loops_within_a_tile(kernels):
    """Near where a stroke crosses itself, chords do not say which branch is nearest."""
    strokes, expected = loops()
    assert (draw(strokes, 256, kernels).alpha - expected).abs().max() < 1e-4


# Slopes of what is nearly level or upright, up to the last digits, and what has no direction at all.
STEEP = [0.0, 1e-12, -1e-7, 1e-5, -1e-3]


@functools.cache
def arcs(dtype, half_width):
    """Lines and arcs of up to 1.6, and their picture by the reference, once for all kernels."""
    g = torch.Generator().manual_seed(0)
    start = torch.pi * (2 * torch.rand(256, generator=g, dtype=torch.float64) - 1)
    turn = 3.2 * torch.rand(256, generator=g, dtype=torch.float64) - 1.6
    start[: 4 * len(STEEP)] = torch.cat([torch.tensor(STEEP).double() + i * torch.pi / 2 for i in range(4)])
    turn[: 8 * len(STEEP)] = 0
    length = 22 * torch.rand(256, generator=g, dtype=torch.float64) ** 2
    length[-4:] = torch.tensor([0.0, 1e-9, 1e-4, 0.01])
    # Legs of equal length that turn evenly: nearly arcs of circles.
    angles = torch.stack([start - turn / 3, start, start + turn / 3], -1)
    legs = (length / 3)[:, None, None] * torch.stack([angles.cos(), angles.sin()], -1)
    arcs = torch.cat([torch.zeros(256, 1, 2).double(), legs.cumsum(1)], 1)
    centers = 32 * torch.cartesian_prod(torch.arange(16), torch.arange(16)) + 12
    places = centers + 8 * torch.rand(256, 2, generator=g, dtype=torch.float64)
    strokes = strokes_at(arcs - arcs.mean(1, keepdim=True) + places[:, None], half_width=half_width, dtype=dtype)
    return strokes, draw(strokes, 512, "reference").alpha


@pytest.mark.parametrize(
    ("dtype", "half_width"),
    [
        (torch.float32, 0.4),
        pytest.param(torch.float64, 2.6, marks=pytest.mark.slow),
        pytest.param(torch.float64, 0.4, marks=pytest.mark.slow),
        pytest.param(torch.float32, 2.6, marks=pytest.mark.slow),
    ],
)
def test_arcs_in_every_direction(kernels, dtype, half_width):
    """Alone and across the borders of tiles: no pixel is passed over."""
    strokes, expected = arcs(dtype, half_width)
    assert (draw(strokes, 512, kernels).alpha - expected).abs().max() < 1e-4


@functools.cache
def hooks(seed, half_width):
    """256 random ones, and their picture by the reference, once for all kernels."""
    g = torch.Generator().manual_seed(seed)
    hook = torch.tensor([[-5.0, 0.0], [2.0, 0.0], [4.0, 0.0], [4.0, 1.0]], dtype=torch.float64)
    hooks = hook + 0.5 * torch.randn(256, 4, 2, generator=g, dtype=torch.float64)
    tiles = 32 * torch.cartesian_prod(torch.arange(16), torch.arange(16)) + 16
    strokes = strokes_at(hooks + tiles[:, None], half_width=half_width)
    return strokes, draw(strokes, 512, "reference").alpha


# Each of these has a pixel that goes wrong where ends are looked at in other places than the right ones.
@pytest.mark.parametrize(
    ("seed", "half_width"),
    [(0, 1.5), *(pytest.param(*case, marks=pytest.mark.slow) for case in [(7, 4.0), (24, 1.5), (9, 2.5)])],
)
def test_bends_that_come_near_twice_at_an_end(kernels, seed, half_width):
    """The end of a hook may be nearer than the bend before it by .01 px, over the same chord."""
    strokes, expected = hooks(seed, half_width)
    assert (draw(strokes, 512, kernels).alpha - expected).abs().max() < 1e-4


@functools.cache
def share_covered(shape: str):
    """Of each pixel by a stroke 6 wide, once for all backends."""
    return covered(strokes_at([SHAPES[shape][0]]).cubics[0, 0].numpy(), 3.0, (40, 40))


@pytest.mark.parametrize(
    "shape", ["bend", "loop", *(pytest.param(s, marks=pytest.mark.slow) for s in ("cusp", "there and back"))]
)
def test_samples_are_inside_or_not(backend, shape):
    """Monte Carlo pictures against 32 x 32 samples a pixel, in the mean over the image."""
    strokes = strokes_at([SHAPES[shape][0]], half_width=3.0)
    alpha = draw(strokes, 40, backend, "montecarlo").alpha[0].numpy()
    truth = share_covered(shape)
    edge = (truth > 0) & (truth < 1)
    error = alpha - truth
    assert np.abs(error[~edge]).max() < 0.02
    assert np.abs(error).max() < noise(backend, "montecarlo")
    assert abs(error[edge].mean()) < noise(backend, "montecarlo", edge.sum())


def quarter(radius: float, half_width: float, **options):
    """The quarter circle around the corner (0, 0)."""
    points, weights = circle((0.0, 0.0, 0.0), radius, stop=90.0)
    return strokes_at(points[..., :2], weights=weights, half_width=half_width, **options)


@pytest.mark.parametrize(("radius", "half_width"), [(20.0, 1.3), (9.0, 4.0), (24.5, 0.4)])
def test_circle_covers_the_annulus(backend, antialiasing, radius, half_width):
    alpha = draw(quarter(radius, half_width), 32, backend, antialiasing).alpha[0].numpy()
    from_center = np.linalg.norm(cell_centers((32, 32)), axis=-1)
    area = (np.abs(from_center - radius) < half_width).mean(1).reshape(32, 32)
    # The promise of the analytic mode; a strip of 32 samples across is known to 1/64.
    tolerance = 0.05 + 1 / 64 if antialiasing == "analytic" else noise(backend, antialiasing)
    assert np.abs(alpha - area).max() < tolerance
    ink, pixels = math.pi * radius * half_width, (area > 0).sum()
    assert alpha.sum() == pytest.approx(ink, abs=0.005 * ink + pixels * noise(backend, antialiasing, pixels))


def test_gradient_of_a_circle(backend, antialiasing):
    """Ink is pi r w within the quadrant: d/dw = pi r for the half width, d/d(scale) of the curve = pi r w.

    The scale moves the ends along the borders of the image only, where nothing changes.
    """
    radius, half_width = 20.0, 4.0
    strokes = quarter(radius, half_width)
    cubics, width, _, opacity = tracked(strokes)
    draw(strokes, 32, backend, antialiasing).alpha.sum().backward()
    ink = math.pi * radius * half_width
    # The box counts the pixel centres in bands one pixel wide, here 67 for 62.8; outline points are as many.
    tolerance = 0.1 if antialiasing == "analytic" else 0.03
    assert width.grad.item() == pytest.approx(math.pi * radius, rel=tolerance)
    assert (cubics.grad * cubics.detach())[..., :2].sum().item() == pytest.approx(ink, rel=tolerance)
    assert opacity.grad.item() == pytest.approx(ink, rel=0.01)


def test_point_is_a_disc(backend, antialiasing):
    """Grows with its radius: the sign of the outline term."""
    strokes = strokes_at(torch.tensor([[[16.3, 15.8]]]).expand(1, 4, 2), half_width=6.0)
    _, width, _, _ = tracked(strokes)
    alpha = draw(strokes, 32, backend, antialiasing).alpha[0]
    from_center = np.linalg.norm(cell_centers((32, 32)) - [16.3, 15.8], axis=-1)
    tolerance = 0.05 + 1 / 64 if antialiasing == "analytic" else noise(backend, antialiasing)
    assert np.abs(alpha.detach().numpy() - (from_center < 6).mean(1).reshape(32, 32)).max() < tolerance
    alpha.sum().backward()
    assert width.grad.item() == pytest.approx(2 * math.pi * 6, rel=0.1 if antialiasing == "analytic" else 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["cusp", "almost a cusp", "bend", "loop"])
def test_outline_is_as_long_as_that_of_the_picture(backend, shape):
    """d(ink) / d(half width) by differences of areas of 32 x 32 cells a pixel: nothing counted twice at cusps."""
    strokes = strokes_at([SHAPES[shape][0]], half_width=4.0)
    _, width, _, _ = tracked(strokes)
    draw(strokes, 40, backend, "montecarlo").alpha.sum().backward()
    more, less = (covered(strokes.cubics[0, 0].detach().numpy(), 4 + step, (40, 40)).sum() for step in (0.1, -0.1))
    assert width.grad.item() == pytest.approx((more - less) / 0.2, rel=0.01)
