"""What forms share where their samples say so: directions, axes in one line, fillets beside planes, equal radii."""

from dataclasses import replace
from itertools import combinations

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.curves.directions import unit
from diff3ds.surfaces.form.form_kinds import OUTLIER, Form, FormKind, frame
from diff3ds.surfaces.form.labels import refitted, some_of
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import within

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
# The numbers of a fit, as of `form_kinds.FREE`.
CENTER, ALONG, AXIS, RADIUS = (0, 1), (2,), (3, 4), (5,)


class _Regular:
    """Forms, of which some numbers are held already."""

    def __init__(self, samples: Samples, label: Int[Index, " N"], forms: list[Form]) -> None:
        self.samples, self.forms = samples, list(forms)
        self.reach = within(samples)
        self.points = [some_of(samples, label, row) for row in range(len(forms))]
        self.weight = np.bincount(label[label >= 0], minlength=len(forms)).astype(float)
        independent = _independent(samples, label, forms)
        self.worse = WORSE + CHANCE / np.maximum(independent * self.weight, CHANCE)
        self.held: list[set[int]] = [set() for _ in forms]
        # Of each cylinder the planes that it is tangent to.
        self.touching: list[tuple[int, ...]] = [() for _ in forms]
        self.before = [self._square(one, points) for one, points in zip(forms, self.points, strict=True)]

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
        return bool(self._square(new, self.points[row]) <= self.worse[row] * self.before[row] + floor)

    def _square(self, one: Form, points: Array) -> float:
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
    _axes(state)
    _one_line(state)
    _fillets(state, label)
    _equal_radii(state)
    return state.forms


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


def _fillets(state: _Regular, label: Int[Index, " N"]) -> None:
    """Cylinders that nearly go over into planes beside them do so; their radius is that which planes leave them."""
    for r, one in enumerate(state.forms):
        if one.kind != FormKind.CYLINDER or set(CENTER) & state.held[r]:
            continue
        planes = _beside_planes(state.samples, label, r, state.forms, NEAR_REACHES * state.reach)
        for some in _choices(planes):
            own = np.concatenate([state.points[k] for k in (r, *some)])
            tangent = _tangent_to(one, [state.forms[k] for k in some], own, state.reach / 2)
            if state.takes(r, tangent):
                state.forms[r], state.touching[r] = tangent, some
                break


def _beside_planes(samples: Samples, label: Int[Index, " N"], row: int, forms: list[Form], reach: float) -> list[int]:
    """The planes that a cylinder touches and is nearly tangent to, those that it touches in more places first."""
    i, j = samples.pairs.T
    touched = np.concatenate([label[j[label[i] == row]], label[i[label[j] == row]]])
    count = np.bincount(touched[touched >= 0], minlength=len(forms))
    one = forms[row]
    return [
        k
        for k in np.argsort(-count, kind="stable").tolist()
        if count[k] >= TOUCHED
        and forms[k].kind == FormKind.PLANE
        and abs(forms[k].axis @ one.axis) < ACROSS
        and abs(abs(float(forms[k].distance(one.center[None])[0])) - float(one.radius)) < reach
    ]


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


def _choices(planes: list[int]) -> list[tuple[int, ...]]:
    """Pairs of the planes, then each alone."""
    return [*combinations(planes, 2), *((k,) for k in planes)]


def _equal_radii(state: _Regular) -> None:
    """Cylinders, spheres and tori of nearly one radius get the mean of them."""
    for kind in (FormKind.CYLINDER, FormKind.SPHERE, FormKind.TORUS):
        rows = sorted(
            (r for r, one in enumerate(state.forms) if one.kind == kind), key=lambda r: float(state.forms[r].radius)
        )
        group: list[int] = []
        for r in [*rows, None]:
            if r is not None and (not group or _alike(state, group, r)):
                group.append(r)
                continue
            if len(group) > 1:
                weights = [state.weight[k] for k in group]
                radius = np.average([state.forms[k].radius for k in group], weights=weights)
                for k in group:
                    _with_radius(state, k, float(radius))
            group = [] if r is None else [r]


def _with_radius(state: _Regular, row: int, radius: float) -> None:
    """Gives a form a radius, if its samples allow it; a fillet stays one."""
    if not state.touching[row]:
        state.try_(row, replace(state.forms[row], radius=radius), RADIUS)
        return
    planes = [state.forms[k] for k in state.touching[row]]
    own = np.concatenate([state.points[k] for k in (row, *state.touching[row])])
    tangent = _tangent_to(state.forms[row], planes, own, state.reach / 2, radius)
    if state.takes(row, tangent):
        state.forms[row] = tangent


def _alike(state: _Regular, group: list[int], row: int) -> bool:
    apart = abs(float(state.forms[row].radius) - float(state.forms[group[0]].radius))
    return bool(apart < 0.5 * NEAR_REACHES * state.reach)
