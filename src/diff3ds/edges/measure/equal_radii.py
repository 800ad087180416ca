"""Radii that are equal as far as the views tell become equal: holes are drilled in series, corners rounded alike."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from diff3ds.curves.shapes.curve_set import Curves

# [px; empirical] Scatter of the radii of small holes.
SCATTER = 0.06
# [standard deviations; empirical] Series whose medians differ by more than so many times what their scatter makes
# likely are two.
DIFFERENT = 2.5


def with_equal_circles(curves: Curves, pixel: float) -> Curves:
    """The curves with whole circles of nearly one radius made equal, about their centres."""
    circles = curves.circles
    if len(circles) < 2:
        return curves
    points = curves.constrained(curves.points)[0].double()
    radii = agreed([circle.radius for circle in circles.values()], SCATTER * pixel)
    for (i, circle), radius in zip(circles.items(), radii, strict=True):
        center = torch.from_numpy(circle.center)
        points[i] = center + radius / circle.radius * (points[i] - center)
    return replace(curves, points=points.to(curves.points.dtype))


def agreed(radii: Sequence[float], scatter: float) -> list[float]:
    """Each radius, or the median of the series that it belongs to: neighbours join, the likeliest to be equal first.

    The median, because where something disturbs one of them its radius is far off.
    """
    order = np.argsort(radii, kind="stable")
    series = [[int(i)] for i in order]

    def apart(k: int) -> float:
        one, other = series[k], series[k + 1]
        gap = np.median([radii[i] for i in other]) - np.median([radii[i] for i in one])
        return float(gap / (scatter * np.sqrt(1 / len(one) + 1 / len(other))))

    while len(series) > 1:
        k = min(range(len(series) - 1), key=apart)
        if apart(k) > DIFFERENT:
            break
        series[k : k + 2] = [series[k] + series[k + 1]]
    found = list(radii)
    for members in series:
        for i in members:
            found[i] = float(np.median([radii[k] for k in members]))
    return found
