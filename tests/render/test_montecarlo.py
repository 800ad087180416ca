"""Monte Carlo against pictures of 32 x 32 cells a pixel and their finite differences: no bias."""

import functools
from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles import supersampled
from scenes import SHAPES, seeded, strokes_at

from diff3ds.render import rasterize

SIZE = (36, 38)
# Widths in pixels or in the world; or orthographic, where both are the same.
VIEWS = ["image", "world", "orthographic"]
# A correct estimator fails with this chance, for the fixed seeds it passes for good.
QUANTILE = 1 - 1e-4


def layers(view: str):
    """Three strokes at depths that do not overlap, so that no order changes: thin, bent and thick, with a cusp.

    The last is at one depth: where two parts of a stroke of different widths meet, the nearer part decides, and that
    border between the parts is no outline; neither mode differentiates it.
    """
    shapes = [SHAPES[name][0] for name in ("slanted", "bend", "almost a cusp")]
    depth = torch.tensor([[2.0, 2.1, 2.2, 2.3], [3.0, 3.2, 3.1, 3.3], [1.0, 1.0, 1.0, 1.0]])
    half_width = torch.tensor([0.7, 4.5, 2.5])
    return strokes_at(
        shapes,
        depth=depth,
        weights=[[1.0, 1.5, 0.8, 1.2], [1.0] * 4, [1.0] * 4],
        half_width=half_width * depth.mean(1) if view == "world" else half_width,
        color=[[0.9, 0.1, 0.3], [0.2, 0.7, 0.4], [0.1, 0.3, 0.8]],
        opacity=[0.9, 0.7, 0.6],
        width_space="world" if view == "world" else "image",
        orthographic=view == "orthographic",
    )


def draw(strokes, seed: int, samples: int, backend: str = "cpu"):
    return rasterize(strokes, SIZE, antialiasing=seeded("montecarlo", samples, seed), backend=backend)


def chi_square_limit(count: int) -> float:
    from scipy.stats import chi2

    return chi2.ppf(QUANTILE, count)


@pytest.mark.parametrize("view", ["world", pytest.param("image", marks=pytest.mark.slow)])
def test_image_has_no_bias(view):
    """Sum over the pixels of squared errors by variance: chi-square, pixels are drawn independently."""
    strokes = layers(view)
    draws = np.stack([draw(strokes, seed, 16).alpha[0].numpy() for seed in range(400)])
    truth = supersampled(strokes, SIZE)[..., 3]
    error, variance = draws.mean(0) - truth, draws.var(0, ddof=1) / len(draws)
    # Pixels that hardly change are not normal; a cell that two edges cross is known to 1/1024 of a pixel.
    known = np.sqrt(variance) > 1e-3
    assert known.sum() > 150
    assert (error[known] ** 2 / (variance[known] + (1 / 1024) ** 2)).sum() < chi_square_limit(known.sum())
    assert np.abs(error[~known]).max() < 0.01


def smooth_upstream() -> np.ndarray:
    """Coefficients of a loss linear in the picture (height, width, 4): waves a few pixels long."""
    y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
    return np.stack([np.sin(0.3 * x + 0.2 * k * y + k) for k in range(4)], -1)


def directions(strokes, generator: torch.Generator):
    """Random directions of each input by name, scaled so that one is about a pixel, or the whole range of a colour."""
    for _ in range(4):
        step = torch.zeros_like(strokes.cubics)
        # On the screen: X and Y move by about Z.
        step[..., :2] = torch.randn(step[..., :2].shape, generator=generator, dtype=torch.float64)
        yield "cubics", step * strokes.cubics[..., 2:3].detach()
    for name, count in (("half_width", 3), ("color", 6), ("opacity", 3)):
        for k in range(count):
            step = torch.zeros_like(getattr(strokes, name)).flatten()
            step[k % len(step)] = 1.0
            yield name, step.reshape(getattr(strokes, name).shape)


@functools.cache
def picture_slopes(view: str) -> np.ndarray:
    """Central differences of the loss of the supersampled picture along all directions."""
    strokes, upstream, step = layers(view), smooth_upstream(), 0.05

    def loss(name: str, way: torch.Tensor) -> float:
        return float((supersampled(replace(strokes, **{name: getattr(strokes, name) + way}), SIZE) * upstream).sum())

    ways = directions(strokes, torch.Generator().manual_seed(0))
    return np.array([(loss(n, step * v) - loss(n, -step * v)) / (2 * step) for n, v in ways])


# The quick test of these gradients has one answer: test_gradient_of_a_circle, in test_curves.py.
@pytest.mark.slow
@pytest.mark.parametrize(("backend", "seeds"), [("cpu", 200), ("reference", 12)])
@pytest.mark.parametrize("view", VIEWS)
def test_gradient_has_no_bias(backend, seeds, view):
    """Mean over seeds against central differences of the picture, along directions of all inputs.

    The components are correlated: Hotelling's T², which for many seeds is the chi-square of the decorrelated ones; with
    few, of each input alone. Differences of .05 px leave errors of 1e-3, the tolerance beside the noise.
    """
    from scipy.stats import f

    strokes, upstream = layers(view), smooth_upstream()
    ways = list(directions(strokes, torch.Generator().manual_seed(0)))
    slopes = picture_slopes(view)
    names = ("cubics", "half_width", "color", "opacity")
    inputs = [getattr(strokes, n).requires_grad_() for n in names]
    draws = []
    for seed in range(seeds):
        image = draw(strokes, seed, 4, backend)
        output = torch.cat([image.color, image.alpha[..., None]], -1)[0]
        gradients = torch.autograd.grad((output * torch.from_numpy(upstream)).sum(), inputs)
        found = dict(zip(names, gradients, strict=True))
        draws.append([(found[n] * v).sum().item() for n, v in ways])
    draws = np.array(draws)
    for name in names:
        rows = [k for k, (n, _) in enumerate(ways) if n == name]
        error = draws[:, rows].mean(0) - slopes[rows]
        size = np.linalg.norm(slopes[rows])
        noise = draws[:, rows].std(0, ddof=1) / np.sqrt(seeds)
        # The check has teeth: errors of some per cent stand out of the noise.
        assert np.linalg.norm(noise) < (0.02 if backend == "cpu" else 0.08) * size, name
        covariance = np.cov(draws[:, rows].T) / seeds + np.diag(np.full(len(rows), (1e-3 * size) ** 2))
        statistic = error @ np.linalg.solve(covariance, error)
        # With few draws the covariance is uncertain: the quantile of Hotelling's distribution.
        n, p = seeds, len(rows)
        limit = p * (n - 1) / (n - p) * f.ppf(QUANTILE, p, n - p)
        assert statistic < limit, (name, error, noise)
