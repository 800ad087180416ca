"""Circles, ellipses and parabolas as rational Bézier curves, exact to rounding."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._checks import as_numbers, check_finite
from diff3ds._shapes import Float, Tensor

Vector = Sequence[float] | Float[Tensor, " D"]
Doubles = NDArray[np.float64]

# A rational quadratic can turn by less than 180 degrees; 90 keeps its weights mild (cos 45 degrees).
MAX_ARC = 90.0


def ellipse(
    center: Vector,
    u: Vector,
    v: Vector,
    start: float = 0.0,
    stop: float = 360.0,
    *,
    dtype: torch.dtype = torch.float64,
) -> tuple[Float[Tensor, "S 3 D"], Float[Tensor, "S 3"]]:
    """The arc center + u cos(angle) + v sin(angle), angle from start to stop in degrees, as rational quadratics.

    u and v are the half axes if they are orthogonal, else conjugate half diameters. Any number of dimensions.
    Consecutive pieces of at most 90 degrees share their end points exactly.

    Raises:
        TypeError: what should be numbers is none.
        ValueError: start equals stop, a value is not finite, or center, u and v differ in length.
    """
    c, a, b = _vectors(center=center, u=u, v=v)
    _check_range(start, stop)
    pieces = math.ceil(abs(stop - start) / MAX_ARC)
    angles = torch.deg2rad(torch.linspace(start, stop, pieces + 1, dtype=torch.float64))
    half = (angles[1] - angles[0]) / 2
    on = c + a * angles.cos()[:, None] + b * angles.sin()[:, None]
    if (stop - start) % 360 == 0:
        on[-1] = on[0]
    # The tangents at the ends of a piece meet above its middle angle, 1 / cos(half) times as far out.
    middle = (angles[:-1] + angles[1:])[:, None] / 2
    corner = c + (a * middle.cos() + b * middle.sin()) / half.cos()
    weights = torch.stack([torch.ones(()), half.cos(), torch.ones(())]).to(torch.float64)
    points = torch.stack([on[:-1], corner, on[1:]], 1)
    return points.to(dtype), weights.expand(pieces, 3).to(dtype).clone()


def circle(
    center: Vector,
    radius: float,
    normal: Vector = (0.0, 0.0, 1.0),
    start: float = 0.0,
    stop: float = 360.0,
    *,
    dtype: torch.dtype = torch.float64,
) -> tuple[Float[Tensor, "S 3 3"], Float[Tensor, "S 3"]]:
    """The arc of a circle in space, counter-clockwise seen from the tip of its normal, as rational quadratics.

    Angle 0 is the direction of x projected into the circle's plane (of y if the normal is along x).

    Raises:
        ValueError: the radius is not positive, or the normal not of three numbers or without a length; and as
            `ellipse`.
    """
    n, size = as_numbers("normal", normal, torch.float64), as_numbers("radius", radius, torch.float64)
    check_finite(radius=size, normal=n)
    length = torch.linalg.vector_norm(n)
    if n.shape != (3,) or size.ndim or not (size > 0 and length > 0):
        raise ValueError(f"expected a positive radius and a normal with a length, got {radius} and {normal}")
    n = n / length
    # Near the axis itself the projection of x is short and inaccurate.
    axis = torch.tensor([1.0, 0.0, 0.0] if n[0].abs() < 0.999 else [0.0, 1.0, 0.0], dtype=torch.float64)
    u = torch.nn.functional.normalize(axis - (axis @ n) * n, dim=0)
    v = torch.linalg.cross(n, u)
    return ellipse(center, radius * u, radius * v, start, stop, dtype=dtype)


def parabola(
    vertex: Vector, u: Vector, v: Vector, start: float, stop: float, *, dtype: torch.dtype = torch.float64
) -> tuple[Float[Tensor, "1 3 D"], Float[Tensor, "1 3"]]:
    """The arc vertex + s u + s² v, s from start to stop: one polynomial quadratic.

    Raises:
        TypeError: what should be numbers is none.
        ValueError: start equals stop, a value is not finite, or vertex, u and v differ in length.
    """
    p, a, b = _vectors(vertex=vertex, u=u, v=v)
    _check_range(start, stop)
    on = [p + s * a + s * s * b for s in (start, stop)]
    # The blossom of s -> p + s u + s² v at (start, stop).
    corner = p + (start + stop) / 2 * a + start * stop * b
    points = torch.stack([on[0], corner, on[1]])[None]
    return points.to(dtype), torch.ones(1, 3, dtype=dtype)


def _vectors(**values: Vector) -> list[Float[Tensor, " D"]]:
    """The values as finite vectors of one length; errors call them by their names."""
    vectors = {name: as_numbers(name, value, torch.float64) for name, value in values.items()}
    check_finite(**vectors)
    shapes = [tuple(x.shape) for x in vectors.values()]
    if len(shapes[0]) != 1 or len(set(shapes)) > 1:
        raise ValueError(f"{', '.join(values)} must be vectors of one length, got shapes {shapes}")
    return list(vectors.values())


def _check_range(start: float, stop: float) -> None:
    for name, value in (("start", start), ("stop", stop)):
        if as_numbers(name, value).ndim:
            raise TypeError(f"{name} must be one number, got {value}")
    if start == stop or not (math.isfinite(start) and math.isfinite(stop)):
        raise ValueError(f"start and stop must be finite and differ, got start {start}, stop {stop}")


def axes_of_conic(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> (
    tuple[Float[NDArray[np.float64], " 2"], Float[NDArray[np.float64], " 2"], Float[NDArray[np.float64], "2 2"]] | None
):
    """Centre, half axes (the longer one first) and their directions (columns, right-handed) of an ellipse.

    It is a x² + b x y + c y² + d x + e y + f = 0; None of other conics.
    """
    form = np.array([[a, b / 2], [b / 2, c]])
    if not np.linalg.det(form) > 0:
        return None
    center = -np.linalg.solve(form, (d, e)) / 2
    values, directions = np.linalg.eigh(-form / (f + center @ (d, e) / 2))
    if not values[0] > 0:
        return None
    # A reflected frame would turn the other way.
    directions[:, 1] *= np.sign(np.linalg.det(directions))
    return center, 1 / np.sqrt(values), directions
