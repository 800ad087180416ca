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
    line = [fit_line(points)]
    if len(points) < 3 or near_enough(line, pixel, within):
        return line
    circle = fit_circle(points)
    if (found := arcs_on(circle, points)) and near_enough(found, pixel, within):
        return found
    if (found := elliptic_arcs(circle, points, pixel)) and near_enough(found, pixel, within):
        return found
    cubic = [fit_cubic(points)]
    return cubic if near_enough(cubic, pixel, within) else None


def near_enough(strokes: list[Primitive], pixel: float, within: float = JOINED) -> bool:
    """Whether the points that strokes were fitted to lie near enough."""
    return bool(np.percentile(strokes[0].distances, MOST) < within * pixel)
