"""Lines, circles, boxes and turned profiles: the parts that the categories are put together from.

A part is strokes, and the faces between them where it is solid. One matrix moves, turns, stretches or mirrors both, and
circles stay exact. Axes: x to the front, y to the right of someone who looks at the front, z up. Angles are in degrees.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import catmull_rom
from diff3ds.library import faces
from diff3ds.library.faces import Faces, Solid

# Any number of cubics, float64: four homogeneous control points (w x, w y, w z, w) each.
Strokes = Float[Tensor, "_ 4 4"]
Vector = Sequence[float]

# Angle 0 and angle 90 of circles around each axis; a wheel (axis y) starts to the front and goes up.
_PLANES = {"x": ((0, 1, 0), (0, 0, 1)), "y": ((1, 0, 0), (0, 0, 1)), "z": ((1, 0, 0), (0, 1, 0))}
_AXES = {"x": 0, "y": 1, "z": 2}
# Where the control points of a straight cubic of constant speed lie.
_THIRDS = torch.linspace(0, 1, 4, dtype=torch.float64)[:, None]


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a thing.

    Attributes:
        strokes: that draw it.
        solids: what of it hides things that lie behind it; wires have none.
        detail: whether drawings of the thing may lack it.
    """

    strokes: Strokes
    solids: tuple[Solid, ...] = ()
    detail: bool = False

    def __len__(self) -> int:
        return len(self.strokes)

    def __getitem__(self, which: slice) -> "Part":
        """Some of the strokes, as wires."""
        return Part(self.strokes[which])

    @property
    def faces(self) -> Faces:
        """The triangles of all solids."""
        return torch.cat([torch.zeros(0, 3, 3, dtype=torch.float64), *(solid.faces for solid in self.solids)])

    def mapped(self, matrix: Float[Tensor, "4 4"]) -> "Part":
        """The part after an affine map of homogeneous points."""
        return Part(self.strokes @ matrix.T, tuple(solid.moved(matrix) for solid in self.solids))


def detail(part: Part) -> Part:
    """The part as a detail, such as the windows of a house: what a drawing lacks of these is left out of the thing.

    Said last: of a part that is moved or joined to others after that it is forgotten.
    """
    return replace(part, detail=True)


def join(*parts: Part) -> Part:
    """All parts as one."""
    return Part(torch.cat([part.strokes for part in parts]), tuple(solid for part in parts for solid in part.solids))


def curve(*points: Vector) -> Part:
    """One polynomial cubic with these four control points."""
    return _wire(_tensor(points)[None])


def line(a: Vector, b: Vector) -> Part:
    """A straight stroke from a to b."""
    return polyline(a, b)


def polyline(*points: Vector, closed: bool = False) -> Part:
    """Straight strokes from point to point, and back to the first if closed."""
    p = _tensor((*points, points[0]) if closed else points)
    return _wire(p[:-1, None] + _THIRDS * (p[1:] - p[:-1])[:, None])


def smooth(*points: Vector, closed: bool = False) -> Part:
    """Cubics from point to point with common tangents (Catmull and Rom 1974); closed: smooth at the first too."""
    p = _tensor((points[-1], *points, points[0], points[1]) if closed else (points[0], *points, points[-1]))
    tangents = (p[2:] - p[:-2]) / 2
    a, b = p[1:-2], p[2:-1]
    return _wire(torch.stack([a, a + tangents[:-1] / 3, b - tangents[1:] / 3, b], 1))


def spline(*points: Vector, closed: bool = False) -> Part:
    """Cubics through the points, smooth however far apart these are (centripetal, where `smooth` is uniform)."""
    return _wire(catmull_rom(_tensor(points), closed))


def side(*points: Sequence[float], y: float = 0.0, closed: bool = False) -> Part:
    """`spline` through points (x, z), as one sees them from the side."""
    return spline(*((x, y, z) for x, z in points), closed=closed)


def ellipse(center: Vector, u: Vector, v: Vector, start: float = 0.0, stop: float = 360.0) -> Part:
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
    return Part(torch.stack([a, (a + 2 * middle) / 3, (b + 2 * middle) / 3, b], 1))


def ring(center: Vector, radius: float, axis: str = "z", start: float = 0.0, stop: float = 360.0) -> Part:
    """A circle, or an arc of it, around an axis: two strokes if whole.

    Angle 0 and angle 90 lie to +x and +y around z, to +x and +z around y (a wheel), to +y and +z around x (a clock).
    """
    u, v = _tensor(_PLANES[axis]) * radius
    return ellipse(center, u.tolist(), v.tolist(), start, stop)


def rectangle(center: Vector, size: Sequence[float], axis: str = "z") -> Part:
    """Four lines; `size` is along the two axes of angle 0 and 90 of `ring`."""
    u, v = (_tensor(side) * length / 2 for side, length in zip(_PLANES[axis], size, strict=True))
    c = _tensor(center)
    return polyline(*(p.tolist() for p in (c - u - v, c + u - v, c + u + v, c - u + v)), closed=True)


def box(center: Vector, size: Vector) -> Part:
    """A box with sides along the axes, by its twelve edges."""
    x, y, z = center
    return between(rectangle((x, y, z - size[2] / 2), size[:2]), rectangle((x, y, z + size[2] / 2), size[:2]))


def between(a: Part, b: Part) -> Part:
    """Two chains of equally many strokes and lines that join where their strokes start; solid if they are closed."""
    starts = torch.stack([a.strokes[:, 0], b.strokes[:, 0]], 1)
    points = starts[..., :3] / starts[..., 3:]
    posts = _wire(points[:, :1] + _THIRDS * (points[:, 1:] - points[:, :1]))
    return join(a, b, posts, _solid(partial(faces.stretched_between, a.strokes, b.strokes)))


def extrude(outline: Part, offset: Vector) -> Part:
    """The outline, its copy moved by `offset`, and lines between them where the outline's strokes start."""
    return between(outline, move(outline, offset))


def lathe(
    profile: Part,
    rings: Sequence[tuple[float, float]],
    meridians: int = 4,
    start: float = 0.0,
    open: bool = False,
) -> Part:
    """A surface of revolution around z: copies of a profile drawn in the half plane y = 0, x > 0, and circles.

    Args:
        profile: the strokes that are turned.
        rings: (radius, height) of the circles.
        meridians: so many copies of the profile.
        start: angle of the first meridian.
        open: whether one looks into it where the profile ends away from the axis, as into a mug.
    """
    circles = [ring((0, 0, height), radius) for radius, height in rings]
    solid = _solid(partial(faces.turned, profile.strokes, not open))
    return join(around(turn(profile, start), meridians), *circles, solid)


def ball(center: Vector, radii: float | Vector) -> Part:
    """An ellipsoid with axes along those of the frame: no stroke, but it hides what lies behind it."""
    sizes = (radii,) * 3 if isinstance(radii, int | float) else radii
    return _solid(partial(faces.ball, _tensor(center), _tensor(sizes)))


def solid(part: Part) -> Part:
    """What of a part hides things that lie behind it, without its strokes."""
    return Part(part.strokes[:0], part.solids)


def filled(outline: Part) -> Part:
    """A closed outline, nearly in a plane, with the face within."""
    return join(outline, _solid(partial(faces.within, outline.strokes)))


def flesh(a: Part, b: Part, *half: float) -> Part:
    """A round body from one chain of strokes to another: no stroke, but it hides what lies behind it.

    Args:
        a: along one side of the body, from its start to its end.
        b: along the other side, in the same direction.
        half: half of its width across, at evenly spaced places from the start to the end.
    """
    return _solid(partial(faces.lofted, a.strokes, b.strokes, _tensor(half)))


def body(a: Part, b: Part, *sections: tuple[Vector, float]) -> Part:
    """A round body as `flesh`, with half of its width across at two or more places in its middle.

    Args:
        a: as for `flesh`.
        b: as for `flesh`.
        sections: places and half widths, in any order.
    """
    table = _tensor([(*place, half) for place, half in sections])
    return _solid(partial(faces.lofted_through, a.strokes, b.strokes, table))


def sheet(a: Part, b: Part) -> Part:
    """The faces from one chain of strokes to another of as many: no stroke, but they hide what lies behind them."""
    return solid(between(a, b))


def backwards(part: Part) -> Part:
    """A chain of strokes from its end to its start, as wires."""
    return Part(part.strokes.flip(0, 1))


def move(part: Part, offset: Vector) -> Part:
    """The part moved by a vector."""
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3, 3] = _tensor(offset)
    return part.mapped(matrix)


def stretch(part: Part, factors: Vector) -> Part:
    """The part scaled along x, y and z, about the origin."""
    return part.mapped(torch.diag(_tensor((*factors, 1.0))))


def turn(part: Part, angle: float, axis: str = "z", about: Vector = (0.0, 0.0, 0.0)) -> Part:
    """The part turned in the sense in which the angles of `ring` grow, around an axis through a point."""
    u, v = _tensor(_PLANES[axis])
    cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3, :3] += (cosine - 1) * (torch.outer(u, u) + torch.outer(v, v))
    matrix[:3, :3] += sine * (torch.outer(v, u) - torch.outer(u, v))
    return move(move(part, [-x for x in about]).mapped(matrix), about)


def around(part: Part, count: int, axis: str = "z", about: Vector = (0.0, 0.0, 0.0)) -> Part:
    """`count` copies, evenly turned around an axis through a point; the first is the original."""
    return join(*(turn(part, 360 * i / count, axis, about) for i in range(count)))


def reflect(part: Part, axis: str = "y") -> Part:
    """The mirror image, with the sign of one coordinate changed."""
    factors = [1.0, 1.0, 1.0]
    factors[_AXES[axis]] = -1.0
    return stretch(part, factors)


def mirror(part: Part, *axes: str) -> Part:
    """The part and its mirror image; for several axes, both mirrored again (default: y)."""
    for axis in axes or ("y",):
        part = join(part, reflect(part, axis))
    return part


def _tensor(values: Sequence[float] | Sequence[Vector]) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def _homogeneous(points: Tensor) -> Tensor:
    return torch.cat([points, torch.ones_like(points[..., :1])], -1)


def _wire(points: Float[Tensor, "N 4 3"]) -> Part:
    return Part(_homogeneous(points))


def _solid(make: Callable[[], Faces]) -> Part:
    """A part without strokes."""
    return Part(torch.zeros(0, 4, 4, dtype=torch.float64), (Solid(make, torch.eye(4, dtype=torch.float64)),))
