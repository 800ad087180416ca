"""The simplest curve through points: a line, else an arc, else one of an ellipse, else a cubic."""

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.curves.shapes.ellipses import JOINED, MOST, fit_elliptic_arcs
from diff3ds.curves.shapes.primitives import Primitive, fit_arcs, fit_cubic, fit_line


def simplest(points: Float[Array, "M 3"], pixel: float, within: float = JOINED) -> list[Primitive] | None:
    """The simplest curve through these points, in order along it; None if a cubic is too simple.

    Args:
        pixel: world units of a pixel.
        within: so near to the curve lie nearly all of the points, pixels.
    """
    if len(points) < 3:
        return [fit_line(points)]
    ways = (lambda p: [fit_line(p)], fit_arcs, lambda p: fit_elliptic_arcs(p, pixel), lambda p: [fit_cubic(p)])
    for fit in ways:
        found = fit(points)
        if found and near_enough(found, pixel, within):
            return found
    return None


def near_enough(strokes: list[Primitive], pixel: float, within: float = JOINED) -> bool:
    """Whether the points that strokes were fitted to lie near enough."""
    return bool(np.percentile(strokes[0].distances, MOST) < within * pixel)
