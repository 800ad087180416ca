"""Circles and arcs placed by ridges that are exact, but for holes' rims that a detector pushes inwards."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import arc, around, circular_arc, lines_between, project, ridges_along, segment, turned, whole

from diff3ds import Analytic, render
from diff3ds.curves.shapes.curve_set import concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Circle, Kind, fit_circle
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges, map_ridges
from diff3ds.edges.evidence.support import CROWDED
from diff3ds.edges.measure import fit_ridges
from diff3ds.edges.measure.fit_ridges import circle_at, fit_to_ridges, in_plane, shown_of

CAMERAS = around(30, 160)
U, V, _ = turned(3)
CENTER = np.array([0.1, -0.2, 0.05])
PIXEL = edge_views(CAMERAS, ridges_along(CAMERAS, [arc(CENTER, 0.1 * U, 0.1 * V)])).pixel


def ridges(radius, push=0.0, every=2, start=0.0, stop=2 * np.pi):
    """Ridges of an arc; in all but every so manieth view pushed to the centre, pixels."""
    found = ridges_along(CAMERAS, [arc(CENTER, radius * U, radius * V, start, stop)])
    middle = project(CAMERAS, CENTER[None])[0][:, 0]
    pushed = []
    for view, (r, c) in enumerate(zip(found, middle, strict=True)):
        inward = np.sign(((c - r.points) * r.normals).sum(1))[:, None] * r.normals
        pushed.append(Ridges.sharp(r.points + push * bool(view % every) * inward, r.normals, r.values))
    return edge_views(CAMERAS, pushed)


def near(radius, start, stop, pixel_off=0.4):
    """An arc beside the true one, by a part of a pixel in every respect."""
    off = pixel_off * PIXEL
    radius += off
    return circular_arc(CENTER + off * np.array([0.6, -0.5, 0.6]), radius * U, radius * V, start, stop)


def circle(radius):
    """A circle near the true one."""
    return curves_of([replace(near(radius, 0, np.pi), kind=Kind.CIRCLE)])


def fitted(curves):
    return fit_circle(sampled(curves).reshape(-1, 3))


@pytest.mark.parametrize("pixels", [6.0, pytest.param(12.0, marks=pytest.mark.slow), 30.0])
@pytest.mark.parametrize(
    ("push", "every"),
    [(0.0, 2), (0.5, 2), pytest.param(0.5, 4, marks=pytest.mark.slow), pytest.param(0.8, 3, marks=pytest.mark.slow)],
)
def test_circles_are_placed_whether_their_rims_are_pushed_or_not(pixels, push, every):
    radius = pixels * PIXEL
    curves = circle(radius)
    found = fitted(fit_to_ridges(curves, ridges(radius, push, every), push))
    assert abs(found.radius / radius - 1) < 2e-3
    assert np.linalg.norm(found.center - CENTER) < 3e-3 * radius
    assert abs(np.cross(found.u, found.v) @ np.cross(U, V)) > 1 - 1e-5
    assert found.distances.max() < 1e-4 * radius


def test_without_the_offset_pushed_rims_make_circles_small():
    radius = 6 * PIXEL
    found = fitted(fit_to_ridges(circle(radius), ridges(radius, 0.5, 4), 0.0))
    assert found.radius / radius - 1 < -0.05


@pytest.mark.parametrize("stop", [1.9, 2.6])
def test_an_arc_keeps_its_ends(stop):
    """Of a quarter or more of a circle."""
    radius = 15 * PIXEL
    curves = curves_of([near(radius, 0.3, stop)])
    better = fit_to_ridges(curves, ridges(radius, start=0.3, stop=stop), 0.0)
    found = fitted(better)
    assert abs(found.radius / radius - 1) < 5e-3
    ends = CENTER + radius * (np.cos([[0.3], [stop]]) * U + np.sin([[0.3], [stop]]) * V)
    assert np.linalg.norm(better.points[0, [0, 3]].double().numpy() - ends, axis=1).max() < 0.5 * PIXEL


def test_short_arcs_and_circles_without_ridges_stay():
    radius = 15 * PIXEL
    short = curves_of([near(radius, 0.3, 1.5)])
    assert torch.equal(fit_to_ridges(short, ridges(radius), 0.0).points, short.constrained(short.points)[0])
    whole = circle(radius)
    corner = Ridges.sharp(np.array([[10.0, 10.0]]), np.array([[1.0, 0.0]]), np.ones(1))
    away = edge_views(CAMERAS, [corner] * len(CAMERAS))
    np.testing.assert_allclose(fit_to_ridges(whole, away, 0.5).points, whole.points, rtol=0, atol=1e-5)


def test_lines_are_placed_and_meet():
    ends = [CENTER + 0.5 * w for w in (U, V, np.cross(U, V))]
    views = edge_views(CAMERAS, ridges_along(CAMERAS, [segment(CENTER, end) for end in ends]))
    off = 0.5 * PIXEL * np.array([[1, 0, 0], [-0.6, 0.6, 0.3], [0, -0.4, 0.8]])
    rough = lines_between(*((CENTER + o, end + o[::-1]) for end, o in zip(ends, off, strict=True)))
    rough = replace(rough, vertex=torch.tensor([[0, 1], [0, 2], [0, 3]]))
    points = fit_to_ridges(rough, views, 0.5).points.double().numpy()
    assert np.abs(points[:, 0] - CENTER).max() < 0.02 * PIXEL
    # Along a line nothing says where it ends.
    for line, end in zip(points, ends, strict=True):
        along = (end - CENTER) / np.linalg.norm(end - CENTER)
        assert np.linalg.norm(np.cross(line[3] - CENTER, along)) < 0.02 * PIXEL


def test_a_large_arc_far_from_its_place_is_placed():
    radius = 45 * PIXEL
    curves = curves_of([near(radius, 0.3, 3.0, pixel_off=0.8)])
    found = fitted(fit_to_ridges(curves, ridges(radius, start=0.3, stop=3.0), 0.0))
    assert abs(found.radius / radius - 1) < 1e-3


@pytest.mark.parametrize("width", [3, 4])
def test_the_other_side_of_a_small_circle_hardly_pulls_its_ridges(monkeypatch, width):
    """Drawn: from aslant its two sides are near, and pull each other's ridges inwards."""
    radius = 5 * PIXEL
    true = curves_of([whole(CENTER, radius * U, radius * V)])
    # As strokes of their own: one stroke covers a pixel once, and does not add up where its sides are near.
    drawn = render(sketch_of(true, width / 160).segments(), CAMERAS, antialiasing=Analytic(0.7))
    views = edge_views(CAMERAS, [map_ridges(view.numpy()) for view in drawn.alpha])
    assert abs(fitted(fit_to_ridges(true, views, 0.0)).radius / radius - 1) < 3.5e-3
    monkeypatch.setattr(fit_ridges, "PULLED", CROWDED)
    assert fitted(fit_to_ridges(true, views, 0.0)).radius / radius - 1 < -2.5e-3


def test_two_circles_side_by_side_in_all_views_are_placed_nevertheless():
    """Six pixels apart in space along their axis, 3.6 to 4.6 in every picture."""
    axis, radius = np.cross(U, V), 40 * PIXEL
    cameras = around(200, 160)
    eyes = cameras.centers.double().numpy()
    apart = 6 * np.linalg.norm(np.cross(eyes, axis), axis=1) / np.linalg.norm(eyes, axis=1)
    cameras = cameras[torch.from_numpy(np.nonzero((apart > 3.6) & (apart < 4.6))[0])]
    rings = [arc(CENTER + gap * PIXEL * axis, radius * U, radius * V) for gap in (0, 6)]
    views = edge_views(cameras, ridges_along(cameras, rings))
    one, other = circle(radius), circle(radius)
    both = concatenated(one, replace(other, points=other.points + torch.from_numpy(6 * PIXEL * axis).float()))
    found = fitted(fit_to_ridges(both, views, 0.0)[torch.tensor([0])])
    assert abs(found.radius / radius - 1) < 2e-4
    assert np.linalg.norm(found.center - CENTER) < 2e-4 * radius


def test_a_circle_that_stays_in_its_plane_finds_its_centre_and_radius():
    radius = 12 * PIXEL
    start = Circle(CENTER + PIXEL * (0.4 * U - 0.5 * V), U, V, radius + 0.6 * PIXEL, np.zeros(1))
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    views = ridges(radius)
    found = circle_at(start, angle, shown_of(start, angle, views), views, 0.0, free=in_plane(start))
    assert abs(found.radius / radius - 1) < 2e-3
    assert np.linalg.norm(found.center - CENTER) < 2e-3 * radius
    assert abs((found.center - CENTER) @ np.cross(U, V)) < 1e-12
    assert np.cross(found.u, found.v) @ np.cross(U, V) == pytest.approx(1, abs=1e-12)


def test_no_curves():
    assert len(fit_to_ridges(curves_of([]), ridges(0.1), 0.5)) == 0
