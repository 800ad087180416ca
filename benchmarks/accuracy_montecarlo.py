"""Monte Carlo antialiasing against 32 x 32 supersampling: the picture, and the gradient against finite differences.

Strokes lie at depths of their own, so none swap their order and no pixels are left out; two are thick and bent.
The gradient is averaged until its standard error is under .5 % of its norm for every input.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import torch
from report import say, show
from supersampling import CELLS, depth_inside, gain, layers, mean_value, picture, samples, share

import diff3ds as ds
from diff3ds.sketch import WidthSpace

SIZE = (48, 48)
BACKGROUND = 1.0
INPUTS = ("points", "width", "color", "opacity")
# Runs between two looks at the error.
BATCH = 50
MAX_RUNS = 20000
AIM_ERROR = 0.005
# Steps of the finite differences: .06 px, twice the 1/32 px between samples. Longer ones show the bends of the loss,
# where strokes pass each other. In colour and opacity the loss is linear.
STEP = {"points": 0.004, "width": 0.002, "color": 0.1, "opacity": 0.1}
# Samples farther than this from the edge of a stroke do not notice the steps and half a sample, .02 px.
EDGE = 0.09


def scene(width_space: WidthSpace) -> tuple[ds.Sketch, ds.Cameras]:
    """Eight curves in planes before a camera on +x, near to far."""
    g = torch.Generator().manual_seed(5)
    count = 8
    points = 0.4 * torch.randn(count, 4, 3, generator=g, dtype=torch.float64)
    points[..., 0] = torch.linspace(0.6, -0.6, count, dtype=torch.float64)[:, None]
    # Thick and bent: hooks 40 px long and 8 px wide, whose inside is as tight as they are wide.
    hook = torch.tensor([[-0.5, -0.4], [-0.4, 0.6], [0.5, 0.7], [0.4, -0.3]], dtype=torch.float64)
    points[2, :, 1:], points[5, :, 1:] = hook, hook.flip(1) + 0.1
    width = 0.05 + 0.05 * torch.rand(count, generator=g, dtype=torch.float64)
    width[[2, 5]] = 0.17
    if width_space == "world":
        width = width * 3
    sketch = ds.Sketch(
        points,
        torch.exp(0.4 * torch.randn(count, 4, generator=g, dtype=torch.float64)),
        width,
        torch.rand(count, 3, generator=g, dtype=torch.float64),
        0.4 + 0.5 * torch.rand(count, generator=g, dtype=torch.float64),
        width_space,
    )
    return sketch, ds.orbit(0, 0, 2.6, size=SIZE)


def smooth_upstream() -> torch.Tensor:
    """Upstream of red, green, blue and alpha (H, W, 4): waves of 24 px and more.

    A rough one would bend the loss wherever an outline passes from pixel to pixel.
    """
    g = torch.Generator().manual_seed(3)
    y, x = torch.meshgrid(*(torch.arange(n, dtype=torch.float64) / n for n in SIZE), indexing="ij")
    waves = [(a, b) for a in range(-2, 3) for b in range(3) if a**2 + b**2 <= 4]
    phases = torch.stack([a * y + b * x for a, b in waves], -1) * 2 * math.pi
    shift, height = (torch.rand(len(waves), 4, generator=g, dtype=torch.float64) for _ in range(2))
    return ((phases[..., None] + 2 * math.pi * shift).cos() * height).sum(2)


class Mean(NamedTuple):
    """Average over runs and its standard error."""

    value: torch.Tensor
    error: torch.Tensor


class _Sums:
    """Running sums of samples and of their squares."""

    def __init__(self, like: torch.Tensor) -> None:
        self.count, self.first, self.second = 0, torch.zeros_like(like), torch.zeros_like(like)

    def add(self, sample: torch.Tensor) -> None:
        self.count, self.first, self.second = self.count + 1, self.first + sample, self.second + sample**2

    def mean(self) -> Mean:
        value = self.first / self.count
        return Mean(value, ((self.second / self.count - value**2).clamp_min(0) / (self.count - 1)).sqrt())


def average(sketch: ds.Sketch, cameras: ds.Cameras, upstream: torch.Tensor) -> tuple[Mean, dict[str, Mean], int]:
    """Picture (H, W, 4) and gradients by the kernels in float32, and the runs it took."""
    leaf = {name: value.float().requires_grad_() for name, value in sketch.tensors().items()}
    drawn = ds.Sketch(**leaf, width_space=sketch.width_space)
    image, gradients = _Sums(upstream), {name: _Sums(sketch.tensors()[name]) for name in INPUTS}
    how = ds.MonteCarlo(generator=torch.Generator().manual_seed(0))
    for run in range(MAX_RUNS):
        made = ds.render(drawn, cameras, background=BACKGROUND, antialiasing=how)
        whole = torch.cat([made.color[0], made.alpha[0, ..., None]], -1)
        image.add(whole.detach().double())
        found = torch.autograd.grad(whole, [leaf[name] for name in INPUTS], upstream.float())
        for name, gradient in zip(INPUTS, found, strict=True):
            gradients[name].add(gradient.double())
        if (run + 1) % BATCH == 0:
            means = {name: sums.mean() for name, sums in gradients.items()}
            if all(m.error.norm() < AIM_ERROR * m.value.norm() for m in means.values()):
                break
    return image.mean(), {name: sums.mean() for name, sums in gradients.items()}, run + 1


def differences(
    sketch: ds.Sketch, cameras: ds.Cameras, upstream: torch.Tensor, scale: float
) -> dict[str, torch.Tensor]:
    """Finite differences of the supersampled picture times upstream, for every component; `scale` of steps."""
    drawn, inside = layers(ds.project(sketch, cameras), SIZE)
    grid, behind = samples(SIZE), BACKGROUND * upstream[..., :3].sum(-1)

    def values(color: torch.Tensor) -> torch.Tensor:
        return torch.einsum("nc,hwc->nhw", color, upstream[..., :3]) + upstream[..., 3]

    def loss(stroke: int, name: str, change: torch.Tensor) -> float:
        if name in ("color", "opacity"):
            moved = getattr(drawn, name).index_add(0, torch.tensor([stroke]), change)
            changed = drawn._replace(**{name: moved})
            return float(mean_value(changed, values(changed.color), behind).sum())
        # Linear in the stroke's mask, which changes at its edges only.
        one = sketch[stroke]
        moved = ds.Sketch(**{**one.tensors(), name: one.tensors()[name] + change}, width_space=one.width_space)
        return float((gains * share(depth_inside(ds.project(moved, cameras), grid[edge]))).sum())

    result = {name: torch.zeros_like(sketch.tensors()[name]) for name in INPUTS}
    for stroke in range(len(sketch)):
        edge = inside[stroke].abs() < EDGE
        gains = gain(drawn, stroke, values(sketch.color), behind)[edge] / CELLS**2
        for name in INPUTS:
            step = scale * STEP[name]
            for index, change in _unit_changes(sketch.tensors()[name][stroke : stroke + 1]):
                ahead, back = (loss(stroke, name, sign * step * change) for sign in (1, -1))
                result[name][stroke][index] = (ahead - back) / (2 * step)
    return result


def _unit_changes(value: torch.Tensor) -> Iterator[tuple[tuple[int, ...], torch.Tensor]]:
    """Index and unit vector of each component of the one stroke in `value`."""
    for place in range(value.numel()):
        change = torch.zeros_like(value)
        change.view(-1)[place] = 1
        yield tuple(change[0].nonzero()[0].tolist()) if value.ndim > 1 else (), change


def run(spaces: tuple[WidthSpace, ...]) -> dict[str, Any]:
    """Compares, prints and returns the figures."""
    say("Monte Carlo 2x2 against 32x32 supersampling; no depth swaps, no pixels left out")
    return {space: _run(space) for space in spaces}


def _run(space: WidthSpace) -> dict[str, Any]:
    sketch, cameras = scene(space)
    upstream = smooth_upstream()
    image, gradients, runs = average(sketch, cameras, upstream)
    alpha = Mean(image.value[..., 3], image.error[..., 3])
    truth = picture(layers(ds.project(sketch, cameras), SIZE)[0], BACKGROUND)[1]
    one_sample = torch.tensor(1 / CELLS**2)
    # Covered pixels have no error but rounding and are not counted.
    figures: dict[str, Any] = {"runs": runs, "picture": _figures(alpha, truth, one_sample, alpha.error > 1e-6)}
    rows = [["alpha of the picture", *figures["picture"].values()]]
    slopes, finer = (differences(sketch, cameras, upstream, scale) for scale in (1, 0.5))
    for name, found in gradients.items():
        # What the step changes is the error of the differences, the same for all components of an input.
        error = (slopes[name] - finer[name]).square().mean().sqrt()
        figures[name] = _figures(found, slopes[name], error, torch.ones_like(found.value, dtype=torch.bool))
        rows.append([f"gradient of {name}", *figures[name].values()])
    columns = [
        "",
        "n",
        "difference / norm",
        "standard error / norm",
        "error of truth",
        "chi² / n",
        "at most",
        "worst z",
    ]
    show(f"Width in {space} space, {runs} runs", columns, rows)
    return figures


def _figures(found: Mean, truth: torch.Tensor, truth_error: torch.Tensor, chosen: torch.Tensor) -> dict[str, Any]:
    """How far an average is from the truth, in its norm, and in standard errors of both."""
    difference, error, norm = (found.value - truth)[chosen], found.error[chosen], truth[chosen].norm()
    z = difference / (error**2 + truth_error**2).sqrt()
    n = z.numel()
    parts = (difference.norm() / norm, error.norm() / norm, truth_error * math.sqrt(n) / norm, (z**2).mean())
    names = ("difference", "standard_error", "truth_error", "chi2")
    figures = {k: float(v) for k, v in zip(names, parts, strict=True)}
    # Three standard deviations of chi²/n.
    bound = 1 + 3 * math.sqrt(2 / n)
    return {"n": n, **figures, "bound": bound, "worst_z": float(z.abs().max())}
