"""Lines, circles, boxes and turned profiles: the strokes that the categories are put together from.

Strokes here are float64 tensors (N, 4, 4): N cubics of four homogeneous control points (w x, w y, w z, w), so that one
matrix moves, turns, stretches or mirrors them and circles stay exact. Axes: x to the front, y to the right of someone
who looks at the front, z up. Angles are in degrees.
"""

import math
from collections.abc import Sequence

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import catmull_rom

# Any number of strokes.
Strokes = Float[Tensor, "_ 4 4"]
Vector = Sequence[float]

# Angle 0 and angle 90 of circles around each axis; a wheel (axis y) starts to the front and goes up.
_PLANES = {"x": ((0, 1, 0), (0, 0, 1)), "y": ((1, 0, 0), (0, 0, 1)), "z": ((1, 0, 0), (0, 1, 0))}
_AXES = {"x": 0, "y": 1, "z": 2}
# Where the control points of a straight cubic of constant speed lie.
_THIRDS = torch.linspace(0, 1, 4, dtype=torch.float64)[:, None]


def join(*parts: Strokes) -> Strokes:
    """The strokes of all parts."""
    return torch.cat(parts)


def curve(*points: Vector) -> Strokes:
    """One polynomial cubic with these four control points."""
    return _homogeneous(_tensor(points)[None])


def line(a: Vector, b: Vector) -> Strokes:
    """A straight stroke from a to b."""
    return polyline(a, b)


def polyline(*points: Vector, closed: bool = False) -> Strokes:
    """Straight strokes from point to point, and back to the first if closed."""
    p = _tensor((*points, points[0]) if closed else points)
    return _homogeneous(p[:-1, None] + _THIRDS * (p[1:] - p[:-1])[:, None])


def smooth(*points: Vector, closed: bool = False) -> Strokes:
    """Cubics from point to point with common tangents (Catmull and Rom 1974); closed: smooth at the first too."""
    p = _tensor((points[-1], *points, points[0], points[1]) if closed else (points[0], *points, points[-1]))
    tangents = (p[2:] - p[:-2]) / 2
    a, b = p[1:-2], p[2:-1]
    return _homogeneous(torch.stack([a, a + tangents[:-1] / 3, b - tangents[1:] / 3, b], 1))


def spline(*points: Vector, closed: bool = False) -> Strokes:
    """Cubics through the points, smooth however far apart these are (centripetal, where `smooth` is uniform)."""
    return _homogeneous(catmull_rom(_tensor(points), closed))


def side(*points: Sequence[float], y: float = 0.0, closed: bool = False) -> Strokes:
    """`spline` through points (x, z), as one sees them from the side."""
    return spline(*((x, y, z) for x, z in points), closed=closed)


def ellipse(center: Vector, u: Vector, v: Vector, start: float = 0.0, stop: float = 360.0) -> Strokes:
    """The arc center + u cos(angle) + v sin(angle), exact, as rational cubics of at most 180 degrees.

    A quadratic of half angle h has the middle weight cos h, which is 0 for a half circle; raised to a cubic its inner
    weights are (1 + 2 cos h) / 3, and the half circle is as good as any.
    """
    pieces = math.ceil(abs(stop - start) / 180)
    angles = torch.deg2rad(torch.linspace(start, stop, pieces + 1, dtype=torch.float64))
    frame = torch.stack([_tensor(u), _tensor(v)])

    def directions(at: Tensor) -> Tensor:
        return torch.stack([at.cos(), at.sin()], -1) @ frame

    cosine = ((angles[1] - angles[0]) / 2).cos()
    on = _homogeneous(_tensor(center) + directions(angles))
    # The quadratic's middle point times its weight.
    middle = torch.cat(
        [cosine * _tensor(center) + directions((angles[:-1] + angles[1:]) / 2), cosine.expand(pieces, 1)], 1
    )
    a, b = on[:-1], on[1:]
    return torch.stack([a, (a + 2 * middle) / 3, (b + 2 * middle) / 3, b], 1)


def ring(center: Vector, radius: float, axis: str = "z", start: float = 0.0, stop: float = 360.0) -> Strokes:
    """A circle, or an arc of it, around an axis: two strokes if whole.

    Angle 0 and angle 90 lie to +x and +y around z, to +x and +z around y (a wheel), to +y and +z around x (a clock).
    """
    u, v = _tensor(_PLANES[axis]) * radius
    return ellipse(center, u.tolist(), v.tolist(), start, stop)


def rectangle(center: Vector, size: Sequence[float], axis: str = "z") -> Strokes:
    """Four lines; `size` is along the two axes of angle 0 and 90 of `ring`."""
    u, v = (_tensor(side) * length / 2 for side, length in zip(_PLANES[axis], size, strict=True))
    c = _tensor(center)
    return polyline(*(p.tolist() for p in (c - u - v, c + u - v, c + u + v, c - u + v)), closed=True)


def box(center: Vector, size: Vector) -> Strokes:
    """The twelve edges of a box with sides along the axes."""
    x, y, z = center
    return between(rectangle((x, y, z - size[2] / 2), size[:2]), rectangle((x, y, z + size[2] / 2), size[:2]))


def between(a: Strokes, b: Strokes) -> Strokes:
    """Two chains of equally many strokes, and lines that join where their strokes start."""
    starts = torch.stack([a[:, 0], b[:, 0]], 1)
    points = starts[..., :3] / starts[..., 3:]
    return join(a, b, _homogeneous(points[:, :1] + _THIRDS * (points[:, 1:] - points[:, :1])))


def extrude(outline: Strokes, offset: Vector) -> Strokes:
    """The outline, its copy moved by `offset`, and lines between them where the outline's strokes start."""
    return between(outline, move(outline, offset))


def lathe(profile: Strokes, rings: Sequence[tuple[float, float]], meridians: int = 4, start: float = 0.0) -> Strokes:
    """A surface of revolution around z: copies of a profile drawn in the half plane y = 0, x > 0, and circles.

    Args:
        rings: (radius, height) of the circles.
        start: angle of the first meridian.
    """
    circles = [ring((0, 0, height), radius) for radius, height in rings]
    return join(around(turn(profile, start), meridians), *circles)


def move(strokes: Strokes, offset: Vector) -> Strokes:
    """The strokes moved by a vector."""
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3, 3] = _tensor(offset)
    return strokes @ matrix.T


def stretch(strokes: Strokes, factors: Vector) -> Strokes:
    """The strokes scaled along x, y and z, about the origin."""
    return strokes * _tensor((*factors, 1.0))


def turn(strokes: Strokes, angle: float, axis: str = "z", about: Vector = (0.0, 0.0, 0.0)) -> Strokes:
    """The strokes turned in the sense in which the angles of `ring` grow, around an axis through a point."""
    u, v = _tensor(_PLANES[axis])
    cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3, :3] += (cosine - 1) * (torch.outer(u, u) + torch.outer(v, v))
    matrix[:3, :3] += sine * (torch.outer(v, u) - torch.outer(u, v))
    return move(move(strokes, [-x for x in about]) @ matrix.T, about)


def around(strokes: Strokes, count: int, axis: str = "z", about: Vector = (0.0, 0.0, 0.0)) -> Strokes:
    """`count` copies, evenly turned around an axis through a point; the first is the original."""
    return join(*(turn(strokes, 360 * i / count, axis, about) for i in range(count)))


def reflect(strokes: Strokes, axis: str = "y") -> Strokes:
    """The mirror image, with the sign of one coordinate changed."""
    factors = [1.0, 1.0, 1.0]
    factors[_AXES[axis]] = -1.0
    return stretch(strokes, factors)


def mirror(strokes: Strokes, *axes: str) -> Strokes:
    """The strokes and their mirror image; for several axes, those of both mirrored again (default: y)."""
    for axis in axes or ("y",):
        strokes = join(strokes, reflect(strokes, axis))
    return strokes


def _tensor(values: Sequence[float] | Sequence[Vector]) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def _homogeneous(points: Tensor) -> Tensor:
    return torch.cat([points, torch.ones_like(points[..., :1])], -1)
