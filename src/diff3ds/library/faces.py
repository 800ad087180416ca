"""Faces of the library's solids: the triangles that hide what lies behind a thing."""

from collections.abc import Callable
from dataclasses import dataclass

import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.bezier import evaluate

# Any number of triangles, float64, counter-clockwise seen from outside where they enclose a solid.
Faces = Float[Tensor, "_ 3 3"]

# Steps around an axis, and along a curve that is not straight: a circle's chord is off by .002 of its radius.
AROUND, ALONG = 48, 12
# Nearer than this, as a fraction of the control polygon, points are one and curves straight.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Solid:
    """Faces that are made when somebody asks for them, and the affine map that they have gone through since.

    Attributes:
        make: the faces at their first place.
        matrix: float64, 4 x 4, of homogeneous points.
    """

    make: Callable[[], Faces]
    matrix: Float[Tensor, "4 4"]

    def moved(self, matrix: Float[Tensor, "4 4"]) -> "Solid":
        """The same after one more affine map."""
        return Solid(self.make, matrix @ self.matrix)

    @property
    def faces(self) -> Faces:
        """The triangles, which a mirror leaves counter-clockwise."""
        linear, offset = self.matrix[:3, :3], self.matrix[:3, 3]
        moved = self.make() @ linear.T + offset
        return moved.flip(1) if torch.linalg.det(linear) < 0 else moved


def turned(profile: Float[Tensor, "N 4 4"], closed: bool) -> Faces:
    """The surface of revolution around z of a profile in the half plane y = 0.

    Args:
        closed: whether discs close it where the profile ends away from the axis.
    """
    angles = 2 * torch.pi * torch.arange(AROUND + 1, dtype=torch.float64) / AROUND
    directions = torch.stack([angles.cos(), angles.sin(), torch.zeros_like(angles)], 1)
    up = profile.new_tensor([0, 0, 1])
    parts, ends = [], []
    for curve in profile:
        # At the tip of a cone normals are of all sides: one step from it they are right, so steps are short.
        tipped = bool((curve[[0, -1], 0].abs() <= SAME).any())
        points = _along(curve[None], _straight(curve[None]) & (not tipped))[0]
        ends += [points[0], points[-1]]
        parts.append(_grid(points[:, None, :1] * directions + points[:, None, 2:] * up))
    for i, end in enumerate(ends if closed else []):
        alone = all(torch.dist(end, other) > SAME for k, other in enumerate(ends) if k != i)
        if alone and end[0] > SAME:
            parts.append(_fan(end[0] * directions[:-1] + end[2] * up))
    return torch.cat(parts)


def stretched_between(a: Float[Tensor, "N 4 4"], b: Float[Tensor, "N 4 4"]) -> Faces:
    """Faces from one chain of curves to another of as many; closed chains have faces within as well."""
    straight = _straight(a) & _straight(b)
    one, other = _outline(a, straight), _outline(b, straight)
    sides = _grid(torch.stack([one, other], 1))
    if torch.dist(one[0], one[-1]) > SAME:
        return sides
    return outwards(torch.cat([sides, filled(one[:-1]), filled(other[:-1].flip(0))]))


def within(outline: Float[Tensor, "N 4 4"]) -> Faces:
    """The faces within a closed chain of curves that lies nearly in a plane."""
    points = _outline(outline, _straight(outline))
    return filled(points[:-1] if torch.dist(points[0], points[-1]) <= SAME else points)


def ball(center: Float[Tensor, " 3"], radii: Float[Tensor, " 3"]) -> Faces:
    """An ellipsoid with axes along those of the frame."""
    across = 2 * torch.pi * torch.arange(AROUND + 1, dtype=torch.float64) / AROUND
    up = torch.linspace(-torch.pi / 2, torch.pi / 2, AROUND // 2 + 1, dtype=torch.float64)[:, None]
    flat = up.cos()
    sphere = torch.stack([flat * across.cos(), flat * across.sin(), up.sin().expand(-1, AROUND + 1)], -1)
    return outwards(_grid(center + sphere * radii))


def lofted(a: Float[Tensor, "N 4 4"], b: Float[Tensor, "M 4 4"], half: Float[Tensor, " W"]) -> Faces:
    """A body through ellipses that each reach from a point of one chain to a point of another.

    Args:
        a: chain of curves along one side of the body.
        b: chain along the other side; equal shares of the two chains belong together.
        half: half widths of the ellipses across, evenly spaced from the body's start to its end.
    """
    steps = torch.linspace(0, 1, 2 * ALONG + 1, dtype=torch.float64)
    one, other = _at(a, steps), _at(b, steps)
    middle, reach = (one + other) / 2, (one - other) / 2
    onwards = torch.gradient(middle, dim=0)[0]
    across = torch.nn.functional.normalize(torch.linalg.cross(reach, onwards), dim=1)
    # Where the ellipse has no size it has no direction: that of the body's middle is as good.
    across = torch.where(torch.linalg.vector_norm(across, dim=1, keepdim=True) > 0.5, across, across[ALONG])
    place = steps * (len(half) - 1)
    lower = place.floor().long().clamp(max=max(len(half) - 2, 0))
    upper = (lower + 1).clamp(max=len(half) - 1)
    width = half[lower] + (half[upper] - half[lower]) * (place - lower)
    angles = 2 * torch.pi * torch.arange(AROUND + 1, dtype=torch.float64) / AROUND
    rings = (
        middle[:, None]
        + angles.cos()[:, None] * reach[:, None]
        + angles.sin()[:, None] * (across * width[:, None])[:, None]
    )
    return outwards(torch.cat([_grid(rings), _fan(rings[0, :-1].flip(0)), _fan(rings[-1, :-1])]))


def lofted_through(a: Float[Tensor, "N 4 4"], b: Float[Tensor, "M 4 4"], sections: Float[Tensor, "S 4"]) -> Faces:
    """A body as `lofted`, as wide at places as these sections say, and evenly wider or narrower between them.

    Args:
        a: as for `lofted`.
        b: as for `lofted`.
        sections: a place in the middle of the body, and half of the width across there.
    """
    steps = torch.linspace(0, 1, 2 * ALONG + 1, dtype=torch.float64)
    middle = (_at(a, steps) + _at(b, steps)) / 2
    at, order = torch.cdist(sections[:, :3], middle).argmin(1).sort()
    half = sections[order, 3]
    upper = torch.searchsorted(at, torch.arange(len(steps)), right=True).clamp(1, len(at) - 1)
    span = (at[upper] - at[upper - 1]).clamp(min=1)
    share = ((torch.arange(len(steps)) - at[upper - 1]) / span).clamp(0, 1)
    return lofted(a, b, torch.lerp(half[upper - 1], half[upper], share.double()))


def filled(loop: Float[Tensor, "P 3"]) -> Faces:
    """The triangles within a polygon that lies nearly in a plane, found by cutting off its ears (Meisters 1975)."""
    normal = torch.linalg.cross(loop, loop.roll(-1, 0)).sum(0)
    flat = loop @ _plane(normal).T
    left, found = list(range(len(loop))), []
    while len(left) > 3:
        ear = next((i for i in range(len(left)) if _is_ear(flat, left, i)), 0)
        found.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return loop[torch.tensor([*found, tuple(left)])]


def outwards(faces: Faces) -> Faces:
    """The faces of a closed solid turned so that they are counter-clockwise seen from outside."""
    a, b, c = (faces - faces.mean((0, 1))).unbind(1)
    return faces.flip(1) if (a * torch.linalg.cross(b, c)).sum() < 0 else faces


def _is_ear(flat: Float[Tensor, "P 2"], left: list[int], i: int) -> bool:
    """Whether the corner is convex and no other lies in the triangle that it makes with its neighbours."""
    a, b, c = (flat[left[k % len(left)]] for k in (i - 1, i, i + 1))
    if _turn(a, b, c) <= 0:
        return False
    kept = {left[i - 1], left[i], left[(i + 1) % len(left)]}
    others = flat[[k for k in left if k not in kept]]
    # On the border counts as inside: the rest of the polygon would touch itself there.
    least = -SAME * _turn(a, b, c)
    inside = (_turn(a, b, others) >= least) & (_turn(b, c, others) >= least) & (_turn(c, a, others) >= least)
    return not bool(inside.any())


def _turn(a: Float[Tensor, " 2"], b: Float[Tensor, " 2"], c: Float[Tensor, "*N 2"]) -> Float[Tensor, "*N"]:
    """Twice the signed area of a triangle."""
    ab, ac = b - a, c - a
    area: Tensor = ab[0] * ac[..., 1] - ab[1] * ac[..., 0]
    return area


def _plane(normal: Float[Tensor, " 3"]) -> Float[Tensor, "2 3"]:
    """Two directions in the plane with a normal, counter-clockwise seen from where it points."""
    axis = torch.eye(3, dtype=torch.float64)[int(normal.abs().argmin())]
    u = torch.nn.functional.normalize(torch.linalg.cross(normal, axis), dim=0)
    v = torch.nn.functional.normalize(torch.linalg.cross(normal, u), dim=0)
    return torch.stack([u, v])


def _grid(points: Float[Tensor, "R C 3"]) -> Faces:
    """Two triangles for each cell of a grid of points."""
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    return torch.stack([torch.stack([a, b, c], -2), torch.stack([a, c, d], -2)]).reshape(-1, 3, 3)


def _fan(loop: Float[Tensor, "P 3"]) -> Faces:
    """Triangles from the middle of a loop."""
    return torch.stack([loop.mean(0).expand_as(loop), loop, loop.roll(-1, 0)], 1)


def _straight(curves: Float[Tensor, "N 4 4"]) -> Bool[Tensor, " N"]:
    points = curves[..., :3] / curves[..., 3:]
    chord = points[:, -1:] - points[:, :1]
    aside = torch.linalg.vector_norm(torch.linalg.cross(points - points[:, :1], chord.expand_as(points)), dim=-1)
    straight: Tensor = aside.amax(1) <= SAME * chord.square().sum((1, 2)).clamp(min=SAME)
    return straight


def _along(curves: Float[Tensor, "N 4 4"], straight: Bool[Tensor, " N"]) -> list[Float[Tensor, "S 3"]]:
    """Points along each curve: its ends, and steps between them if it is not straight."""
    found = []
    for curve, is_straight in zip(curves, straight, strict=True):
        t = torch.linspace(0, 1, 2 if is_straight else ALONG + 1, dtype=torch.float64)
        found.append(evaluate(curve[None, :, :3] / curve[None, :, 3:], curve[None, :, 3].contiguous(), t)[0])
    return found


def _outline(curves: Float[Tensor, "N 4 4"], straight: Bool[Tensor, " N"]) -> Float[Tensor, "P 3"]:
    """Points along a chain from its start to its end, each once."""
    parts = _along(curves, straight)
    return torch.cat([*(part[:-1] for part in parts), parts[-1][-1:]])


def _at(curves: Float[Tensor, "N 4 4"], shares: Float[Tensor, " S"]) -> Float[Tensor, "S 3"]:
    """Points at shares of a chain's length."""
    points = _outline(curves, torch.zeros(len(curves), dtype=torch.bool))
    length = torch.cat([shares.new_zeros(1), torch.linalg.vector_norm(points[1:] - points[:-1], dim=1).cumsum(0)])
    wanted = shares * length[-1]
    upper = torch.searchsorted(length, wanted).clamp(1, len(points) - 1)
    span = (length[upper] - length[upper - 1]).clamp(min=1e-300)
    return torch.lerp(points[upper - 1], points[upper], ((wanted - length[upper - 1]) / span)[:, None])
