"""Where two forms meet: lines, circles and ellipses exactly, all else as points on both, one after the other."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import TINY, cross, unit
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.surfaces.form.form_kinds import Form, FormKind, frame
from diff3ds.surfaces.form.free import FreeForm

Surface = Form | FreeForm

# Newton steps towards two or three forms at once, and where free ones are among them, which are dear.
STEPS, FREE_STEPS = 12, 4
# And for all points of a path once they are there.
AFTERWARDS = 3
# The step, relative to the largest coordinate, after which there is only rounding. Numerical.
SETTLED = 1e-14
# Axes that are nearer to parallel (sine) and to each other (world units over the size of what they belong to) than
# rounding count as one; a form is regularised before. Numerical.
SAME = 1e-6
# A path has at most so many steps to each side.
MOST_STEPS = 4000


@dataclass(frozen=True, eq=False)
class Path:
    """A curve on which two forms meet.

    Attributes:
        kind: LINE, CIRCLE, ELLIPSE, or FREE where only points are known.
        center, u, v: center + u t, or center + u cos t + v sin t.
        line: of a FREE one, points (M, 3) along it; t counts lengths.
        closed: whether a FREE one ends where it begins.
    """

    kind: Kind
    center: Float[Array, " 3"]
    u: Float[Array, " 3"]
    v: Float[Array, " 3"]
    line: Float[Array, "M 3"] | None = None
    closed: bool = False

    @property
    def period(self) -> float:
        """After how much of t the path comes again; infinite if it never does."""
        if self.line is None:
            return np.inf if self.kind == Kind.LINE else 2 * np.pi
        return float(self._lengths[-1]) if self.closed else np.inf

    @property
    def speed(self) -> float:
        """World units per unit of t, about."""
        if self.line is not None or self.kind == Kind.LINE:
            return 1.0
        return float(np.linalg.norm(self.u) + np.linalg.norm(self.v)) / 2

    @property
    def _lengths(self) -> Float[Array, " M"]:
        assert self.line is not None
        return np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(self.line, axis=0), axis=1))]

    def at(self, t: Float[Array, " T"]) -> Float[Array, "T 3"]:
        """Points; a FREE path that does not close goes straight on beyond its ends."""
        t = np.atleast_1d(np.asarray(t, float))
        if self.kind == Kind.LINE:
            return self.center + t[:, None] * self.u
        if self.line is None:
            return self.center + np.cos(t)[:, None] * self.u + np.sin(t)[:, None] * self.v
        at = self._lengths
        t = t % at[-1] if self.closed else t
        return np.stack([np.interp(t, at, self.line[:, k]) for k in range(3)], 1)

    def parameter(self, points: Float[Array, "S 3"]) -> Float[Array, " S"]:
        """Parameters of points near to it."""
        x = points - self.center
        if self.kind == Kind.LINE:
            return np.asarray(x @ self.u)
        if self.line is None:
            return np.arctan2(x @ self.v / (self.v @ self.v), x @ self.u / (self.u @ self.u)) % (2 * np.pi)
        from scipy.spatial import cKDTree

        at, along = self._lengths, unit(np.gradient(self.line, axis=0))
        row = cKDTree(self.line).query(points)[1]
        return np.asarray(at[row] + ((points - self.line[row]) * along[row]).sum(1))


def onto(
    forms: Sequence[Surface], points: Float[Array, "S 3"], steps: int = STEPS, away: Float[Array, " F"] | float = 0.0
) -> Float[Array, "S 3"]:
    """The points moved to where all forms, two or three, are so far away, by the shortest steps."""
    x = points.copy()
    for _ in range(steps):
        off, jacobian = (np.stack(values, 1) for values in zip(*(one.placed(x) for one in forms), strict=True))
        gram = jacobian @ np.swapaxes(jacobian, 1, 2)
        gram += 1e-9 * np.eye(len(forms))
        step = np.swapaxes(jacobian, 1, 2) @ np.linalg.solve(gram, (off - away)[..., None])
        x = x - step[..., 0]
        if np.abs(step).max(initial=0.0) <= SETTLED * np.abs(x).max(initial=0.0):
            break
    return x


def exact_paths(a: Surface, b: Surface) -> list[Path]:
    """Lines, circles and ellipses on which two forms meet; nothing where they meet in something else."""
    if isinstance(a, FreeForm) or isinstance(b, FreeForm):
        return []
    if a.kind > b.kind:
        a, b = b, a
    if FormKind.SPHERE in (a.kind, b.kind) and a.kind != FormKind.PLANE:
        a, b = (a, b) if a.kind == FormKind.SPHERE else (b, a)
        return _coaxial(a, b)
    if a.kind == FormKind.PLANE:
        return _with_plane(a, b)
    if _parallel(a.axis, b.axis):
        if _beside(a, b) < SAME * _extent(a, b):
            return _coaxial(a, b)
        if a.kind == b.kind == FormKind.CYLINDER:
            return _parallel_cylinders(a, b)
    return []


def _parallel(a: Array, b: Array) -> bool:
    return bool(np.linalg.norm(cross(a, b)) < SAME)


def _beside(a: Form, b: Form) -> float:
    """How far the centre of b is from the axis of a."""
    off = b.center - a.center
    return float(np.linalg.norm(off - (off @ a.axis) * a.axis))


def _extent(a: Form, b: Form) -> float:
    return float(a.radius + a.ring + b.radius + b.ring) + TINY


def _with_plane(plane: Form, b: Form) -> list[Path]:
    n = plane.axis
    if b.kind == FormKind.PLANE:
        along = cross(n, b.axis)
        if np.linalg.norm(along) < 1e-3:
            return []
        start = onto([plane, b], (plane.center + b.center)[None] / 2)[0]
        return [Path(Kind.LINE, start, unit(along), np.zeros(3))]
    if b.kind == FormKind.SPHERE:
        height = float(plane.distance(b.center[None])[0])
        square = float(b.radius) ** 2 - height**2
        return [_circle(b.center - height * n, n, np.sqrt(square))] if square > 0 else []
    sine = float(np.linalg.norm(cross(n, b.axis)))
    if sine < SAME:
        return _coaxial(plane, b)
    if b.kind == FormKind.CYLINDER:
        return _plane_and_cylinder(plane, b, sine)
    if b.kind == FormKind.CONE:
        return _plane_and_cone(plane, b)
    return []


def _plane_and_cylinder(plane: Form, b: Form, sine: float) -> list[Path]:
    cosine = float(plane.axis @ b.axis)
    if abs(cosine) < SAME:
        height = float(plane.distance(b.center[None])[0])
        square = float(b.radius) ** 2 - height**2
        if square <= 0:
            return []
        middle, side = b.center - height * plane.axis, unit(cross(plane.axis, b.axis)) * np.sqrt(square)
        return [Path(Kind.LINE, middle + way * side, b.axis, np.zeros(3)) for way in (-1, 1)]
    if abs(cosine) < 0.1:
        # So long an ellipse is nothing but two lines that are not quite parallel.
        return []
    center = b.center - float(plane.distance(b.center[None])[0]) / cosine * b.axis
    short = unit(cross(plane.axis, b.axis))
    long = cross(short, plane.axis)
    return [Path(Kind.ELLIPSE, center, long * float(b.radius) / abs(cosine), short * float(b.radius))]


def _plane_and_cone(plane: Form, b: Form) -> list[Path]:
    """The ellipse of a plane that cuts all lines of a cone."""
    cosine = abs(float(plane.axis @ b.axis))
    # The plane is steeper to the axis than the cone opens: else a parabola or hyperbola.
    if np.arcsin(min(cosine, 1)) <= abs(float(b.angle)) + 0.05:
        return []
    downhill = unit(b.axis - (b.axis @ plane.axis) * plane.axis)
    side = cross(plane.axis, downhill)
    apex = b.center - float(b.radius) / np.sin(b.angle) * b.axis
    # Two lines of the cone, in the plane of its axis and the plane's normal, end the long axis.
    across = unit(plane.axis - (plane.axis @ b.axis) * b.axis)
    sign = np.sign(np.sin(b.angle))
    ends = []
    for way in (-1, 1):
        ray = np.cos(b.angle) * sign * b.axis + way * abs(np.sin(b.angle)) * across
        ends.append(apex - float(plane.distance(apex[None])[0]) / float(ray @ plane.axis) * ray)
    center, long = (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2
    # Half the short axis: from the centre along the side to the cone.
    h = float((center - apex) @ b.axis)
    w = center - apex - h * b.axis
    square = (h * np.tan(b.angle)) ** 2 - float(w @ w)
    return [Path(Kind.ELLIPSE, center, long, side * np.sqrt(square))] if square > 0 else []


def _coaxial(a: Form, b: Form) -> list[Path]:
    """The circles about the axis of the second on which both profiles meet."""
    axis, center = b.axis, b.center
    if b.kind == FormKind.SPHERE:
        axis = unit(b.center - a.center)
        if not np.linalg.norm(axis) > 0.5:
            return []
    elif a.kind == FormKind.SPHERE and _beside(b, a) > SAME * _extent(a, b):
        return []
    out = []
    for q, h in _profiles_meet(a, b, center, axis):
        if q > 1e-9:
            out.append(_circle(center + h * axis, axis, q))
    return out


def _profiles_meet(a: Form, b: Form, center: Array, axis: Array) -> list[tuple[float, float]]:
    """Points (q, h) of a half-plane through the axis that lie on both forms."""
    profiles = [_profile(one, center, axis) for one in (a, b)]
    lines = [p for p in profiles if p[0] == "line"]
    if len(lines) == 2:
        (_, n1, d1), (_, n2, d2) = lines
        matrix = np.stack([n1, n2])
        if abs(np.linalg.det(matrix)) < 1e-6:
            return []
        q, h = np.linalg.solve(matrix, [d1, d2])
        return [(float(q), float(h))]
    if len(lines) == 1:
        circle = next(p for p in profiles if p[0] == "circle")
        (_, n, d), (_, c, r) = lines[0], circle
        off = d - n @ c
        square = r * r - off * off
        along = np.array([-n[1], n[0]])
        return [tuple(c + off * n + way * np.sqrt(square) * along) for way in (-1, 1)] if square > 0 else []
    (_, c1, r1), (_, c2, r2) = profiles
    gap = float(np.linalg.norm(c2 - c1))
    if gap < 1e-9 or not abs(r1 - r2) < gap < r1 + r2:
        return []
    way = (c2 - c1) / gap
    x = (gap * gap + r1 * r1 - r2 * r2) / (2 * gap)
    y = np.sqrt(max(r1 * r1 - x * x, 0))
    return [tuple(c1 + x * way + s * y * np.array([-way[1], way[0]])) for s in (-1, 1)]


def _profile(one: Form, center: Array, axis: Array) -> tuple[str, Array, float]:
    """A form's profile about an axis that is its own: a line n . (q, h) = d, or a circle's centre and radius."""
    height = float((one.center - center) @ axis)
    same = float(np.sign(one.axis @ axis)) or 1.0
    if one.kind == FormKind.PLANE:
        return "line", np.array([0.0, 1.0]), height
    if one.kind == FormKind.CYLINDER:
        return "line", np.array([1.0, 0.0]), float(one.radius)
    if one.kind == FormKind.CONE:
        cos, sin = float(np.cos(one.angle)), float(np.sin(one.angle)) * same
        return "line", np.array([cos, -sin]), float(one.radius) - sin * height
    return "circle", np.array([float(one.ring), height]), float(one.radius)


def _circle(center: Array, axis: Array, radius: float) -> Path:
    u, v = frame(axis) * radius
    return Path(Kind.CIRCLE, center, u, v)


def _parallel_cylinders(a: Form, b: Form) -> list[Path]:
    off = b.center - a.center
    off = off - (off @ a.axis) * a.axis
    gap = float(np.linalg.norm(off))
    r, s = float(a.radius), float(b.radius)
    if not abs(r - s) < gap < r + s:
        return []
    x = (gap * gap + r * r - s * s) / (2 * gap)
    y = np.sqrt(max(r * r - x * x, 0))
    side = cross(a.axis, off / gap)
    return [Path(Kind.LINE, a.center + x * off / gap + way * y * side, a.axis, np.zeros(3)) for way in (-1, 1)]


def marched(a: Surface, b: Surface, start: Float[Array, " 3"], step: float, stops: Callable[[Array], bool]) -> Path:
    """The path through a point on both forms, in steps, both ways until it closes or `stops` says so of a point."""
    sides = []
    for way in (1.0, -1.0):
        x, points, last = start, [start], None
        normals = [one.normal(x[None])[0] for one in (a, b)]
        for _ in range(MOST_STEPS):
            t = cross(*normals)
            size = float(np.linalg.norm(t))
            if size < 0.02:
                break
            t = t / size * way
            if last is not None and t @ last < 0:
                break
            last = t
            x = x + step * t
            # The normals of beside the path, which all points come onto in the end, say well enough where it goes on.
            (d, n), (e, m) = (one.placed(x[None]) for one in (a, b))
            normals = [n[0], m[0]]
            x = x + _back(float(d[0]), float(e[0]), *normals)
            if len(points) > 3 and np.linalg.norm(x - start) < 0.75 * step:
                return _marched_path(a, b, np.array([*points, start]), True)
            points.append(x)
            if stops(x):
                break
        sides.append(points)
    return _marched_path(a, b, np.array(sides[1][:0:-1] + sides[0]), False)


def _back(d: float, e: float, n: Float[Array, " 3"], m: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """The shortest step to where two planes of these unit normals meet, at these distances below the point."""
    cosine = float(n @ m)
    square = max(1 - cosine * cosine, TINY)
    return np.asarray(((cosine * e - d) * n + (cosine * d - e) * m) / square)


def _marched_path(a: Surface, b: Surface, line: Float[Array, "M 3"], closed: bool) -> Path:
    line = onto([a, b], line, AFTERWARDS)
    return Path(Kind.FREE, line[0], np.zeros(3), np.zeros(3), line, closed)
