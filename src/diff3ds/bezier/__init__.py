"""Rational Bézier curves of degree 1, 2 and 3, batched, in any number of dimensions and any float dtype.

Curves are control points (..., K, D), K = degree + 1, with positive weights (..., K) or None (all one).
"""

from diff3ds.bezier.closest import ClosestPoint, closest_point
from diff3ds.bezier.conics import circle, ellipse, parabola
from diff3ds.bezier.curves import MAX_DEGREE, derivatives, elevate, evaluate, split, subcurve
from diff3ds.bezier.measure import bounding_box, length, tessellate
from diff3ds.bezier.splines import b_spline, catmull_rom, from_nurbs, polyline, to_nurbs

__all__ = [
    "MAX_DEGREE",
    "ClosestPoint",
    "b_spline",
    "bounding_box",
    "catmull_rom",
    "circle",
    "closest_point",
    "derivatives",
    "elevate",
    "ellipse",
    "evaluate",
    "from_nurbs",
    "length",
    "parabola",
    "polyline",
    "split",
    "subcurve",
    "tessellate",
    "to_nurbs",
]
