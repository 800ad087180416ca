"""Fewer, longer, fairer curves: weak and doubled ones dropped, neighbours that are one curve joined."""

from dataclasses import dataclass

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.edges.chains import resampled
from diff3ds.edges.curves import Curves, curves_of
from diff3ds.edges.lookup import EdgeViews
from diff3ds.edges.primitives import FREEDOM, Kind, Primitive, fit_arc, fit_circle, fit_cubic, fit_line
from diff3ds.edges.ridges import Array
from diff3ds.edges.segment import half_circles
from diff3ds.edges.support import part_support

# Lengths in pixels; all empirical.
SAMPLES = 64
# A curve doubles longer ones if this share of it lies so near to them.
DOUBLED, DOUBLED_SHARE = 1.2, 0.9
# Ends at most so far apart may continue each other, if the tangents agree (cosine) and one curve fits both so well.
GAP, STRAIGHT_ON, JOINED = 4.0, 0.96, 0.5
# Samples of a curve per pixel when curves are fitted again.
DENSE = 1.0


def pruned(curves: Curves, views: EdgeViews, least_support: float, shortest: float) -> Curves:
    """Without curves that too few views show, that are too short, or that lie along longer ones.

    Args:
        least_support: share of the views that show a curve, mean over its parts.
        shortest: pixels.
    """
    support = part_support(views, curves).double().mean((0, 2)).numpy()
    samples = sampled(curves)
    length = np.linalg.norm(np.diff(samples, axis=1), axis=2).sum(1)
    keep = (support >= least_support) & (length >= shortest * views.pixel)
    from scipy.spatial import cKDTree

    kept: list[int] = []
    for i in np.argsort(-length, kind="stable"):
        if not keep[i]:
            continue
        if kept:
            near = cKDTree(np.concatenate([resampled(samples[j], 0.3 * views.pixel) for j in kept]))
            keep[i] = (near.query(samples[i])[0] < DOUBLED * views.pixel).mean() < DOUBLED_SHARE
        if keep[i]:
            kept.append(int(i))
    return curves[torch.from_numpy(keep)]


def sampled(curves: Curves, count: int = SAMPLES) -> Float[Array, "N S 3"]:
    """Points along every curve at even parameters, the ends included."""
    return curves.at(torch.linspace(0, 1, count)).double().numpy()


@dataclass(frozen=True, eq=False)
class _Joint:
    """Two curves that one curve fits."""

    price: float
    first: int
    second: int
    points: Float[Array, "M 3"]
    curve: list[Primitive]


def joined(curves: Curves, pixel: float) -> Curves:
    """Curves that continue each other become one, best fits first, until none does; arcs may close to circles."""
    found = [(p, resampled(s, DENSE * pixel)) for p, s in zip(as_primitives(curves), sampled(curves), strict=True)]
    found = [(simplest(points, pixel) or p, points) for p, points in found]
    circles: list[list[Primitive]] = []
    joints = [j for i in range(len(found)) for k in range(i) if (j := _joint(found, i, k, pixel)) is not None]
    alive = set(range(len(found)))
    while joints:
        best = min(joints, key=lambda joint: joint.price)
        alive -= {best.first, best.second}
        joints = [j for j in joints if j.first in alive and j.second in alive]
        if len(best.curve) == 2:
            circles.append(best.curve)
            continue
        found.append((best.curve[0], best.points))
        new = len(found) - 1
        joints += [j for k in sorted(alive) if (j := _joint(found, new, k, pixel)) is not None]
        alive.add(new)
    for i in sorted(alive):
        halves = half_circles(found[i][1], pixel)
        if halves:
            alive.remove(i)
            circles.append(halves)
    return _with_circles([found[i][0] for i in sorted(alive)], circles)


def _with_circles(single: list[Primitive], circles: list[list[Primitive]]) -> Curves:
    curves = curves_of([*single, *(half for circle in circles for half in circle)])
    vertex, other = curves.vertex.clone(), curves.other.clone()
    for k in range(len(circles)):
        first = len(single) + 2 * k
        vertex[first + 1] = vertex[first].flip(0)
        other[first], other[first + 1] = first + 1, first
    return Curves(curves.points, curves.kind, vertex, other)


def as_primitives(curves: Curves) -> list[Primitive]:
    """The curves one by one."""
    none = np.zeros(0)
    control = curves.constrained(curves.points)[0].double().numpy()
    return [Primitive(Kind(k), c, none) for k, c in zip(curves.kind.tolist(), control, strict=True)]


def simplest(points: Float[Array, "M 3"], pixel: float) -> Primitive | None:
    """The simplest single curve within `JOINED` pixels of these points, in order along it."""
    if len(points) < 3:
        return fit_line(points)
    for fit in (fit_line, fit_arc, fit_cubic):
        found = fit(points)
        if found is not None and np.percentile(found.distances, 98) < JOINED * pixel:
            return found
    return None


def _joint(found: list[tuple[Primitive, Array]], i: int, k: int, pixel: float) -> _Joint | None:
    """The joint of two curves at their nearest ends, if there is one."""
    a, b = found[i][1], found[k][1]
    flips = [(a[::-1] if flip_a else a, b[::-1] if flip_b else b) for flip_a in (0, 1) for flip_b in (0, 1)]
    gaps = [np.linalg.norm(x[-1] - y[0]) for x, y in flips]
    first, second = flips[int(np.argmin(gaps))]
    if min(gaps) > GAP * pixel:
        return None
    out, onwards = _end_tangent(first[::-1]), -_end_tangent(second)
    if -out @ onwards > -STRAIGHT_ON:
        return None
    # Overlapping ends would turn back.
    keep = (second - first[-1]) @ -out > 0
    points = np.concatenate([first, second[keep]]) if keep.any() else first
    curve = simplest(points, pixel)
    if curve is None:
        return None
    price = FREEDOM[curve.kind] - FREEDOM[found[i][0].kind] - FREEDOM[found[k][0].kind]
    return _Joint(price + float(np.mean(curve.distances)) / pixel, k, i, points, [curve])


def _end_tangent(points: Array) -> Float[Array, " 3"]:
    """Unit tangent at the first point, pointing into the curve."""
    reach = min(len(points) - 1, 4)
    step = points[reach] - points[0]
    return step / (np.linalg.norm(step) + 1e-12)
