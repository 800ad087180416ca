"""The simplest curve through points: a line, else an arc, else one of an ellipse, else a cubic."""

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.curves.shapes.ellipses import JOINED, MOST, elliptic_arcs
from diff3ds.curves.shapes.primitives import Primitive, arcs_on, fit_circle, fit_cubic, fit_line


def simplest(points: Float[Array, "M 3"], pixel: float, within: float = JOINED) -> list[Primitive] | None:
    """The simplest curve through these points, in order along it; None if a cubic is too simple.

    Args:
        pixel: world units of a pixel.
        within: so near to the curve lie nearly all of the points, pixels.
    """
    if len(points) < 3:
        return [fit_line(points)]
    line = [fit_line(points)]
    if near_enough(line, pixel, within):
        return line
    circle = fit_circle(points)
    ways = (lambda: arcs_on(circle, points), lambda: elliptic_arcs(circle, points, pixel), lambda: [fit_cubic(points)])
    for fit in ways:
        found = fit()
        if found and near_enough(found, pixel, within):
            return found
    return None


def near_enough(strokes: list[Primitive], pixel: float, within: float = JOINED) -> bool:
    """Whether the points that strokes were fitted to lie near enough."""
    return bool(np.percentile(strokes[0].distances, MOST) < within * pixel)
