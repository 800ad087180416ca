"""Planes, cylinders, cones, spheres and tori: distances, normals and fits of all five, as surfaces of revolution.

A point lies at the height h along an axis and at the distance q from it. The distance of the point from a form depends
on these two alone: it is that from a line of the plane of q and h (plane, cylinder, cone) or from a circle (sphere,
torus).
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.curves.directions import unit
from diff3ds.render.backends import for_kernels, kernels

# [units; numerical] Where something is divided by a distance from an axis it is at least so long.
TINY = 1e-12
# [steps; numerical] Gauss-Newton steps of a fit, and the step, relative to the size of the data, that ends it.
STEPS, SETTLED = 12, 1e-7
# [ratio; empirical] A residual counts less from the scale on, and nothing from so many times the scale on.
OUTLIER = 3.0


class FormKind(IntEnum):
    """What a form is, in the order in which one is taken for another: more usual ones first."""

    PLANE = 0
    CYLINDER = 1
    SPHERE = 2
    CONE = 3
    TORUS = 4
    FREE = 5


# Which numbers of a form its fit moves: the centre along two directions across the axis and along it, two turns of the
# axis, the radius, the angle of a cone, the ring of a torus.
FREE = {
    FormKind.PLANE: (2, 3, 4),
    FormKind.SPHERE: (0, 1, 2, 5),
    FormKind.CYLINDER: (0, 1, 3, 4, 5),
    FormKind.CONE: (0, 1, 3, 4, 5, 6),
    FormKind.TORUS: (0, 1, 2, 3, 4, 5, 7),
}


@dataclass(frozen=True, eq=False)
class Form:
    """A form, or as many of one kind as its arrays have rows.

    Attributes:
        kind: what it is.
        center: of a plane any of its points; of a cylinder and a cone a point of the axis; world units.
        axis: unit vector: the normal of a plane, the axis of the others; of a sphere any.
        radius: of a cylinder, a sphere and the tube of a torus; of a cone d = q cos(angle) - h sin(angle) - radius is
            the distance, so that it is the radius at its centre times cos(angle); of a plane 0.
        angle: half the opening of a cone, radians, positive where it opens along the axis; else 0.
        ring: of a torus the radius of the circle that its tube goes round; else 0.
    """

    kind: FormKind
    center: Float[Array, "*b 3"]
    axis: Float[Array, "*b 3"]
    radius: Array | float
    angle: Array | float
    ring: Array | float

    def __getitem__(self, row: "int | Int[Index, ' R']") -> "Form":
        """One of many, or some."""
        numbers = (np.asarray(value)[row] for value in (self.radius, self.angle, self.ring))
        return Form(self.kind, self.center[row], self.axis[row], *numbers)

    def measured(self, points: Float[Array, "S 3"], normals: Float[Array, "S 3"]) -> tuple[Array, Array]:
        """Signed distances (*b, S) of points, positive away from the axis or above a plane, and cosines to normals."""
        if kernel := getattr(kernels(), "forms_measured", None):
            numbers = self._numbers()
            both = kernel(int(self.kind), *for_kernels(numbers.reshape(-1, 9), points, normals))
            distance, cosine = (one.reshape(*numbers.shape[:-1], len(points)) for one in both)
            return distance, cosine
        center, axis = self.center, self.axis
        # As products of matrices, since there may be many forms: the vectors from their centres are never made.
        h = axis @ points.T - (center * axis).sum(-1)[..., None]
        along = axis @ normals.T
        across = (points * normals).sum(-1) - center @ normals.T - h * along
        square = (points * points).sum(-1) - 2 * center @ points.T + (center * center).sum(-1)[..., None]
        q = np.sqrt(np.maximum(square - h * h, TINY**2))
        distance, gq, gh = self._profile(q, h)
        return distance, gq * across / q + gh * along

    def distance(self, points: Float[Array, "*s 3"]) -> Float[Array, "*s"]:
        """Signed distances, as of `measured`; of many forms each of its own points, or all of the same."""
        h, w = self._parts(points)
        return self._profile(np.linalg.norm(w, axis=-1), h)[0]

    def normal(self, points: Float[Array, "S 3"]) -> Float[Array, "S 3"]:
        """Unit vectors along which the distance from one form grows fastest."""
        return self.placed(points)[1]

    def projected(self, points: Float[Array, "S 3"]) -> Float[Array, "S 3"]:
        """The nearest points of one form."""
        distance, gradient = self.placed(points)
        return points - distance[:, None] * gradient

    def placed(self, points: Float[Array, "S 3"]) -> tuple[Float[Array, " S"], Float[Array, "S 3"]]:
        """Signed distances of points from one form, and the unit vectors along which these grow fastest."""
        h, w = self._parts(points)
        q = np.maximum(np.linalg.norm(w, axis=-1), TINY)
        distance, gq, gh = self._profile(q, h)
        return distance, gq[..., None] * w / q[..., None] + gh[..., None] * self.axis

    def _parts(self, points: Float[Array, "*s 3"]) -> tuple[Float[Array, "*s"], Float[Array, "*s 3"]]:
        u = points - self.center[..., None, :]
        h = (u * self.axis[..., None, :]).sum(-1)
        return h, u - h[..., None] * self.axis[..., None, :]

    def _profile(self, q: Array, h: Array) -> tuple[Array, Array, Array]:
        """Distance, and how it grows with q and with h."""
        radius, angle, ring = (np.asarray(value)[..., None] for value in (self.radius, self.angle, self.ring))
        if self.kind == FormKind.PLANE:
            return h, np.zeros_like(h), np.ones_like(h)
        if self.kind == FormKind.CYLINDER:
            return q - radius, np.ones_like(h), np.zeros_like(h)
        if self.kind == FormKind.CONE:
            cos, sin = np.cos(angle), np.sin(angle)
            return q * cos - h * sin - radius, cos + 0 * h, -sin + 0 * h
        out = q - ring
        far = np.maximum(np.hypot(out, h), TINY)
        return far - radius, out / far, h / far

    def fitted(
        self, points: Float[Array, "S 3"], scale: float, held: Set[int] = frozenset(), settled: float = SETTLED
    ) -> "Form":
        """The form of this kind nearest to points, by least squares of which outliers have no part.

        Args:
            scale: of the points' distances, world units.
            held: numbers of `FREE` that stay as they are.
            settled: the step, relative to the size of the points, that ends the fit.
        """
        form = self.recentred(points)
        free = [k for k in FREE[form.kind] if k not in held]
        size = float(np.ptp(points, axis=0).max())
        if kernel := getattr(kernels(), "form_fitted", None):
            numbers = kernel(int(self.kind), *for_kernels(form._numbers(), points), scale, free, size, settled)
            return Form(self.kind, numbers[:3], numbers[3:6], *numbers[6:]).recentred(points)
        for _ in range(STEPS):
            distance, jacobian, basis = form._linearised(points)
            weight = np.maximum(1 - (distance / (OUTLIER * scale)) ** 2, 0)
            rows = jacobian[free] * weight
            matrix = rows @ rows.T
            diagonal = matrix.ravel()[:: len(matrix) + 1]
            diagonal *= 1 + 1e-9
            diagonal += 1e-12
            step = np.zeros(8)
            step[free] = -np.linalg.solve(matrix, rows @ (weight * distance))
            # No step is longer than what the data can say something about.
            step *= min(1.0, size / max(np.abs(step).max(), TINY))
            form = form._moved(step, basis)
            if np.abs(step).max() < settled * size:
                break
        return form.recentred(points)

    def _numbers(self) -> Float[Array, "*b 9"]:
        """Centre, axis, radius, angle and ring, for the compiled kernels."""
        numbers = (np.asarray(value, float)[..., None] for value in (self.radius, self.angle, self.ring))
        return np.concatenate([self.center, self.axis, *numbers], -1)

    def recentred(self, points: Float[Array, "S 3"]) -> "Form":
        """The same form with a centre that lies beside the points."""
        if self.kind not in (FormKind.PLANE, FormKind.CYLINDER, FormKind.CONE):
            return self
        along = (points.mean(0) - self.center) @ self.axis
        if self.kind == FormKind.PLANE:
            middle = points.mean(0)
            return replace(self, center=middle - ((middle - self.center) @ self.axis) * self.axis)
        center = self.center + along * self.axis
        return replace(self, center=center, radius=self.radius + along * np.sin(self.angle))

    def _linearised(
        self, points: Float[Array, "S 3"]
    ) -> tuple[Float[Array, " S"], Float[Array, "8 S"], Float[Array, "3 3"]]:
        """Distances, how they grow with each of the numbers of `FREE`, and the frame that these are in."""
        # A row a number: numpy is slow along short axes, and a search makes thousands of fits.
        basis = np.concatenate([frame(self.axis), self.axis[None]])
        local = basis @ (points - self.center).T
        across, h = local[:2], local[2]
        q = np.maximum(np.sqrt(across[0] ** 2 + across[1] ** 2), TINY)
        e = across / q
        distance, gq, gh = self._profile(q, h)
        rows = np.empty((8, len(h)))
        rows[:2], rows[2] = -gq * e, -gh
        rows[3:5] = gh * across - gq * h * e
        rows[5], rows[7] = -1.0, -gq
        rows[6] = -q * np.sin(self.angle) - h * np.cos(self.angle) if self.kind == FormKind.CONE else 0.0
        return distance, rows, basis

    def _moved(self, step: Float[Array, " 8"], basis: Float[Array, "3 3"]) -> "Form":
        """The form with its numbers changed, in the frame of `_linearised`."""
        center = self.center + step[:3] @ basis
        axis = unit(self.axis + step[3:5] @ basis[:2])
        return Form(
            self.kind, center, axis, self.radius + step[5], self.angle + step[6], np.maximum(self.ring + step[7], 0.0)
        )


def form(
    kind: FormKind,
    center: Array | Sequence[float],
    axis: Array | Sequence[float],
    radius: Array | float = 0.0,
    angle: Array | float = 0.0,
    ring: Array | float = 0.0,
) -> Form:
    """A form, or many, of the numbers that its kind has."""  # fmt: skip
    place, way = np.asarray(center, np.float64), unit(np.asarray(axis, np.float64))
    shape = np.broadcast_shapes(place.shape, way.shape)
    full = [np.broadcast_to(np.asarray(value, float), shape[:-1]) for value in (radius, angle, ring)]
    return Form(kind, np.broadcast_to(place, shape), np.broadcast_to(way, shape), *full)


def frame(axis: Float[Array, " 3"]) -> Float[Array, "2 3"]:
    """Two unit vectors across an axis and each other."""
    # By hand: `np.cross` is slow for one vector, and a fit asks for thousands.
    x, y, z = axis.tolist()
    least = min(abs(x), abs(y), abs(z))
    a, b, c = (0.0, z, -y) if abs(x) == least else (-z, 0.0, x) if abs(y) == least else (y, -x, 0.0)
    length = max((a * a + b * b + c * c) ** 0.5, TINY)
    a, b, c = a / length, b / length, c / length
    return np.array([[a, b, c], [y * c - z * b, z * a - x * c, x * b - y * a]])


def fits_of_patches(points: Float[Array, "M K 3"], normals: Float[Array, "M K 3"]) -> list[Form]:
    """Forms that patches of a surface may lie on, one of each kind a patch, from points and alike oriented normals."""
    middle, mean = points.mean(1), normals.mean(1)
    x, n = points - middle[:, None], normals - mean[:, None]
    scatter = np.einsum("mki,mkj->mij", x, x)
    plane = form(FormKind.PLANE, middle, np.linalg.eigh(scatter)[1][:, :, 0])
    # x = center + radius n.
    radius = (x * n).sum((1, 2)) / np.maximum((n * n).sum((1, 2)), TINY)
    sphere = form(FormKind.SPHERE, middle - radius[:, None] * mean, np.eye(3)[2], np.abs(radius))
    gauss = np.einsum("mki,mkj->mij", normals, normals)
    axis = np.linalg.eigh(gauss)[1][:, :, 0]
    cylinder = _round(FormKind.CYLINDER, middle, axis, x, normals)
    # n . axis is the same everywhere; n . (x - apex) = 0.
    axis = np.linalg.eigh(np.einsum("mki,mkj->mij", n, n))[1][:, :, 0]
    pull = 1e-9 * np.trace(gauss, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    apex = np.linalg.solve(gauss + pull, np.einsum("mki,mk->mi", normals, (normals * x).sum(2))[..., None])[..., 0]
    opens = np.sign(-(apex * axis).sum(1))
    axis = np.where(opens == 0, 1.0, opens)[:, None] * axis
    angle = np.arcsin(np.clip(np.abs((mean * axis).sum(1)), 0, 1))
    cone = form(FormKind.CONE, middle + apex, axis, 0.0, angle)
    return [plane, sphere, cylinder, cone, _torus(middle, x, normals)]


def _round(kind: FormKind, middle: Array, axis: Array, x: Array, normals: Array) -> Form:
    """Cylinders along axes."""
    flat, turn = (v - (v @ axis[..., None]) * axis[:, None] for v in (x, normals))
    turn_mean = turn.mean(1)
    spread = turn - turn_mean[:, None]
    radius = (flat * spread).sum((1, 2)) / np.maximum((spread * spread).sum((1, 2)), TINY)
    center = middle + flat.mean(1) - radius[:, None] * turn_mean
    return form(kind, center, axis, np.abs(radius))


def cylinder_along(axis: Float[Array, " 3"], points: Float[Array, "K 3"], normals: Float[Array, "K 3"]) -> Form:
    """The cylinder along an axis that points and alike oriented normals say."""
    middle = points.mean(0)
    return _round(FormKind.CYLINDER, middle[None], axis[None], (points - middle)[None], normals[None])[0]


def _torus(middle: Array, x: Array, normals: Array) -> Form:
    """Tori about the axis that all normals pass nearest to (Pottmann and Randrup 1998), with a circle for a profile."""
    moment = np.cross(x, normals)
    aa, am, mm = (np.einsum("mki,mkj->mij", p, q) for p, q in ((moment, moment), (moment, normals), (normals, normals)))
    mm = mm + 1e-6 * np.trace(mm, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    solved = np.linalg.solve(mm, np.swapaxes(am, 1, 2))
    axis = np.linalg.eigh(aa - am @ solved)[1][:, :, 0]
    along = -(solved @ axis[..., None])[..., 0]
    foot = np.cross(axis, along)
    u = x - foot[:, None]
    h = (u @ axis[..., None])[..., 0]
    w = u - h[..., None] * axis[:, None]
    q = np.maximum(np.linalg.norm(w, axis=2), TINY)
    profile = np.stack([q, h], 2)
    turn = np.stack([(normals * w).sum(2) / q, (normals @ axis[..., None])[..., 0]], 2)
    spread = turn - turn.mean(1, keepdims=True)
    centered = profile - profile.mean(1, keepdims=True)
    radius = (centered * spread).sum((1, 2)) / np.maximum((spread * spread).sum((1, 2)), TINY)
    ring, height = (profile.mean(1) - radius[:, None] * turn.mean(1)).T
    center = middle + foot + height[:, None] * axis
    return form(FormKind.TORUS, center, axis, np.abs(radius), 0.0, np.maximum(ring, 0))
