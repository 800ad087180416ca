"""What forms share where their samples say so: directions, axes in one line, fillets beside planes, equal radii."""

from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.curves.directions import unit
from diff3ds.surfaces.form.form_kinds import OUTLIER, TINY, Form, FormKind, cylinder_along, frame
from diff3ds.surfaces.form.labels import BAND, is_rounding, refitted, some_of, some_with_normals
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import LEAST, alike, best_kind, within

# Axes nearer than this, degrees, may be parallel, or at right angles. Empirical.
NEAR = 2.5
# Axes may be one, and radii equal, where they differ by less than so many reaches. Empirical.
NEAR_REACHES = 1.5
# What is shared may make the mean square distance of n independent samples larger by this and a share of n: twice what
# chance gives a fit with three numbers more.
WORSE, CHANCE = 1.01, 12.0
# And below this, in longest sides, distances are rounding.
ROUNDING = 2e-5
# A fillet is a cylinder that goes over into the planes beside it, whose radius a short arc alone hardly says. Its axis
# is at right angles to a plane's normal to this sine, it touches the plane in so many places at least, and so many
# steps find it. Numerical, but for the places: empirical.
ACROSS, TOUCHED, STEPS = 1e-6, 4, 12
# Two planes that a fillet lies between meet at more than this, sine. Empirical.
APART = 0.25
# Radii are equal that differ by no more than so many standard deviations, and so much in longest sides beside these;
# what a radius is moved by to see what its samples say of it, in radii.
SIGMAS, SAME, STEP = 2.0, 0.0009, 0.05
# The numbers of a fit, as of `form_kinds.FREE`.
CENTER, ALONG, AXIS, RADIUS = (0, 1), (2,), (3, 4), (5,)


class _Regular:
    """Forms, of which some numbers are held already."""

    def __init__(self, samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> None:
        self.samples, self.label, self.forms = samples, label, list(forms)
        self.reach = within(samples)
        self.points = [some_of(samples, label, row) for row in range(len(forms))]
        self.weight = np.bincount(label[label >= 0], minlength=len(forms)).astype(float)
        self.independent = _independent(samples, label, forms)
        self.worse = [self.allowed(count) for count in self.weight]
        self.held: list[set[int]] = [set() for _ in forms]
        # Of each cylinder the planes that it is tangent to, and the points of all that say how.
        self.touching: list[tuple[int, ...]] = [() for _ in forms]
        self.around = list(self.points)
        self.before = [self.square(one, points) for one, points in zip(forms, self.points, strict=True)]
        self.usual = float(np.average(self.before, weights=self.weight))

    def allowed(self, count: float) -> float:
        """How much larger what is shared may make the mean square distance of so many samples."""
        return WORSE + CHANCE / max(self.independent * count, CHANCE)

    def try_(self, row: int, changed: Form, hold: tuple[int, ...]) -> bool:
        """Takes a changed form, refitted but for what is held, if its samples allow it."""
        held = self.held[row] | set(hold)
        new = refitted(self.samples, changed, self.points[row], held)
        if not self.takes(row, new):
            return False
        self.forms[row], self.held[row] = new, held
        return True

    def takes(self, row: int, new: Form) -> bool:
        """Whether the samples of a form allow another one."""
        floor = (ROUNDING * self.samples.size) ** 2
        return bool(self.square(new, self.points[row]) <= self.worse[row] * self.before[row] + floor)

    def with_radius(self, row: int, radius: float) -> Form:
        """A form with that radius and else nearest to its samples; a fillet stays one."""
        one = replace(self.forms[row], radius=np.asarray(radius))
        if not self.touching[row]:
            return refitted(self.samples, one, self.points[row], self.held[row] | set(RADIUS))
        planes = [self.forms[k] for k in self.touching[row]]
        return _tangent_to(self.forms[row], planes, self.around[row], self.reach / 2, radius)

    def try_radius(self, row: int, radius: float) -> None:
        """Gives a form a radius, if its samples allow it."""
        new = self.with_radius(row, radius)
        if self.takes(row, new):
            self.forms[row] = new
            self.held[row] |= set(RADIUS)

    def some(self, row: int) -> tuple[Float[Array, "S 3"], Float[Array, "S 3"]]:
        """Some samples of a form, and their normals."""
        return some_with_normals(self.samples, self.label, row)

    def sense(self, row: int) -> float:
        """1 where a round form is seen from outside, -1 where it is hollow, 0 where nothing says which."""
        points, normals = self.some(row)
        return float(np.sign((self.forms[row].normal(points) * normals).sum())) if self.samples.oriented else 0.0

    def square(self, one: Form, points: Array) -> float:
        off = one.distance(points)
        return float(np.minimum(off * off, self.reach**2).mean())


def _independent(samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> float:
    """How many independent distances a sample counts for: few where neighbours are off alike, as bumps are."""
    off = np.zeros(len(label))
    for row, one in enumerate(forms):
        off[label == row] = one.distance(samples.points[label == row])
    i, j = samples.pairs[
        (label[samples.pairs[:, 0]] == label[samples.pairs[:, 1]]) & (label[samples.pairs[:, 0]] >= 0)
    ].T
    square = float((off[i] ** 2 + off[j] ** 2).mean()) / 2 if len(i) else 0.0
    alike = float(np.clip((off[i] * off[j]).mean() / square, 0, 0.95)) if square > 0 else 0.0
    # Of a process with this correlation between neighbours, along two directions.
    return ((1 - alike) / (1 + alike)) ** 2


def regularised(samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> list[Form]:
    """The forms with what they share the same to the last digit."""
    if not forms:
        return forms
    state = _Regular(samples, label, forms)
    _simpler(state)
    _axes(state)
    _one_line(state)
    _fillets(state)
    _equal_radii(state)
    return state.forms


def _simpler(state: _Regular) -> None:
    """Forms become simpler ones where their samples do not say more."""
    for r, one in enumerate(state.forms):
        points, normals = state.some(r)
        simple = best_kind(one, points, normals, state.samples, state.worse[r])
        if simple.kind != one.kind:
            state.try_(r, simple, ())


def _axes(state: _Regular) -> None:
    """Directions that are parallel or at right angles to heavier ones become so."""
    rows = [r for r, one in enumerate(state.forms) if one.kind != FormKind.SPHERE]
    rows.sort(key=lambda r: -state.weight[r])
    known: list[Array] = []
    for axis, members in _clusters(state, rows):
        for direction in _candidates(axis, known):
            taken = [r for r in members if state.try_(r, _turned(state.forms[r], direction), AXIS)]
            members = [r for r in members if r not in taken]
            if taken and not any(abs(direction @ k) > 1 - 1e-12 for k in known):
                known.append(direction)
            if not members:
                break


def _clusters(state: _Regular, rows: list[int]) -> list[tuple[Array, list[int]]]:
    """Groups of nearly parallel axes, heavier ones first, each with its mean."""
    groups: list[list[int]] = []
    limit = np.cos(np.radians(NEAR))
    for r in rows:
        axis = state.forms[r].axis
        best = max(groups, key=lambda g: abs(axis @ state.forms[g[0]].axis), default=None)
        if best is not None and abs(axis @ state.forms[best[0]].axis) > limit:
            best.append(r)
        else:
            groups.append([r])
    out = []
    for group in groups:
        first = state.forms[group[0]].axis
        total = sum(state.weight[r] * np.sign(state.forms[r].axis @ first) * state.forms[r].axis for r in group)
        out.append((unit(np.asarray(total)), group))
    return sorted(out, key=lambda pair: -sum(state.weight[r] for r in pair[1]))


def _candidates(axis: Array, known: list[Array]) -> list[Array]:
    """Directions that an axis may be: across two known ones, across one, and as it is."""
    near = np.sin(np.radians(NEAR))
    across = [k for k in known if abs(axis @ k) < near]
    out = []
    for i, one in enumerate(across):
        for other in across[:i]:
            both = np.cross(other, one)
            if np.linalg.norm(both) > 0.5 and abs(unit(both) @ axis) > np.cos(np.radians(NEAR)):
                out.append(unit(both) * np.sign(both @ axis))
    out += [unit(axis - (axis @ k) * k) for k in across]
    return [*out, axis]


def _turned(one: Form, direction: Array) -> Form:
    return replace(one, axis=direction * (np.sign(one.axis @ direction) or 1.0))


def _one_line(state: _Regular) -> None:
    """Round forms, and spheres, whose centres lie beside the axis of a heavier one come onto it."""
    rows = sorted(
        (r for r, one in enumerate(state.forms) if one.kind != FormKind.PLANE), key=lambda r: -state.weight[r]
    )
    done: set[int] = set()
    for r in rows:
        first = state.forms[r]
        if r in done or first.kind == FormKind.SPHERE:
            continue
        group = [r]
        for k in rows:
            one = state.forms[k]
            parallel = one.kind == FormKind.SPHERE or abs(one.axis @ first.axis) > 1 - 1e-12
            if k != r and k not in done and parallel and _off(first, one.center) < NEAR_REACHES * state.reach:
                group.append(k)
        if len(group) == 1:
            continue
        weights = np.array([state.weight[k] for k in group])
        feet = np.array([_foot(first, state.forms[k].center) for k in group])
        middle = (weights[:, None] * feet).sum(0) / weights.sum()
        for k in group:
            one = state.forms[k]
            center = middle + ((one.center - middle) @ first.axis) * first.axis
            axis = first.axis if one.kind == FormKind.SPHERE else one.axis
            if state.try_(k, replace(one, center=center, axis=axis), CENTER):
                done.add(k)


def _foot(first: Form, point: Array) -> Array:
    """The point moved along the axis to the height of the first centre."""
    return np.asarray(point - ((point - first.center) @ first.axis) * first.axis)


def _off(first: Form, point: Array) -> float:
    return float(np.linalg.norm(_foot(first, point) - first.center))


def _fillets(state: _Regular) -> None:
    """Round forms that may go over into planes beside them do so; their radius is that which planes leave them."""
    for r, one in enumerate(state.forms):
        if one.kind in (FormKind.PLANE, FormKind.SPHERE) or set(CENTER) & state.held[r]:
            continue
        touched = _touched(state, r)
        if not _between_planes(state, r, touched) and one.kind == FormKind.CYLINDER:
            _beside_plane(state, r, touched)


def _touched(state: _Regular, row: int) -> list[int]:
    """The forms that one touches, those that it touches in more places first."""
    i, j = state.samples.pairs.T
    label = state.label
    touched = np.concatenate([label[j[label[i] == row]], label[i[label[j] == row]]])
    count = np.bincount(touched[touched >= 0], minlength=len(state.forms))
    count[row] = 0
    return [k for k in np.argsort(-count, kind="stable").tolist() if count[k] >= TOUCHED]


def _between_planes(state: _Regular, row: int, touched: list[int]) -> bool:
    """Makes a form a cylinder that touches two planes, the two that its samples say most of, if they allow it."""
    best, least = None, np.inf
    samples, normals = state.some(row)
    normals = alike(state.forms[row], samples, normals)
    for two in combinations([k for k in touched if state.forms[k].kind == FormKind.PLANE], 2):
        planes = [state.forms[k] for k in two]
        axis = np.cross(planes[0].axis, planes[1].axis)
        third = [state.forms[k] for k in touched if k not in two]
        inner = _away(samples, third, state)
        if np.linalg.norm(axis) < APART or inner.sum() < LEAST:
            continue
        points = samples[inner]
        own = np.concatenate([points, *(state.points[k][_away(state.points[k], third, state)] for k in two)])
        tangent = _tangent_to(cylinder_along(unit(axis), points, normals[inner]), planes, own, state.reach / 2)
        square = state.square(tangent, points)
        before = state.square(state.forms[row], points)
        allowed = state.allowed(len(points)) * max(before, state.usual)
        small = is_rounding(state.samples, tangent, points, planes)
        if tangent.radius > 0 and not small and square < min(allowed, least):
            best, least = (tangent, two, points, own), square
    if best is None:
        return False
    state.forms[row], state.touching[row], state.points[row], state.around[row] = best
    state.before[row] = least
    return True


def _away(points: Float[Array, "S 3"], forms: list[Form], state: _Regular) -> Bool[Mask, " S"]:
    """Which points are so far from forms that these' edges, blurred or rounded, have no part in where they are."""
    off = [np.abs(one.distance(points)) > BAND * state.samples.spacing for one in forms]
    return np.all([np.ones(len(points), bool), *off], axis=0)


def _beside_plane(state: _Regular, row: int, touched: list[int]) -> None:
    """Makes a cylinder touch a plane to which it is nearly tangent, if its samples allow it."""
    one = state.forms[row]
    for k in touched:
        plane = state.forms[k]
        off = abs(abs(float(plane.distance(one.center[None])[0])) - float(one.radius))
        if plane.kind == FormKind.PLANE and abs(plane.axis @ one.axis) < ACROSS and off < NEAR_REACHES * state.reach:
            own = np.concatenate([state.points[row], state.points[k]])
            tangent = _tangent_to(one, [plane], own, state.reach / 2)
            if state.takes(row, tangent):
                state.forms[row], state.touching[row], state.around[row] = tangent, (k,), own
                return


def _tangent_to(
    one: Form, planes: list[Form], points: Float[Array, "S 3"], scale: float, radius: float | None = None
) -> Form:
    """The cylinder nearest to points that touches one or two planes along a line each.

    Args:
        scale: of the points' distances, world units.
        radius: that it has; by default what planes and points say.
    """
    across = frame(one.axis)
    local = (points - one.center) @ across.T
    # Of the centre x, y and the radius r: the plane's distance from the centre is r, on the side that it is on.
    normals = np.array([plane.axis for plane in planes]) @ across.T
    away = np.array([float(plane.distance(one.center[None])[0]) for plane in planes])
    rows, wanted = np.column_stack([normals, -np.sign(away)]), -away
    contacts = -np.sign(away)[:, None] * normals
    if radius is not None:
        rows, wanted = np.vstack([rows, [0.0, 0.0, 1.0]]), np.append(wanted, radius)
    now = np.array([0.0, 0.0, float(one.radius)])
    now = now + np.linalg.pinv(rows) @ (wanted - rows @ now)
    # What is left to choose.
    _, size, ways = np.linalg.svd(rows)
    free = ways[int((size > ACROSS).sum()) :]
    for _ in range(STEPS if len(free) else 0):
        from_center = local - now[:2]
        far = np.maximum(np.linalg.norm(from_center, axis=1), 1e-12)
        off = far - now[2]
        # Between the lines where it touches: which form a sample there belongs to is chance.
        between = (from_center @ np.linalg.pinv(contacts.T).T > 0).all(1)
        weight = np.maximum(1 - (off / (OUTLIER * scale)) ** 2, 0) * between
        jacobian = np.column_stack([-from_center / far[:, None], -np.ones(len(far))]) @ free.T
        columns = jacobian * weight[:, None]
        step = -np.linalg.lstsq(columns, weight * off, rcond=None)[0] @ free
        now = now + step
    return replace(one, center=one.center + now[:2] @ across, radius=np.asarray(now[2]))


def _equal_radii(state: _Regular) -> None:
    """Forms of one sort whose radii differ by no more than chance get the mean of them."""
    sorts: dict[tuple[int, bool, float], list[int]] = {}
    for r, one in enumerate(state.forms):
        if one.kind in (FormKind.CYLINDER, FormKind.SPHERE, FormKind.TORUS):
            sorts.setdefault((one.kind, bool(state.touching[r]), state.sense(r)), []).append(r)
    for rows in sorts.values():
        groups = [_Radius(*_radius(state, r), [r]) for r in rows]
        while len(groups) > 1:
            groups.sort(key=lambda g: g.mean)
            apart = [_apart(state, a, b) for a, b in pairwise(groups)]
            k = int(np.argmin(apart))
            if apart[k] > 1:
                break
            groups[k : k + 2] = [_both(*groups[k : k + 2])]
        for group in groups:
            for r in group.rows if len(group.rows) > 1 else ():
                state.try_radius(r, group.mean)


@dataclass(frozen=True)
class _Radius:
    """A radius of some forms, and the square of how far chance sets it off."""

    mean: float
    variance: float
    rows: list[int]


def _radius(state: _Regular, row: int) -> tuple[float, float]:
    """The radius of a form, and the square of how far chance sets it off: what its samples say against another one."""
    one = state.forms[row]
    radius = float(one.radius)
    step = STEP * radius
    grown = [state.square(state.with_radius(row, radius + way * step), state.points[row]) for way in (-1, 1)]
    least = max(state.square(one, state.points[row]), (ROUNDING * state.samples.size) ** 2)
    bend = max((sum(grown) / 2 - least) / step**2, TINY)
    return radius, least / (bend * max(state.independent * state.weight[row], 1))


def _apart(state: _Regular, a: _Radius, b: _Radius) -> float:
    """How far two radii are apart, in what chance and what samples leave out may set them apart."""
    return abs(a.mean - b.mean) / float(np.hypot(SIGMAS * np.sqrt(a.variance + b.variance), SAME * state.samples.size))


def _both(a: _Radius, b: _Radius) -> _Radius:
    w, v = 1 / a.variance, 1 / b.variance
    return _Radius((w * a.mean + v * b.mean) / (w + v), 1 / (w + v), a.rows + b.rows)
