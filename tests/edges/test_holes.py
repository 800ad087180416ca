"""Two ends of a hole: which circles they are, and where the background shows through."""

from dataclasses import replace

import numpy as np
import pytest
from edge_scenes import arc, around, project, ridges_along, turned, whole

from diff3ds.curves.shapes.curve_set import curves_of, sampled
from diff3ds.curves.shapes.primitives import Circle, fit_circle
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.measure.fit_ridges import fit_to_ridges
from diff3ds.edges.measure.holes import other_ends, seen_through

CAMERAS = around(40, 200)
U, V, _ = turned(6)
UP = np.cross(U, V)
RADIUS, DEPTH = 0.12, 0.15
TOP, BOTTOM = (Circle(h * UP, U, V, RADIUS, np.zeros(1)) for h in (0.0, -DEPTH))
VIEWS = edge_views(CAMERAS, ridges_along(CAMERAS, [arc(c.center, RADIUS * U, RADIUS * V) for c in (TOP, BOTTOM)]))
ANGLE = 2 * np.pi * (np.arange(30) + 0.5) / 30


def test_the_background_shows_where_the_line_of_sight_misses_the_wall():
    found = seen_through(TOP, BOTTOM, ANGLE, VIEWS)
    inner = RADIUS - 2 * VIEWS.pixel
    wrong = 0
    for eye, row in zip(CAMERAS.centers.double().numpy(), found, strict=True):
        for angle, seen in zip(ANGLE, row, strict=True):
            beside = inner * (np.cos(angle) * U + np.sin(angle) * V)
            way = (beside - eye) / np.linalg.norm(beside - eye)
            if eye @ UP < 0:
                assert seen
                continue
            steps = beside + np.linspace(0, 1, 400)[:, None] * way * (DEPTH / abs(way @ UP))
            within = np.linalg.norm(steps - (steps @ UP)[:, None] * UP, axis=1) < RADIUS
            wrong += bool(within.all()) != seen
    # Rays that graze the other rim may fall to either side of it.
    assert wrong <= 2
    assert 0.05 < found[CAMERAS.centers.double().numpy() @ UP > 0].mean() < 0.95


def circles(*places):
    """Whole circles: (centre, u, v, radius)."""
    return curves_of([whole(c, r * u, r * v) for c, u, v, r in places])


@pytest.mark.parametrize(
    ("other", "paired"),
    [
        ((-DEPTH * UP, U, V, RADIUS), True),
        ((-DEPTH * UP, V, U, 1.01 * RADIUS), True),
        ((-DEPTH * UP, U, V, 1.1 * RADIUS), False),
        ((-DEPTH * UP + 0.1 * U, U, V, RADIUS), False),
        ((-DEPTH * UP, U, UP, RADIUS), False),
    ],
)
def test_two_circles_on_one_axis_are_the_ends_of_a_hole(other, paired):
    found = other_ends(circles((0 * UP, U, V, RADIUS), other).circles, VIEWS.pixel)
    assert sorted(found) == ([0, 1] if paired else [])


def test_of_three_ends_the_nearest_counts():
    curves = circles(*((h * UP, U, V, RADIUS) for h in (0.0, -0.3, 0.1)))
    found = other_ends(curves.circles, VIEWS.pixel)
    heights = [found[i].center @ UP for i in range(3)]
    np.testing.assert_allclose(heights, [0.1, 0.0, 0.0], rtol=0, atol=1e-6)


def test_a_small_offset_of_rims_is_told_from_a_small_hole():
    """Pushed by little more than the ridges scatter, parts one by one do not show it: the hole as a whole does."""
    outward, rng = 0.22, np.random.default_rng(0)
    ends = []
    for circle, end in ((TOP, BOTTOM), (BOTTOM, TOP)):
        rim = ridges_along(CAMERAS, [arc(circle.center, RADIUS * U, RADIUS * V)])
        middle = project(CAMERAS, circle.center[None])[0][:, 0]
        for view, (ridge, center) in enumerate(zip(rim, middle, strict=True)):
            inward = np.sign(((center - ridge.points) * ridge.normals).sum(1))[:, None] * ridge.normals
            at = np.linspace(0, 2 * np.pi, len(ridge), endpoint=False)
            pushed = seen_through(circle, end, at, VIEWS)[view][:, None]
            scatter = rng.normal(0, 0.12, 2)
            rim[view] = replace(ridge, points=ridge.points + outward * pushed * inward + scatter)
        ends.append(rim)
    both = [
        Ridges.sharp(*(np.concatenate([getattr(r, name) for r in pair]) for name in ("points", "normals", "values")))
        for pair in zip(*ends, strict=True)
    ]
    views = edge_views(CAMERAS, both)
    curves = circles(*((c.center, U, V, 1.01 * RADIUS) for c in (TOP, BOTTOM)))
    # Each by itself comes out .5 % small.
    for rim in sampled(fit_to_ridges(curves, views, outward)):
        assert abs(fit_circle(rim).radius / RADIUS - 1) < 0.003
