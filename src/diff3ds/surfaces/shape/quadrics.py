"""Unions of ellipsoids, cylinders and cones, whose contours are conics: rational quadratics in closed form."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from diff3ds._checks import as_numbers, check_finite
from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier import ellipse
from diff3ds.camera import Cameras

# Whole circles and ellipses are drawn in so many arcs: weights cos 45 degrees.
ARCS = 4


@dataclass(frozen=True, eq=False)
class Quadrics:
    """N solids, the images of simple ones under affine maps: x = center + axes y; together one surface, their union.

    An ellipsoid is the image of the unit ball. Cylinders and cones are those of the round solid about the last axis
    between y3 = -1, where its radius is 1, and y3 = 1, where it is `taper`: 1 for a cylinder, 0 for a cone.

    Attributes:
        center: middles, world units.
        axes: columns are the half axes of an ellipsoid, or conjugate half diameters; of a cylinder two of the end at
            y3 = -1, and half of its length.
        taper: radius at the end over that at the start; of ellipsoids it means nothing.
        is_round: which are ellipsoids.

    Raises:
        TypeError, ValueError: other shapes or dtypes, values that are not finite, axes in one plane, a taper that is
            negative.
    """

    center: Float[Tensor, "N 3"]
    axes: Float[Tensor, "N 3 3"]
    taper: Float[Tensor, " N"]
    is_round: Bool[Tensor, " N"]

    def __post_init__(self) -> None:
        count = len(self.center)
        for name, shape in (("center", (count, 3)), ("axes", (count, 3, 3)), ("taper", (count,))):
            value = getattr(self, name)
            if not isinstance(value, Tensor) or not value.is_floating_point():
                raise TypeError(f"{name} must be a floating point tensor, got {type(value).__name__}")
            if tuple(value.shape) != shape:
                raise ValueError(f"{name} must have shape {shape}, got {tuple(value.shape)}")
            check_finite(**{name: value})
        if tuple(self.is_round.shape) != (count,):
            raise ValueError(f"is_round must have shape {(count,)}, got {tuple(self.is_round.shape)}")
        lengths = torch.linalg.vector_norm(self.axes.detach(), dim=1).prod(-1)
        flat = ~(self.axes.detach().det().abs() > 1e-9 * lengths)
        if bool(flat.any()):
            raise ValueError(f"axes of solid {int(flat.int().argmax())} must not lie in one plane")
        if bool((self.taper < 0).any()):
            raise ValueError(f"taper must not be negative, got {float(self.taper.min()):g}")

    @staticmethod
    def ellipsoids(center: object, axes: object) -> "Quadrics":
        """Ellipsoids: centers (N, 3); their axes (N, 3, 3) as columns, three radii (N, 3), or one number each (N,)."""
        c, a = _placed(center, axes)
        return Quadrics(c, a, torch.ones_like(c[:, 0]), torch.ones(len(c), dtype=torch.bool, device=c.device))

    @staticmethod
    def cylinders(start: object, stop: object, radius: object, taper: object = 1.0) -> "Quadrics":
        """Round cylinders, or cones, between two points.

        Args:
            start: (N, 3).
            stop: (N, 3).
            radius: at the start, (N,) or a number.
            taper: radius at the stop over that at the start, (N,) or a number: 0 for a whole cone.
        """
        a, b = _rows("start", start, 3), _rows("stop", stop, 3)
        if a.shape != b.shape:
            raise ValueError(f"start and stop must be of one shape, got {tuple(a.shape)} and {tuple(b.shape)}")
        half = (b - a) / 2
        n = torch.nn.functional.normalize(half, dim=1)
        # The axis of the world that is farthest from the solid's.
        aside = torch.nn.functional.one_hot(n.detach().abs().argmin(1), 3).to(n)
        u = torch.nn.functional.normalize(torch.linalg.cross(n, aside), dim=1)
        r = as_numbers("radius", radius, a.dtype, a.device).expand(len(a))[:, None]
        axes = torch.stack([r * u, r * torch.linalg.cross(n, u), half], 2)
        narrow = as_numbers("taper", taper, a.dtype, a.device).expand(len(a))
        return Quadrics((a + b) / 2, axes, narrow, torch.zeros(len(a), dtype=torch.bool, device=a.device))

    @staticmethod
    def concatenate(parts: "Sequence[Quadrics]") -> "Quadrics":
        """The union of all."""
        if not parts:
            raise ValueError("expected at least one part, got none")
        names = ("center", "axes", "taper", "is_round")
        center, axes, taper, is_round = (torch.cat([getattr(part, name) for part in parts]) for name in names)
        return Quadrics(center, axes, taper, is_round)

    def __len__(self) -> int:
        return len(self.center)

    def __getitem__(self, rows: int | slice | list[int] | Tensor) -> "Quadrics":
        """Some of the solids."""
        chosen = [rows] if isinstance(rows, int) else rows
        return Quadrics(self.center[chosen], self.axes[chosen], self.taper[chosen], self.is_round[chosen])

    def to(self, target: torch.dtype | torch.device | str) -> "Quadrics":
        """The same solids in another dtype or on another device."""
        center = self.center.to(target)
        return Quadrics(center, self.axes.to(target), self.taper.to(target), self.is_round.to(center.device))

    def to_local(self) -> Float[Tensor, "N 4 4"]:
        """From homogeneous points of the world to y; float64."""
        a, b, c = self.axes.double().unbind(2)
        # By Cramer's rule: for matrices of this size libraries spend their time on threads.
        inverse = torch.stack([torch.linalg.cross(x, y) for x, y in ((b, c), (c, a), (a, b))], 1)
        inverse = inverse / (a * inverse[:, 0]).sum(1)[:, None, None]
        shift = -(inverse @ self.center.double()[..., None])
        bottom = inverse.new_tensor([0.0, 0.0, 0.0, 1.0]).expand(len(self), 1, 4)
        return torch.cat([torch.cat([inverse, shift], 2), bottom], 1)

    def forms(self) -> Float[Tensor, "N 4 4"]:
        """Quadratic forms of homogeneous points, negative inside: of cones, of the whole cone without its ends."""
        local = self.to_local()
        one, zero = torch.ones_like(local[:, 0, 0]), torch.zeros_like(local[:, 0, 0])
        middle, slope = self._radius()
        ball = torch.diag(one.new_tensor([1.0, 1.0, 1.0, -1.0])).expand(len(self), 4, 4)
        # y1² + y2² - (middle + slope y3)².
        rows = [
            torch.stack([one, zero, zero, zero], 1),
            torch.stack([zero, one, zero, zero], 1),
            torch.stack([zero, zero, -slope * slope, -middle * slope], 1),
            torch.stack([zero, zero, -middle * slope, -middle * middle], 1),
        ]
        form = torch.where(self.is_round[:, None, None], ball, torch.stack(rows, 1))
        return local.mT @ form @ local

    def _radius(self) -> tuple[Float[Tensor, " N"], Float[Tensor, " N"]]:
        """Of cylinders and cones the radius in the middle, and its change with y3."""
        taper = self.taper.double()
        return (taper + 1) / 2, (taper - 1) / 2


@dataclass(frozen=True, eq=False)
class Conics:
    """Rational quadratics on solids.

    Attributes:
        points: control points, float64.
        weights: positive.
        solid: which solid each lies on.
        kind: 0 for a contour, 1 and 2 for the ends of cylinders and cones at y3 = -1 and y3 = 1.
        following: the conic that begins where each ends, or -1.
    """

    points: Float[Tensor, "C 3 3"]
    weights: Float[Tensor, "C 3"]
    solid: Int[Tensor, " C"]
    kind: Int[Tensor, " C"]
    following: Int[Tensor, " C"]


def conics(solids: Quadrics, cameras: Cameras, view: int) -> Conics:
    """The contours of all solids from one camera, each by itself, and the ends of cylinders and cones.

    Differentiable with respect to the solids and the camera.
    """
    local = solids.to_local()
    eye = (local * _eye(cameras, view).to(local)).sum(-1)
    round_ones = solids.is_round.nonzero()[:, 0]
    others = (~solids.is_round).nonzero()[:, 0]
    parts = [_ball_contours(eye, round_ones), _line_contours(solids, eye, others), _ends(solids, others)]
    points = torch.cat([points for points, _, _, _, _ in parts])
    weights = torch.cat([weights for _, weights, _, _, _ in parts])
    solid = torch.cat([solid for _, _, solid, _, _ in parts])
    kind = torch.cat([kind for _, _, _, kind, _ in parts])
    before = [0, len(parts[0][0]), len(parts[0][0]) + len(parts[1][0])]
    following = torch.cat([torch.where(p[4] < 0, -1, p[4] + n) for p, n in zip(parts, before, strict=True)])
    axes = solids.axes.double()[solid]
    placed = solids.center.double()[solid][:, None] + (points[:, :, None] * axes[:, None]).sum(-1)
    return Conics(placed, weights, solid, kind, following)


def _eye(cameras: Cameras, view: int) -> Float[Tensor, " 4"]:
    """Where lines of sight meet: the camera, or far behind it."""
    if not cameras.orthographic:
        return torch.cat([cameras.centers[view].double(), torch.ones(1, dtype=torch.float64)])
    backwards = -cameras.world_to_camera[view, 2, :3].double()
    return torch.cat([backwards, torch.zeros(1, dtype=torch.float64)])


_Parts = tuple[Tensor, Tensor, Tensor, Tensor, Tensor]


def _ball_contours(eye: Float[Tensor, "N 4"], chosen: Int[Tensor, " B"]) -> _Parts:
    """y·u = h, the polar plane of the eye (u, h), cuts the unit sphere in a circle."""
    u, h = eye[chosen, :3], eye[chosen, 3:]
    square = (u * u).sum(1, keepdim=True)
    outside = (square[:, 0] > h[:, 0] ** 2).nonzero()[:, 0]
    u, h, square = u[outside], h[outside], square[outside]
    middle = h * u / square
    radius = (1 - h * h / square).sqrt()
    # Any two directions across u do: none is chosen by components that may be equal.
    aside = torch.nn.functional.one_hot(u.detach().abs().argmin(1), 3).to(u)
    first = torch.nn.functional.normalize(torch.linalg.cross(u, aside), dim=1)
    second = torch.nn.functional.normalize(torch.linalg.cross(u, first), dim=1)
    return _circles(middle, radius * first, radius * second, chosen[outside], 0)


def _circles(
    middle: Float[Tensor, "B 3"],
    first: Float[Tensor, "B 3"],
    second: Float[Tensor, "B 3"],
    solid: Int[Tensor, " B"],
    kind: int,
) -> _Parts:
    """Whole ellipses, in arcs."""
    origin, x, y = torch.zeros(3), torch.tensor([1.0, 0, 0]), torch.tensor([0.0, 1, 0])
    unit, weights = ellipse(origin, x, y)
    frame = torch.stack([first, second, middle], 1)
    shape = torch.cat([unit[..., :2], torch.ones_like(unit[..., :1])], -1).to(frame)
    points = (shape[None] @ frame[:, None]).flatten(0, 1)
    count = len(middle)
    number = torch.arange(count * ARCS, device=middle.device)
    following = torch.where(number % ARCS == ARCS - 1, number - ARCS + 1, number + 1)
    owner = solid.repeat_interleave(ARCS)
    return points, weights.to(frame).repeat(count, 1), owner, torch.full_like(owner, kind), following


def _line_contours(solids: Quadrics, eye: Float[Tensor, "N 4"], chosen: Int[Tensor, " B"]) -> _Parts:
    """Where cos(θ - θu) is the radius at the eye's height over the eye's distance from the axis."""
    middle, slope = (value[chosen] for value in solids._radius())
    u = eye[chosen]
    away = torch.linalg.vector_norm(u[:, :2], dim=1)
    level = middle * u[:, 3] + slope * u[:, 2]
    beside = (away > level.abs()).nonzero()[:, 0]
    u, away, level, middle, slope = (value[beside] for value in (u, away, level, middle, slope))
    cosine = level / away
    sine = (1 - cosine * cosine).sqrt()
    direction = u[:, :2] / away[:, None]
    across = torch.stack([-direction[:, 1], direction[:, 0]], 1)
    sides = []
    for sign in (1.0, -1.0):
        foot = cosine[:, None] * direction + sign * sine[:, None] * across
        ends = [torch.cat([(middle + z * slope)[:, None] * foot, torch.full_like(foot[:, :1], z)], 1) for z in (-1, 1)]
        sides.append(torch.stack([ends[0], (ends[0] + ends[1]) / 2, ends[1]], 1))
    points = torch.stack(sides, 1).flatten(0, 1)
    owner = chosen[beside].repeat_interleave(2)
    nothing = torch.full_like(owner, -1)
    return points, torch.ones_like(points[..., 0]), owner, torch.zeros_like(owner), nothing


def _ends(solids: Quadrics, chosen: Int[Tensor, " B"]) -> _Parts:
    """The circles at both ends; a whole cone has one."""
    taper = solids.taper.double()[chosen]
    blunt = (taper > 0).nonzero()[:, 0]
    parts = []
    for rows, radius, z, kind in ((chosen, torch.ones_like(taper), -1.0, 1), (chosen[blunt], taper[blunt], 1.0, 2)):
        middle = radius.new_tensor([0.0, 0.0, z]).expand(len(rows), 3)
        frame = [radius[:, None] * radius.new_tensor(axis) for axis in ([1.0, 0, 0], [0.0, 1, 0])]
        parts.append(_circles(middle, frame[0], frame[1], rows, kind))
    first = len(parts[0][0])
    following = torch.cat([parts[0][4], parts[1][4] + first])
    joined = [torch.cat([parts[0][k], parts[1][k]]) for k in range(4)]
    return joined[0], joined[1], joined[2], joined[3], following


def _placed(center: object, axes: object) -> tuple[Float[Tensor, "N 3"], Float[Tensor, "N 3 3"]]:
    c = _rows("center", center, 3)
    a = as_numbers("axes", axes, c.dtype, c.device)
    if a.shape == c.shape[:1] or a.ndim == 0:
        a = a.expand(len(c))[:, None].expand(len(c), 3)
    return c, torch.diag_embed(a) if a.ndim == 2 else a


def _rows(name: str, value: object, size: int) -> Float[Tensor, "N D"]:
    rows = as_numbers(name, value)
    rows = rows if rows.is_floating_point() else rows.to(torch.get_default_dtype())
    if rows.ndim != 2 or rows.shape[1] != size:
        raise ValueError(f"{name} must have shape (N, {size}), got {tuple(rows.shape)}")
    return rows
