"""Circles that stand to known ones as holes and steps do, on their axes and in their planes, told by faint edges.

The search for edges looks at the strongest of the pictures only, and its bound on what chance makes has to be high
where a curve may lie anywhere. Of a circle on a known axis two numbers are open, of one in a known plane three: there
faint edges of many views, looked at narrowly, say enough.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from diff3ds._shapes import Array, Float
from diff3ds.curves.directions import dot
from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Circle, whole_circle
from diff3ds.edges.complete.hypothesis import SAMPLES, is_told
from diff3ds.edges.complete.whole_circles import FINE, along, angles
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.support import APART, crowded, spaced_samples
from diff3ds.edges.measure.fit_ridges import apart, circle_at, in_plane, on_axis, points_on, shown_of, tangents_on
from diff3ds.edges.measure.holes import PARALLEL
from diff3ds.edges.watch import Tick, no_tick
from diff3ds.parallel.in_copies import in_copies
from diff3ds.render.backends import get_num_threads

# [natural logarithms, fraction; empirical] Such evidence in the mean around, and for an edge on so much of it, makes a
# circle worth fitting.
PROMISING, AROUND = 3.0, 0.8
# [natural logarithms; empirical] One place says so much against or for a circle that is looked for at most.
AGAINST, FOR = -10.0, 25.0
# [px; empirical] Steps of heights and radii on an axis; the smallest circles, and the largest in a plane.
STEP, SMALLEST, LARGEST = 2.0, 4, 40
# [px; empirical] Curves whose points are no farther from a plane lie in it; axes and planes so near are one.
SAME = 1.5
# [px, rounds; empirical] Fitted to the ridges a circle moves no farther, and is asked about again.
FARTHEST, ROUNDS = 3.0, 2
# [px, natural logarithms; empirical] Radii that differ by less are equal unless a circle is less likely then by more:
# one number less is open.
ALIKE, DEARER = 1.0, 1.0
# [proposals; speed] So many are looked at side by side.
AT_ONCE = 64
# [1; speed] Of the places around one of so many is asked first.
GLANCE = 3
# [1; numerical] Directions that are told apart in a plane.
DIRECTIONS = 14
# [places; speed] Larger planes are not looked at.
MOST_PLACES = 60_000

# A circle that may be there, and how it may change; see `circle_at`. The radius is the last column.
Proposal = tuple[Circle, Float[Array, "6 _"]]
# Of circles that are worth fitting how promising they are, their centres and radii.
_Promising = tuple[Float[Array, " _"], Float[Array, "_ 3"], Float[Array, " _"]]


def with_related_circles(curves: Curves, chance: Chance, outward: float, tick: Tick = no_tick) -> Curves:
    """The curves with the circles on axes and in planes of circles that the views show, instead of pieces along them.

    Args:
        chance: of views with faint edges as well, looked at narrowly.
        outward: offset of outlines, pixels.
        tick: see `watch`.
    """
    known = list(curves.circles.values())
    count, pixel = len(known), chance.views.pixel
    if not count:
        return curves
    scene = _Scene(sampled(curves), chance, Chance.of(chance.views), outward)
    drawn = spaced_samples(curves, pixel)[:2]
    asked: list[Circle] = []
    while len(asked) < len(known):
        tick(len(asked), len(known))
        proposals = list(_proposals(known[len(asked)], asked, scene))
        while proposals:
            found, proposals = _first_fitted(proposals, known, drawn, scene)
            if found is not None:
                known.append(found)
                around = angles(int(np.ceil(2 * np.pi * found.radius / pixel)))
                drawn = (
                    np.concatenate([drawn[0], points_on(found, around)]),
                    np.concatenate([drawn[1], tangents_on(found, around)]),
                )
        asked.append(known[len(asked)])
    new = known[count:]
    if not new:
        return curves
    gone = np.any([along(circle, scene.samples, pixel) for circle in new], axis=0) & ~curves.closed.numpy()
    return concatenated(curves[torch.from_numpy(~gone)], curves_of([whole_circle(circle) for circle in new]))


@dataclass(frozen=True, eq=False)
class _Scene:
    """What proposals are judged by.

    Attributes:
        samples: points along each curve.
        narrow: what the views show, for circles that are there.
        wide: the same less narrowly, for those that are looked for.
        outward: offset of outlines, pixels.
    """

    samples: Float[Array, "N S 3"]
    narrow: Chance
    wide: Chance
    outward: float

    @property
    def pixel(self) -> float:
        return self.narrow.views.pixel


def _proposals(circle: Circle, asked: list[Circle], scene: _Scene) -> Iterator[Proposal]:
    """What may be there on the axis and in the plane of a circle, unless one asked about before shares them."""
    axes = [abs(np.cross(circle.u, circle.v) @ np.cross(other.u, other.v)) > PARALLEL for other in asked]
    steps = [other.center - circle.center for other, parallel in zip(asked, axes, strict=True) if parallel]
    height = np.array(steps).reshape(-1, 3) @ np.cross(circle.u, circle.v)
    beside = np.sqrt(np.maximum(dot(np.array(steps).reshape(-1, 3), np.array(steps).reshape(-1, 3)) - height**2, 0.0))
    if not (beside < SAME * scene.pixel).any():
        for start in _on_axis(circle, scene):
            yield start, on_axis(start)
    if not (np.abs(height) < SAME * scene.pixel).any():
        for start in _in_plane(circle, scene):
            yield start, in_plane(start)


def _on_axis(circle: Circle, scene: _Scene) -> list[Circle]:
    """Circles on its axis, the most promising first."""
    step, axis = STEP * scene.pixel, np.cross(circle.u, circle.v)
    away = scene.samples.reshape(-1, 3) - circle.center
    far = float(np.sqrt(np.maximum(dot(away, away) - (away @ axis) ** 2, 0.0)).max())
    radii = np.arange(SMALLEST * scene.pixel, far + step, step)
    angle = angles(SAMPLES)
    rays = points_on(circle._replace(center=np.zeros(3), radius=1.0), angle)
    tangents = tangents_on(circle, angle)
    heights = np.arange(-1, 1, step)
    centers = circle.center + (heights[:, None] - circle.center @ axis) * axis
    # What is looked for lies in the unit ball.
    centers = centers[dot(centers, centers) <= 1]

    def at(k: int) -> _Promising:
        def told(radius: Float[Array, " R"], some: slice) -> Float[Array, "S R"]:
            x = centers[k] + radius[:, None, None] * rays[some]
            along = np.broadcast_to(tangents[some], x.shape)
            return scene.wide.evidence(x.reshape(-1, 3), along.reshape(-1, 3)).reshape(x.shape[:2]).T

        # Where some places speak against a circle already, the others are not asked.
        against = (told(radii, slice(None, None, GLANCE)) <= 0).sum(0)
        rest = radii[against <= (1 - AROUND) * SAMPLES]
        score = _score(told(rest, slice(None)))
        good = np.flatnonzero(score > PROMISING)
        return score[good], np.broadcast_to(centers[k], (len(good), 3)), rest[good]

    return _best(in_copies(at, len(centers), len(centers)), circle, scene.pixel)


def _in_plane(circle: Circle, scene: _Scene) -> list[Circle]:
    """Circles within the box of what lies in its plane, the most promising first.

    What the views say of each place and direction of the plane is asked for once.
    """
    pixel, axes = scene.pixel, np.stack([circle.u, circle.v])
    off = np.abs((scene.samples - circle.center) @ np.cross(*axes)).max(1)
    flat = ((scene.samples[off < SAME * pixel] - circle.center) @ axes.T).reshape(-1, 2)
    if not len(flat):
        return []
    rows, columns = (np.arange(low, high + pixel, pixel) for low, high in zip(flat.min(0), flat.max(0), strict=True))
    if len(rows) * len(columns) > MOST_PLACES:
        return []
    places = circle.center + np.stack(np.meshgrid(rows, columns, indexing="ij"), -1) @ axes

    def along(k: int) -> Float[Array, "R C"]:
        turn = np.pi * k / DIRECTIONS
        tangent = np.broadcast_to(np.array([np.cos(turn), np.sin(turn)]) @ axes, (places.size // 3, 3))
        there = scene.wide.evidence(places.reshape(-1, 3), tangent)
        return np.pad(there.reshape(places.shape[:2]), LARGEST, constant_values=AGAINST)

    told = in_copies(along, DIRECTIONS, DIRECTIONS)
    angle, found = angles(SAMPLES), list[_Promising]()
    across = np.round((angle / np.pi + 0.5) * DIRECTIONS).astype(int) % DIRECTIONS
    for radius in range(SMALLEST, LARGEST):
        steps = LARGEST + np.round(radius * np.stack([np.cos(angle), np.sin(angle)], 1)).astype(int)
        around = [told[k][i : i + len(rows), j : j + len(columns)] for k, (i, j) in zip(across, steps, strict=True)]
        score = _score(np.stack(around)).ravel()
        good = np.flatnonzero(score > PROMISING)
        found.append((score[good], places.reshape(-1, 3)[good], np.full(len(good), radius * pixel)))
    return _best(found, circle, pixel)


def _first_fitted(
    proposals: list[Proposal],
    known: list[Circle],
    drawn: tuple[Float[Array, "D 3"], Float[Array, "D 3"]],
    scene: _Scene,
) -> tuple[Circle | None, list[Proposal]]:
    """The first circle of some proposals that is there, if one is, and the proposals that are left; see `_fitted`."""
    # Without copies one after the other, since what comes after a circle that is there is asked about anew.
    some = proposals[: AT_ONCE if get_num_threads() > 1 else 1]
    fitted = in_copies(lambda k: _fitted(some[k], known, drawn, scene), len(some), len(some))
    for k, found in enumerate(fitted):
        if found is not None:
            return found, proposals[k + 1 :]
    return None, proposals[len(some) :]


def _fitted(
    proposal: Proposal, known: list[Circle], drawn: tuple[Float[Array, "D 3"], Float[Array, "D 3"]], scene: _Scene
) -> Circle | None:
    """The proposed circle where the ridges are, with the radius of a known one if it may have that; None if none is.

    Args:
        drawn: points along all that is known, and unit tangents: where these appear beside it a view says nothing.
    """
    start, free = proposal
    found = _moved(start, free, known, scene)
    if found is None:
        return None
    told = _told(found, drawn, scene)
    if not is_told(told):
        return None
    near = [other.radius for other in known if abs(other.radius - found.radius) < ALIKE * scene.pixel]
    for radius in sorted(near, key=lambda radius: abs(radius - found.radius)):
        equal = _moved(found._replace(radius=radius), free[:, :-1], known, scene)
        if equal is not None and is_told(again := _told(equal, drawn, scene)) and again.mean() > told.mean() - DEARER:
            return equal
    return found


def _moved(start: Circle, free: Float[Array, "6 K"], known: list[Circle], scene: _Scene) -> Circle | None:
    """The circle where the ridges are; None where that is far away, or on a known one."""
    views, angle, circle = scene.narrow.views, angles(FINE), start
    for _ in range(ROUNDS):
        if any(_may_be_one(circle, other, scene.pixel) for other in known):
            return None
        moved = circle_at(circle, angle, shown_of(circle, angle, views), views, scene.outward, free=free)
        if moved is None or apart(points_on(moved, angle), points_on(start, angle)) > FARTHEST * scene.pixel:
            return None
        circle = moved
    return None if any(_may_be_one(circle, other, scene.pixel) for other in known) else circle


def _told(circle: Circle, drawn: tuple[Float[Array, "D 3"], Float[Array, "D 3"]], scene: _Scene) -> Float[Array, " S"]:
    """What the views that show nothing known beside it say of the circle around it."""
    chance, angle = scene.narrow, angles(FINE)
    x, tangents = points_on(circle, angle), tangents_on(circle, angle)
    places, directions = np.concatenate([x, drawn[0]]), np.concatenate([tangents, drawn[1]])
    others = np.arange(len(places)) >= FINE
    asked = np.broadcast_to(~others, (len(chance.views), len(others)))
    beside = crowded(chance.views, places, directions, others, at=asked, within=2 * chance.near)[:, :FINE]
    return chance.evidence(x, tangents, ~beside)


def _score(told: Float[Array, "S *n"]) -> Float[Array, "*n"]:
    """The mean of what places around say, where enough of them speak for a circle."""
    told = np.clip(told, AGAINST, FOR)
    return np.asarray(np.where((told > 0).mean(0) >= AROUND, told.mean(0), AGAINST))


def _best(found: list[_Promising], circle: Circle, pixel: float) -> list[Circle]:
    """Circles like one, the best first, without those that may be better ones; see `_may_be_one`."""
    from scipy.spatial import cKDTree

    if not found:
        return []
    score, center, radius = (np.concatenate(column) for column in zip(*found, strict=True))
    place = np.column_stack([center, radius])
    tree, free = cKDTree(place), np.ones(len(place), bool)
    kept = []
    for row in np.argsort(-score, kind="stable").tolist():
        if free[row]:
            kept.append(circle._replace(center=center[row], radius=float(radius[row])))
            free[tree.query_ball_point(place[row], np.nextafter(APART * pixel, 0))] = False
    return kept


def _may_be_one(one: Circle, other: Circle, pixel: float) -> bool:
    """Whether two circles with one axis or in one plane are nearer to each other than lines that are two."""
    return bool(np.hypot(np.linalg.norm(one.center - other.center), one.radius - other.radius) < APART * pixel)
