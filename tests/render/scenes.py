"""Strokes given in pixels, with known answers, and how to draw them for comparison."""

import math

import torch

from diff3ds.bezier.curves import elevate_homogeneous
from diff3ds.project import Strokes2D
from diff3ds.render import Analytic, MonteCarlo, Rendering, rasterize

# Of the Monte Carlo mode where a picture is compared with a known one; the reference and the emulated CUDA kernels
# are slow.
SAMPLES = {"reference": 16, "cpu": 64, "cuda": 16}


def strokes_at(
    points, *, half_width=1.0, depth=1.0, weights=1.0, color=0.0, opacity=1.0, dtype=torch.float64, orthographic=False,
    **options,
) -> Strokes2D:  # fmt: skip
    """Strokes by control points on the screen (N, K, 2) and their depths (N, K), one view.

    `weights` are those of the curve in space; with perspective they are multiplied by the depths on screen. Numbers do
    for all strokes.
    """
    points = torch.as_tensor(points, dtype=torch.float64)
    count, controls = points.shape[:2]
    w = torch.as_tensor(weights, dtype=torch.float64).expand(count, controls)
    deep = w * torch.as_tensor(depth, dtype=torch.float64).expand(count, controls)
    z, other = (w, deep) if orthographic else (deep, w)
    cubics = elevate_homogeneous(torch.cat([points * z[..., None], z[..., None], other[..., None]], -1))

    def filled(value, *shape) -> torch.Tensor:
        return torch.as_tensor(value, dtype=dtype).expand(*shape).clone()

    appearance = filled(half_width, 1, count), filled(color, count, 3), filled(opacity, count)
    return Strokes2D(cubics[None], *appearance, orthographic=orthographic, **options)


def seeded(antialiasing: str, samples: int = 4, seed: int = 0) -> Analytic | MonteCarlo:
    """An antialiasing by its name; the samples of Monte Carlo are the same in all calls."""
    return Analytic() if antialiasing == "analytic" else MonteCarlo(samples, torch.Generator().manual_seed(seed))


def draw(
    strokes: Strokes2D, size, backend: str, antialiasing: str = "analytic", samples: int | None = None, **options
) -> Rendering:
    """`rasterize`, in the Monte Carlo mode with SAMPLES unless told otherwise, from a seed."""
    how = seeded(antialiasing, samples or SAMPLES[backend])
    return rasterize(strokes, size, backend=backend, antialiasing=how, **options)


def noise(backend: str, antialiasing: str, pixels: int = 1) -> float:
    """What a mean over pixels may be off: rounding, or five standard errors of stratified samples.

    A line through a pixel meets at most 2n of its n x n strata, each with a variance of at most 1/4 / n^4; two sides.
    """
    n = math.isqrt(SAMPLES[backend])
    return 1e-6 if antialiasing == "analytic" else 5 * math.sqrt(2 * 2 * n * 0.25 / n**4 / pixels)


def tracked(strokes: Strokes2D, *names: str) -> list[torch.Tensor]:
    """The named tensors of the strokes, now with gradients."""
    return [getattr(strokes, name).requires_grad_() for name in names or TENSORS]


TENSORS = ("cubics", "half_width", "color", "opacity")

# Cubics on a 40 px image: control points, and weights where they are not one.
SHAPES = {
    "evenly spaced straight": ([[5, 20], [15, 20], [25, 20], [35, 20]], 1.0),
    "slanted": ([[6.2, 9.1], [15.3, 17], [22.8, 24.9], [33.5, 35.2]], 1.0),
    "there and back": ([[8, 18], [40, 26], [0, 14], [30, 22]], 1.0),
    "bend": ([[6, 30], [8, 2], [30, 2], [34, 30]], 1.0),
    "cusp": ([[8, 32], [32, 6], [8, 6], [32, 32]], 1.0),
    "almost a cusp": ([[8, 32], [31.9, 6], [8, 6], [32, 32]], 1.0),
    "loop": ([[6, 30], [44, 4], [-4, 4], [34, 30]], 1.0),
    "coincident start": ([[8, 30], [8, 30], [30, 4], [34, 30]], 1.0),
    "all but a point": ([[20, 20], [20.001, 20], [20, 20.001], [20, 20]], 1.0),
    "heavy middle": ([[6, 30], [10, 4], [30, 4], [34, 30]], [1.0, 1000.0, 1.0, 1.0]),
    "light middle": ([[6, 30], [10, 4], [30, 4], [34, 30]], [1.0, 1e-3, 1e-3, 1.0]),
}
