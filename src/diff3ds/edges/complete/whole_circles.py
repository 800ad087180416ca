"""Arcs closed to whole circles where the views show the rest, each a part of it: a shaft hides half of its own rim."""

from collections.abc import Iterator

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float
from diff3ds.curves.shapes.curve_set import Curves, concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Circle, Kind, fit_circle, whole_circle
from diff3ds.curves.shapes.straight_lines import pairs_by_ends
from diff3ds.edges.complete.hypothesis import AGAIN, COVERED, SAMPLES, SHOWN, Hypothesis, fraction_shown, pieces_of
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import EdgeViews
from diff3ds.edges.measure.fit_ridges import (
    LEAST_SWEEP,
    STILL,
    apart,
    circle_at,
    circle_residuals,
    points_on,
    shown_of,
    tangents_on,
)
from diff3ds.edges.measure.holes import ALIKE, SHALLOWEST
from diff3ds.edges.watch import Tick, no_tick
from diff3ds.parallel.in_copies import in_copies

# [points; empirical] Sample points all around a circle: those of other proposals would lie far apart on a large one.
FINE = 60
# [fraction; speed] This fraction of a circle has to be shown before it is fitted to the ridges.
PROMISING = 0.5
# [fraction; measured] And this fraction of it shows likelier an edge than chance: of 64 circles through curves of the
# NeRF chair .9 and more of both that were found, less than this of 50 others.
EVIDENT = 0.8
# [ratio; measured] All around about as many views pass a circle: so many, relative to the median. Of true circles at
# .95 of the sample points or more, of squares of 10 to 25 pixels across at .57 to .78.
EVEN = 0.5
# [fraction; measured] Of the views with a ridge nearby this fraction passes the circle itself: of 23 true circles .55
# or more at .85 of the sample points, of 9 that were none .46 or less but for one.
PASSED = 0.52
# [px; derived] A view shows a sample point of a circle that its ridge passes this closely: twice the scatter.
SEEN_WITHIN = 0.4
# [rounds; empirical] Rounds of fitting and asking again what the views show.
ROUNDS = 4
# [px; empirical] Pieces of a small circle are at most so long, follow each other within a gap, and lie loosely on it.
LONGEST_SIDE, GAP, LOOSE = 25.0, 5.0, 2.0
# [px, circles; empirical] The other end of a hole is looked for along its axis in such steps, and tried at so many
# heights; its radius and axis are known already.
STEP, TRIES = 2.0, 2
# [circles; speed] So many are fitted side by side, before what was found says which others need not be.
TOGETHER = 8


def closed(
    curves: Curves,
    views: EdgeViews,
    min_views: float,
    outward: float,
    tick: Tick = no_tick,
    chance: Chance | None = None,
) -> Curves:
    """The curves with whole circles instead of the arcs and pieces along them.

    Args:
        min_views: so many views confirm an edge.
        outward: the offset of outlines in these views, pixels.
        tick: see `watch`.
        chance: of photographs; what these show has to be likelier an edge than chance all around.
    """
    free = ~curves.closed.numpy()
    points = sampled(curves)
    found: list[Circle] = []
    starts = [
        (start, list(members))
        for start, members in _starts(curves, points, views.pixel)
        if _promising(start, views, min_views) and (chance is None or _evident(start, chance))
    ]
    for done in range(0, len(starts), TOGETHER):
        tick(done, len(starts))
        some = [(start, members) for start, members in starts[done : done + TOGETHER] if free[members].all()]
        fitted = _all_whole([start for start, _ in some], views, min_views, outward)
        for circle, (_, members) in zip(fitted, some, strict=True):
            if circle is not None and free[members].all():
                free &= ~along(circle, points, views.pixel)
                found.append(circle)
    for twin in _twins([*curves.circles.values(), *found], views, min_views, outward):
        free &= ~along(twin, points, views.pixel)
        found.append(twin)
    keep = torch.from_numpy(free) | curves.closed
    return concatenated(curves[keep], curves_of([whole_circle(c) for c in found])) if found else curves


def _starts(curves: Curves, points: Float[Array, "N S 3"], pixel: float) -> Iterator[tuple[Circle, tuple[int, ...]]]:
    """Circles through arcs, the longest first, then through two pieces in a row; and what they go through.

    Chains of points break up where a small circle turns fast: it comes as lines.
    """
    length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(1)
    for i in np.argsort(-length, kind="stable"):
        circle = fit_circle(points[i]) if int(curves.kind[i]) == Kind.ARC else None
        if circle is not None and length[i] >= LEAST_SWEEP * circle.radius:
            yield circle, (int(i),)
    short = np.nonzero(~curves.closed.numpy() & (length < LONGEST_SIDE * pixel))[0]
    for i, k in short[pairs_by_ends(points[short][:, [0, -1]], GAP * pixel)].tolist():
        circle = fit_circle(np.concatenate([points[i], points[k]]))
        if circle is not None and circle.distances.max() < LOOSE * pixel and circle.radius < LONGEST_SIDE * pixel:
            yield circle, (i, k)


def _twins(circles: list[Circle], views: EdgeViews, min_views: float, outward: float) -> list[Circle]:
    """Circles of the same radius and axis: the other end of a hole or shaft, which fewer views show."""
    known = list(circles)
    fewer = AGAIN * min_views

    def is_known(circle: Circle) -> bool:
        return any(_is_near(circle, other, views.pixel) for other in known)

    def proposed(circle: Circle) -> list[Circle]:
        """The same circle at other heights, those first that the views show most of."""
        at = _along_axis(circle, views.pixel)
        fractions = _fractions_shown(at, views, SHOWN * fewer)
        around = np.concatenate([[0.0], fractions, [0.0]])
        tops = np.nonzero((fractions >= COVERED) & (fractions >= around[:-2]) & (fractions > around[2:]))[0]
        return [at[k] for k in sorted(tops, key=lambda k: -fractions[k])]

    starts = in_copies(lambda i: proposed(circles[i]), len(circles), len(circles))
    # What is tried unless twins found before are the same.
    first = [
        (i, k) for i, at in enumerate(starts) for k in [k for k, one in enumerate(at) if not is_known(one)][:TRIES]
    ]
    fitted = dict(zip(first, _all_whole([starts[i][k] for i, k in first], views, fewer, outward), strict=True))
    for i, circle in enumerate(circles):
        for k in [k for k, one in enumerate(starts[i]) if not is_known(one)][:TRIES]:
            twin = fitted[i, k] if (i, k) in fitted else _whole(starts[i][k], views, fewer, outward)
            if twin is None or abs(twin.radius - circle.radius) > ALIKE * circle.radius:
                continue
            if not is_known(twin):
                known.append(twin)
    return known[len(circles) :]


def _along_axis(circle: Circle, pixel: float) -> list[Circle]:
    """The circle moved along its axis, within the unit ball."""
    axis = np.cross(circle.u, circle.v)
    heights = np.arange(-1, 1, STEP * pixel)[:, None]
    centers = circle.center + (heights - circle.center @ axis) * axis
    return [circle._replace(center=c) for c in centers if np.linalg.norm(c) < 1]


def _fractions_shown(circles: list[Circle], views: EdgeViews, min_views: float) -> Float[Array, " C"]:
    """The fraction of each circle's sample points that enough views show."""
    if not circles:
        return np.zeros(0)
    return fraction_shown(_around(circles, angles(SAMPLES)).shown(views), min_views)


def _is_near(one: Circle, other: Circle, pixel: float) -> bool:
    """Whether two circles are one, seen badly."""
    off = np.linalg.norm(one.center - other.center) + abs(one.radius - other.radius)
    return bool(off < SHALLOWEST * pixel)


def _promising(circle: Circle, views: EdgeViews, min_views: float) -> bool:
    """Whether enough views show something like half of the circle, before it is fitted to the ridges."""
    return bool(fraction_shown(_around([circle], angles(FINE)).shown(views), SHOWN * min_views)[0] >= PROMISING)


def _evident(circle: Circle, chance: Chance) -> bool:
    """Whether nearly all around the views show likelier an edge than chance, before it is fitted to the ridges."""
    angle = angles(FINE)
    told = chance.evidence(points_on(circle, angle), tangents_on(circle, angle))
    return bool((told > 0).mean() >= EVIDENT)


def _all_whole(circles: list[Circle], views: EdgeViews, min_views: float, outward: float) -> list[Circle | None]:
    return in_copies(lambda k: _whole(circles[k], views, min_views, outward), len(circles), len(circles))


def _whole(circle: Circle, views: EdgeViews, min_views: float, outward: float) -> Circle | None:
    """The circle fitted to all that the views show of it; None if that is not all around."""
    angle = angles(FINE)
    for _ in range(ROUNDS):
        moved = circle_at(circle, angle, shown_of(circle, angle, views), views, outward)
        if moved is None or not _promising(moved, views, min_views):
            return None
        still = apart(points_on(moved, angle), points_on(circle, angle)) < STILL * views.pixel
        circle = moved
        if still:
            break
    shown = shown_of(circle, angle, views)
    passed = shown & (circle_residuals(circle, angle, views, outward) < SEEN_WITHIN)
    # A square passes its inscribed circle in many views, but seldom at its corners; other lines pass by here and there.
    least = np.maximum(max(SHOWN * min_views, EVEN * float(np.median(passed.sum(0)))), PASSED * shown.sum(0))
    return circle if fraction_shown(passed, least) >= COVERED else None


def along(circle: Circle, points: Float[Array, "N S 3"], pixel: float) -> Bool[NDArray[np.bool_], " N"]:
    """Which curves lie along the circle."""
    around = angles(int(np.ceil(4 * np.pi * circle.radius / pixel)))
    return pieces_of(points_on(circle, around), points, pixel)


def angles(count: int) -> Float[Array, " S"]:
    """So many angles, evenly spaced all around."""
    return 2 * np.pi * np.arange(count) / count


def _around(circles: list[Circle], angle: Float[Array, " S"]) -> Hypothesis:
    """The circles sampled at these angles."""
    x, tangents = ([on(circle, angle) for circle in circles] for on in (points_on, tangents_on))
    return Hypothesis(np.stack(x), np.stack(tangents))
