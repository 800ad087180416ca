"""Why two exact renderers may differ in a pixel: what rounding can change there, found by dense sampling."""

import math
from typing import NamedTuple

import torch
from random_scenes import RandomScene

import diff3ds as ds

# Distances that rounding cannot tell apart: float32 coordinates of 100 px are 8e-6 px apart. And distances that the
# kernels' search may take for equal: they draw folds of a curve within .01 px as straight.
SAME_DISTANCE = {"": 1e-5, " to .01 px": 1e-2}
# Depths (relative) that rounding cannot tell apart: some 10 roundings of float32, 6e-8 each, on the way to a depth, and
# float32 rounding of the closest point (1e-5 px of a stroke of 10 px and more that is 1 deep).
SAME_DEPTH = 2e-6
# Samples a stroke, evenly in the log odds of the parameter: weights of 1e±2 crowd a curve at its ends.
SAMPLES = 6001
LOG_ODDS = 16.0


class Cause(NamedTuple):
    """kind: "depth order", "nearest point", each perhaps "to .01 px" (see SAME_DISTANCE), or "unexplained"."""

    kind: str
    detail: str


class _Hit(NamedTuple):
    """A stroke over the pixel: distance, and all its points that are as near as rounding can tell.

    low, high: their depths. change: what the choice among them may change in coverage (one a pixel of distance or
    half width, at most).
    """

    stroke: int
    distance: float
    low: float
    high: float
    change: float


@torch.no_grad()
def explain(scene: RandomScene, view: int, position: tuple[float, float], error: float) -> Cause:
    """What can change colour or alpha by `error` at a position of a view (a float64 scene)."""
    strokes = ds.project(scene.sketch, scene.cameras)
    for suffix, slack in SAME_DISTANCE.items():
        rows = [_hit(strokes, i, view, position, scene.blur, slack) for i in range(len(scene.sketch))]
        hits = sorted((h for h in rows if h), key=lambda h: h.low)
        gaps = [(b.low / a.high - 1, a.stroke, b.stroke) for i, a in enumerate(hits) for b in hits[i + 1 :]]
        gap, one, other = min(gaps, default=(math.inf, -1, -1))
        if gap < SAME_DEPTH:
            return Cause("depth order" + suffix, f"strokes {one} and {other} in either order")
        for hit in hits:
            if hit.high / hit.low - 1 > SAME_DEPTH and hit.change >= error:
                depths = f"{hit.distance:.2f} px from points at depths {hit.low:.4f} and {hit.high:.4f}"
                return Cause("nearest point" + suffix, f"stroke {hit.stroke}: {depths}")
    return Cause("unexplained", f"{len(hits)} strokes, least depth gap {gap:.1e}")


def _hit(
    strokes: ds.Strokes2D, stroke: int, view: int, position: tuple[float, float], blur: float, slack: float
) -> _Hit | None:
    """The stroke at the position, if its edge is within reach."""
    odds = torch.linspace(-LOG_ODDS, LOG_ODDS, SAMPLES, dtype=torch.float64)
    distance, depth = _sampled(strokes.cubics[view, stroke], odds, position)
    least = distance[1:-1] <= torch.minimum(distance[:-2], distance[2:])
    # The vertex of the parabola through three samples of the squared distance.
    k = least.nonzero()[:, 0] + 1
    a, b, c = (distance[k + i] ** 2 for i in (-1, 0, 1))
    shift = ((a - c) / (2 * (a - 2 * b + c)).clamp_min(1e-300)).clamp(-1, 1)
    more = _sampled(strokes.cubics[view, stroke], odds[k] + shift * (odds[1] - odds[0]), position)
    distance, depth = torch.cat([distance, more[0]]), torch.cat([depth, more[1]])
    distance = torch.where(depth > strokes.near, distance, math.inf)
    nearest = distance.argmin()
    half_width = strokes.half_width[view if len(strokes.half_width) > 1 else 0, stroke]
    if strokes.width_space == "world":
        half_width = half_width / depth[nearest]
    reach = 0.5 if blur == 0 else 3.5 * math.sqrt(blur**2 + 1 / 12)
    if not distance[nearest] < half_width + reach + slack:
        return None
    same = depth[distance <= distance[nearest] + slack]
    low, high = float(same.min()), float(same.max())
    change = slack + (float(half_width) * (high / low - 1) if strokes.width_space == "world" else 0.0)
    return _Hit(stroke, float(distance[nearest]), low, high, change)


def _sampled(
    control: torch.Tensor, odds: torch.Tensor, position: tuple[float, float]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Distance to the position in pixels, and depth, of points of a homogeneous cubic."""
    t, s = odds.sigmoid(), (-odds).sigmoid()
    point = torch.stack([s**3, 3 * t * s**2, 3 * t**2 * s, t**3], -1) @ control
    xy = point[:, :2] / point[:, 2:3]
    return torch.linalg.vector_norm(xy - xy.new_tensor(position), dim=-1), point[:, 2] / point[:, 3]
