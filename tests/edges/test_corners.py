"""Rounded corners that were found as something else, or not at all."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import arc, around, circular_arc, lines_between, segment, turned, views_of

from diff3ds.curves.shapes.curve_set import concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.edges.complete.corners import with_corners
from diff3ds.edges.measure.fillets import with_fillets
from diff3ds.edges.reconstruct import confirming

CAMERAS = around(24, 160)
MIN_VIEWS = confirming(len(CAMERAS))
TILT = turned(4)
RADIUS = 0.2
# Two sides of a square that meet at the origin.
FIRST, SECOND = np.array([-0.8, 0, 0]), np.array([0, -0.8, 0])
CENTER = np.array([-RADIUS, -RADIUS, 0])
X, Y, Z = np.eye(3)
ROUND = [segment(FIRST, -RADIUS * X), arc(CENTER, RADIUS * Y, RADIUS * X, 0, np.pi / 2), segment(-RADIUS * Y, SECOND)]
SHARP = [segment(FIRST, 0 * X), segment(0 * X, SECOND)]
BENT = arc(CENTER, RADIUS * Y, RADIUS * X, 0, np.pi / 2, 4)
FACETS = [segment(a, b) for a, b in itertools.pairwise((FIRST, *BENT, SECOND))]
CHAMFER = [segment(FIRST, -RADIUS * X), segment(-RADIUS * X, -RADIUS * Y), segment(-RADIUS * Y, SECOND)]


def seen(lines, views=len(CAMERAS)):
    """The views of these lines, which only so many show."""
    shown = np.zeros((len(CAMERAS), len(lines)), bool)
    shown[:views] = True
    return views_of(CAMERAS, [line @ TILT.T for line in lines], shown)


def tilted(*segments):
    return lines_between(*((np.asarray(a) @ TILT.T, np.asarray(b) @ TILT.T) for a, b in segments))


def off_the_arc(curves):
    """How far the curves' arcs lie from the true one, in radii."""
    x = sampled(curves)[(curves.kind == Kind.ARC).numpy()].reshape(-1, 3) @ TILT - CENTER
    return np.abs(np.hypot(np.hypot(x[:, 0], x[:, 1]) - RADIUS, x[:, 2])).max() / RADIUS


@pytest.mark.parametrize("gap", [-0.03, 0.0, 0.05, 0.1, 0.15])
def test_an_arc_that_is_missing_is_found(gap):
    curves = tilted((FIRST, -(RADIUS + gap) * X), (SECOND, -(RADIUS + gap) * Y))
    ends = curves.points[:, 0].clone()
    views = seen(ROUND)
    found = with_corners(curves, views, MIN_VIEWS)
    assert found.kind.tolist() == [Kind.LINE, Kind.LINE, Kind.ARC]
    assert found.vertex[2].tolist() == [found.vertex[0, 1], found.vertex[1, 1]]
    assert torch.allclose(found.points[:2, 0], ends, atol=1e-6)
    assert off_the_arc(found) < 0.1
    assert off_the_arc(with_fillets(found, views, 0.0)) < 0.005


def test_pieces_of_an_arc_go():
    """Two short lines for the arc, as chains that break up give them; one of them runs on into a side."""
    on = arc(CENTER, RADIUS * Y, RADIUS * X, 0, np.pi / 2, 5)
    curves = tilted((FIRST, on[0]), (on[0] - 0.03 * X, on[2]), (on[2], on[4]), (on[4], SECOND))
    found = with_corners(curves, seen(ROUND), MIN_VIEWS)
    assert found.kind.tolist() == [Kind.LINE, Kind.LINE, Kind.ARC]
    assert off_the_arc(found) < 0.1


def test_many_short_pieces_that_are_nearly_as_near_to_the_ridges_go():
    """Three chords of 30 degrees: the arc is nearer to the ridges by .06 pixels only, but it is one."""
    curves = tilted(*itertools.pairwise((FIRST, *BENT, SECOND)))
    found = with_corners(curves, seen(ROUND), MIN_VIEWS)
    assert found.kind.tolist() == [Kind.LINE, Kind.LINE, Kind.ARC]
    assert off_the_arc(found) < 0.1


def test_an_arc_that_meets_its_lines_at_an_angle_becomes_one_that_touches_them():
    """Half as large again, through the middle of the true one, and at 25 degrees to both lines."""
    near, half = 0.711 * RADIUS, np.deg2rad(20)
    out, across = (X + Y) / np.sqrt(2), (X - Y) / np.sqrt(2)
    radius = near / np.sqrt(2) / np.sin(half)
    center = -near / np.sqrt(2) * out - radius * np.cos(half) * out
    bent = circular_arc(TILT @ center, radius * TILT @ out, radius * TILT @ across, -half, half)
    curves = concatenated(tilted((FIRST, -near * X), (-near * Y, SECOND)), curves_of([bent]))
    curves = replace(curves, vertex=torch.tensor([[0, 1], [2, 3], [1, 2]]))
    assert torch.allclose(*(curves.constrained(curves.points)[0], curves.points), atol=1e-6)
    views = seen(ROUND)
    assert off_the_arc(with_fillets(curves, views, 0.0)) > 0.04
    assert off_the_arc(with_fillets(with_corners(curves, views, MIN_VIEWS), views, 0.0)) < 0.005


def test_where_another_arc_joins_the_lines_is_no_corner():
    """One that leaves the plane of the lines, so that it is no piece of an arc between them."""
    start, stop = -RADIUS * X, -RADIUS * Y
    center, aside = (start + stop) / 2, (X - Y) / np.sqrt(2)
    half = RADIUS / np.sqrt(2)
    bent = circular_arc(TILT @ center, half * TILT @ Z, half * TILT @ aside, -np.pi / 2, np.pi / 2)
    lines = tilted((FIRST, start), (stop, SECOND))
    curves = concatenated(lines, curves_of([bent]))
    curves = replace(curves, vertex=torch.tensor([[0, 1], [2, 3], [1, 2]]))
    views = seen([*ROUND, arc(center, half * Z, half * aside, -np.pi / 2, np.pi / 2)])
    assert len(with_corners(lines, views, MIN_VIEWS)) == 3
    assert with_corners(curves, views, MIN_VIEWS) is curves


@pytest.mark.parametrize("length", [0.22, 0.0])
def test_a_side_in_two_pieces_becomes_one(length):
    """Or one of no length at all, before the arc that is missing."""
    break_ = RADIUS + 0.03 + length
    pieces = (FIRST, -(break_ + 0.01 * (length > 0)) * X), (-break_ * X, -(RADIUS + 0.03) * X)
    found = with_corners(tilted(*pieces, (-(RADIUS + 0.03) * Y, SECOND)), seen(ROUND), MIN_VIEWS)
    arcs = found.kind == Kind.ARC
    assert int(arcs.sum()) == 1
    assert off_the_arc(found) < 0.1
    x = sampled(found).reshape(-1, 3) @ TILT
    assert np.abs(x - FIRST).sum(1).min() < 1e-4
    assert np.abs(x - SECOND).sum(1).min() < 1e-4


@pytest.mark.parametrize("lines", [SHARP, CHAMFER, FACETS])
def test_sharp_corners_chamfers_and_facets_stay(lines):
    """A side ends too early, or the chamfer or three facets are there."""
    pieces = [(FIRST, -0.1 * X), (-0.02 * Y, SECOND)] if lines is SHARP else [(line[0], line[-1]) for line in lines]
    curves = tilted(*pieces)
    assert with_corners(curves, seen(lines), MIN_VIEWS) is curves


def test_what_too_few_views_show_is_no_corner():
    curves = tilted((FIRST, -RADIUS * X), (SECOND, -RADIUS * Y))
    assert len(with_corners(curves, seen(ROUND), MIN_VIEWS)) == 3
    assert with_corners(curves, seen(ROUND, views=3), MIN_VIEWS) is curves


def test_lines_that_pass_each_other_have_no_corner():
    """Even if the views show an arc halfway between them."""
    above = 0.1 * Z
    sides = (FIRST, -RADIUS * X), (SECOND + above, -RADIUS * Y + above)
    views = seen([segment(*sides[0]), ROUND[1] + above / 2, segment(*sides[1])])
    curves = tilted(*sides)
    assert with_corners(curves, views, MIN_VIEWS) is curves


def test_round_corners_stay():
    found = with_corners(tilted((FIRST, -RADIUS * X), (SECOND, -RADIUS * Y)), seen(ROUND), MIN_VIEWS)
    assert with_corners(found, seen(ROUND), MIN_VIEWS) is found
    assert len(with_corners(lines_between(), seen(ROUND), MIN_VIEWS)) == 0


def test_another_curve_at_the_end_of_a_line_keeps_its_end():
    curves = tilted((FIRST, -RADIUS * X), (SECOND, -RADIUS * Y), (-RADIUS * X, -RADIUS * X + 0.5 * Z))
    # Where they share a vertex, their own ends lie a little apart.
    points = curves.points + 0.02 * torch.tensor([[[0.0]], [[0.0]], [[1.0]]]) * torch.from_numpy(TILT[:, 1]).float()
    curves = replace(curves, points=points, vertex=torch.tensor([[0, 1], [2, 3], [1, 4]]))
    upright = segment(-RADIUS * X, -RADIUS * X + 0.5 * Z)
    found = with_corners(curves, seen([*ROUND, upright]), MIN_VIEWS)
    assert int((found.kind == Kind.ARC).sum()) == 1
    assert np.allclose(sampled(found)[2], sampled(curves)[2], atol=1e-6)
