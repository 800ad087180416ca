"""Arcs closed to circles that every view shows a part of, and arcs that end where they should."""

import itertools

import numpy as np
import pytest
from edge_scenes import arc, around, circular_arc, lines_between, ridges_along, segment, turned, whole

from diff3ds.curves.shapes.curve_set import concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Kind, fit_circle
from diff3ds.edges.complete.whole_circles import closed
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.reconstruct import confirming

CAMERAS = around(40, 160)
U, V, _ = turned(3)
UP = np.cross(U, V)
RADIUS = 0.3
CENTER = np.zeros(3)
MIN_VIEWS = confirming(len(CAMERAS))


def shaft():
    """The rim where a shaft leaves a plate: each view from above shows the half of it before the shaft."""
    lines = []
    for eye in CAMERAS.centers.double().numpy():
        toward = np.arctan2(eye @ V, eye @ U)
        half = [arc(CENTER, RADIUS * U, RADIUS * V, toward - np.pi / 2, toward + np.pi / 2)]
        lines.append(half if eye @ UP > 0 else [arc(CENTER, 1e-3 * U, 1e-3 * V)])
    return edge_views(CAMERAS, ridges_along(CAMERAS, lines))


def test_a_circle_that_every_view_shows_half_of_is_closed():
    views = shaft()
    # An arc 3 % too large, a line along the rim, and a line elsewhere.
    pieces = curves_of([circular_arc(0.01 * U, 1.03 * RADIUS * U, 1.03 * RADIUS * V, 0, 1.8)])
    ends = CENTER + RADIUS * (np.cos([[2.5], [2.9]]) * U + np.sin([[2.5], [2.9]]) * V)
    curves = concatenated(pieces, lines_between(ends, (0.8 * U, 0.8 * V)))
    found = closed(curves, views, MIN_VIEWS, 0.0)
    assert found.kind.tolist() == [Kind.LINE, Kind.CIRCLE]
    circle = fit_circle(sampled(found)[1:].reshape(-1, 3))
    assert abs(circle.radius / RADIUS - 1) < 2e-3
    assert np.linalg.norm(circle.center - CENTER) < 3e-3 * RADIUS
    # So do photographs, where it is surely no chance.
    assert closed(curves, views, MIN_VIEWS, 0.0, chance=Chance.of(views)).kind.tolist() == found.kind.tolist()


def test_of_photographs_circles_are_tried_where_all_around_is_no_chance(monkeypatch):
    line = arc(CENTER, RADIUS * U, RADIUS * V, 0, 3.8)
    views = edge_views(CAMERAS, ridges_along(CAMERAS, [line]))
    curves = curves_of([circular_arc(CENTER, RADIUS * U, RADIUS * V, 0, 3.2)])
    tried = []
    monkeypatch.setattr("diff3ds.edges.complete.whole_circles._whole", lambda *a: tried.append(a))
    closed(curves, views, MIN_VIEWS, 0.0)
    assert len(tried) == 1
    closed(curves, views, MIN_VIEWS, 0.0, chance=Chance.of(views))
    assert len(tried) == 1


def test_an_arc_that_ends_is_not_closed():
    line = arc(CENTER, RADIUS * U, RADIUS * V, 0, 3.5)
    views = edge_views(CAMERAS, ridges_along(CAMERAS, [line]))
    curves = curves_of([circular_arc(CENTER, RADIUS * U, RADIUS * V, 0, 3.2)])
    assert closed(curves, views, MIN_VIEWS, 0.0) is curves


def test_whole_circles_lines_and_short_arcs_stay():
    views = shaft()
    for curves in (
        curves_of([whole(CENTER, RADIUS * U, RADIUS * V)]),
        lines_between((CENTER, U)),
        curves_of([circular_arc(CENTER, RADIUS * U, RADIUS * V, 0, 1)]),
    ):
        assert closed(curves, views, MIN_VIEWS, 0.0) is curves


def hole(depth):
    """Two circles, one above the other; the lower one seen by every third view."""
    rims = [arc(CENTER + h * UP, RADIUS / 4 * U, RADIUS / 4 * V) for h in (0, -depth)]
    shown = np.stack([np.ones(len(CAMERAS), bool), np.arange(len(CAMERAS)) % 3 == 0], 1)
    return edge_views(CAMERAS, ridges_along(CAMERAS, rims, shown))


def test_a_small_circle_that_came_as_lines_is_found():
    radius = RADIUS / 4
    corners = [CENTER + radius * (np.cos(a) * U + np.sin(a) * V) for a in np.arange(5) * np.pi / 2]
    sides = lines_between(*itertools.pairwise(corners), (0.8 * U, 0.8 * V))
    found = closed(sides, hole(0.3), MIN_VIEWS, 0.0)
    # The line elsewhere stays, and the other rim is found along the axis.
    assert found.kind.tolist() == [Kind.LINE, Kind.CIRCLE, Kind.CIRCLE]
    for circle, height in zip(found.circles.values(), (0, -0.3), strict=True):
        assert abs(circle.radius / radius - 1) < 3e-3
        assert np.linalg.norm(circle.center - CENTER - height * UP) < 5e-3 * RADIUS


@pytest.mark.slow
def test_a_texture_all_over_is_no_other_end_of_a_hole():
    rng = np.random.default_rng(0)
    radius, views = RADIUS / 4, []
    for rim in ridges_along(CAMERAS, [arc(CENTER, radius * U, radius * V)]):
        middle, angle = rng.uniform(10, 150, (3000, 1, 2)), rng.uniform(0, 2 * np.pi, (3000, 1))
        along, normal = np.stack([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]).transpose(
            0, 2, 3, 1
        )
        points = (middle + np.linspace(-4, 4, 9)[:, None] * along).reshape(-1, 2)
        inside = ((points > 1) & (points < 159)).all(1)
        points, normals = points[inside], np.repeat(normal, 9, axis=1).reshape(-1, 2)[inside]
        both = np.concatenate([rim.points, points]), np.concatenate([rim.normals, normals])
        views.append(Ridges.sharp(*both, np.ones(len(both[0]))))
    circle = curves_of([whole(CENTER, radius * U, radius * V)])
    assert closed(circle, edge_views(CAMERAS, views), MIN_VIEWS, 0.0) is circle


def test_a_circle_outside_the_ball_has_no_other_end():
    far = CENTER + 1.05 * U
    for axes in ((V, UP), (U, V)):
        curves = curves_of([whole(far, *(0.05 * axis for axis in axes))])
        assert closed(curves, shaft(), MIN_VIEWS, 0.0) is curves


def test_a_square_is_no_circle():
    corners = [CENTER + RADIUS / 4 * (np.cos(a) * U + np.sin(a) * V) for a in np.arange(5) * np.pi / 2]
    pairs = list(itertools.pairwise(corners))
    views = edge_views(CAMERAS, ridges_along(CAMERAS, [segment(*pair) for pair in pairs]))
    sides = lines_between(*pairs)
    assert closed(sides, views, MIN_VIEWS, 0.0) is sides
