"""Radii that are equal as far as the views tell become equal: holes are drilled in series, corners rounded alike."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from diff3ds.edges.curves import Curves
from diff3ds.edges.primitives import Kind, fit_circle
from diff3ds.edges.simplify import sampled

# A series of radii has no larger gap than this, and from first to last no more than so many gaps. Empirical: twice the
# scatter of the radii of small holes.
MOST_GAPS = 3
GAP = 0.12


def with_equal_circles(curves: Curves, pixel: float) -> Curves:
    """The curves with whole circles of nearly one radius made equal, about their centres."""
    halves = [i for i in range(len(curves)) if i < int(curves.other[i]) and int(curves.kind[i]) == Kind.ARC]
    if len(halves) < 2:
        return curves
    on = sampled(curves)
    circles = [fit_circle(np.concatenate([on[i], on[int(curves.other[i])]])) for i in halves]
    known = [(i, circle) for i, circle in zip(halves, circles, strict=True) if circle is not None]
    points = curves.constrained(curves.points)[0].double()
    for (i, circle), radius in zip(known, agreed([c.radius for _, c in known], GAP * pixel), strict=True):
        center = torch.from_numpy(circle.center)
        rows = [i, int(curves.other[i])]
        points[rows] = center + radius / circle.radius * (points[rows] - center)
    return replace(curves, points=points.to(curves.points.dtype))


def agreed(radii: Sequence[float], gap: float) -> list[float]:
    """Each radius, or the mean of the series that it belongs to."""
    if not radii:
        return []
    order = np.argsort(radii, kind="stable")
    series = [[int(order[0])]]
    for before, i in itertools.pairwise(order):
        if radii[i] - radii[before] > gap or radii[i] - radii[series[-1][0]] > MOST_GAPS * gap:
            series.append([])
        series[-1].append(int(i))
    found = list(radii)
    for members in series:
        for i in members:
            found[i] = float(np.mean([radii[k] for k in members]))
    return found
