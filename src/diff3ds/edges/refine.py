"""Refinement of curves through the renderer: in each view only the parts that it shows are drawn."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Float, Int, Tensor, UInt8
from diff3ds.bezier.curves import subcurve_matrix
from diff3ds.camera import Cameras
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.evidence.support import PARTS, clear_support
from diff3ds.optimize.config import FitConfig, Rates
from diff3ds.optimize.fit import fit
from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.project import Strokes2D, project
from diff3ds.render import Rendering
from diff3ds.render.backends import kernels
from diff3ds.sketch import Sketch

# [px; measured] Half width of the drawn ridges and curves. Wider ones give a less certain position.
HALF_WIDTH = 1.0
# [px; derived] A ridge point inks along the ridge so far: half the way to the next.
REACH = 0.8
# [views; speed] Views of one step.
BATCH = 10
# [steps; empirical] Steps after which it is asked again what the views show.
RECHECK = 25


@dataclass(eq=False)
class _Shown:
    """What the views show of the curves, asked again now and then."""

    views: EdgeViews
    curves: Curves
    order: Tensor
    parts: Tensor = field(default_factory=lambda: torch.zeros(0))

    def strokes(self, sketch: Sketch, cameras: Cameras, step: int) -> Strokes2D:
        """All parts of the curves; those that a view does not show have no width there."""
        points, weights = self.curves.segments(sketch.points)
        if step % RECHECK == 0:
            self.parts = clear_support(self.views, self.curves.moved(sketch.points.detach()))
        whole = project(Sketch(points, weights, width=0.0), cameras)
        cuts = torch.linspace(0, 1, PARTS + 1, dtype=torch.float64)
        # As one product of matrices, which takes a third of the time of many small ones.
        cubics = torch.einsum("pij,vsjk->vspik", subcurve_matrix(cuts[:-1], cuts[1:], 3), whole.cubics).flatten(1, 2)
        shown = self.parts[self.batch(step)].flatten(1)
        count = cubics.shape[1]
        return Strokes2D(
            cubics,
            HALF_WIDTH * shown.to(points.dtype),
            points.new_zeros(count, 3),
            points.new_ones(count),
            near=whole.near,
        )

    def batch(self, step: int) -> Tensor:
        """The views of a step: every view comes once before any comes again."""
        epoch, turn = divmod(step, max(1, self.order.shape[1] // BATCH))
        return self.order[epoch, turn * BATCH : (turn + 1) * BATCH]


def refined(
    curves: Curves,
    cameras: Cameras,
    views: EdgeViews,
    steps: int,
    rate: float,
    seed: int = 0,
    report: Callable[[int, float], None] = lambda step, loss: None,
) -> Curves:
    """Curves moved so that their renderings meet the ridges of all views.

    Args:
        cameras: those of the views.
        rate: of the first step, pixels.
        report: called with the steps done and the loss.
    """
    shown = _Shown(views, curves, _orders(len(views), steps, seed))
    targets = _targets(views)

    def objective(rendering: Rendering, cameras: Cameras, step: int) -> Tensor:
        return _missed(rendering.alpha, targets, shown.batch(step))

    config = FitConfig(steps=steps, rates=Rates(points=rate * views.pixel), project=shown.strokes, seed=seed)
    sketch = Sketch(curves.points, width=0.0)
    for done in fit(sketch, objective, lambda step, generator: cameras[shown.batch(step)], config):
        sketch = done.sketch
        report(done.index + 1, done.loss)
    return curves.moved(sketch.points)


def _missed(alpha: Float[Tensor, "B H W"], targets: UInt8[Tensor, "V H W"], views: Int[Tensor, " B"]) -> Tensor:
    """The mean over some views of the sums of squares of what is drawn too much or too little."""
    if alpha.dtype == torch.float32 and hasattr(kernels(), "edges_missed"):
        return cast(Tensor, _Missed.apply(alpha, targets, views))  # type: ignore[no-untyped-call]
    return (alpha - targets[views].to(alpha.dtype) / 255).square().sum((1, 2)).mean()


class _Missed(torch.autograd.Function):
    """The same in one go over the pixels, and its gradient with it."""

    @staticmethod
    def forward(ctx: Any, alpha: Tensor, targets: Tensor, views: Tensor) -> Tensor:
        module = kernels()
        assert module is not None
        sums, gradient = module.edges_missed(alpha.detach(), targets, views)
        ctx.save_for_backward(torch.from_numpy(gradient))
        return torch.tensor(sums.mean(), dtype=alpha.dtype)

    @staticmethod
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor, None, None]:
        (gradient,) = ctx.saved_tensors
        return upstream * gradient, None, None


def _targets(views: EdgeViews) -> UInt8[Tensor, "V H W"]:
    """The ridges of all views drawn, 255 where there is a line; kept with the views, which are looked at again."""
    kept = views.__dict__.get("_targets")
    if kept is None:
        drawn = side_by_side(lambda view: _as_bytes(draw_ridges(views, view)), len(views), len(views))
        kept = views.__dict__["_targets"] = torch.stack(drawn)
    return cast(Tensor, kept)


def _orders(views: int, steps: int, seed: int) -> Tensor:
    """A random order of all views for every epoch."""
    generator = torch.Generator().manual_seed(seed)
    epochs = -(-steps // max(1, views // BATCH))
    return torch.stack([torch.randperm(views, generator=generator) for _ in range(epochs)])


def _as_bytes(image: NDArray[np.float32]) -> Tensor:
    return torch.from_numpy(np.rint(image * 255).astype(np.uint8))


def draw_ridges(views: EdgeViews, view: int) -> Float[NDArray[np.float32], "H W"]:
    """The ridges of a view drawn as lines, by the distance of each pixel from its nearest ridge point."""
    height, width = views.size
    nearest = views.nearest[view]
    if (nearest < 0).any():
        return np.zeros(views.size, np.float32)
    y, x = np.mgrid[:height, :width] + 0.5
    offset = np.stack([x, y], -1) - views.points[nearest]
    normal = views.normals[nearest]
    across = np.abs((offset * normal).sum(-1))
    along = np.abs(offset[..., 1] * normal[..., 0] - offset[..., 0] * normal[..., 1])
    distance = np.hypot(across, np.maximum(along - REACH, 0))
    return np.clip(HALF_WIDTH + 0.5 - distance, 0, 1).astype(np.float32)
