"""Curves pruned, joined and welded, on pieces of known lines and circles."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import torch
from edge_scenes import around, circular_arc, lines_between, segment, turned, views_of, whole

from diff3ds.curves.shapes.curve_set import concatenated, curves_of, sampled
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.curves.shapes.simplest import simplest
from diff3ds.edges.clean.simplify import joined, pruned
from diff3ds.edges.clean.weld import welded

U, V, _ = turned(4)
CENTER = np.array([0.1, 0.2, -0.1])
# World units.
PIXEL = 0.01


def ends(curves):
    return np.round(curves.points[:, [0, 3]].double().numpy(), 5)


def circle_pieces(*cuts):
    """Arcs of one circle between these angles in degrees."""
    radians = [math.radians(c) for c in cuts]
    return [circular_arc(CENTER, 0.5 * U, 0.5 * V, a, b) for a, b in pairwise(radians)]


def test_two_halves_of_a_line_are_one_line():
    # The second runs the other way; a pixel is missing between them, and a third line starts at an angle.
    curves = joined(lines_between(((0, 0, 0), (0.5, 0, 0)), ((1, 0, 0), (0.51, 0, 0)), ((1, 0, 0), (1, 1, 0))), PIXEL)
    assert len(curves) == 2
    assert curves.kind.tolist() == [Kind.LINE] * 2
    lengths = np.linalg.norm(ends(curves)[:, 1] - ends(curves)[:, 0], axis=1)
    np.testing.assert_allclose(lengths, 1, rtol=0, atol=1e-4)


def test_a_rounded_corner_is_no_cubic():
    # Within half a pixel a cubic fits a quarter circle of six pixels and a line of ten, and has fewer numbers.
    u, v = 0.06 * U, 0.06 * V
    line = lines_between((CENTER + u - 0.1 * V, CENTER + u))
    corner = concatenated(line, curves_of([circular_arc(CENTER, u, v, 0, math.pi / 2)]))
    assert simplest(np.concatenate(sampled(corner)), PIXEL)[0].kind == Kind.FREE
    assert sorted(joined(corner, PIXEL).kind.tolist()) == [Kind.LINE, Kind.ARC]
    # Where the arc turns little, it is a piece of something that bends slowly.
    slow = concatenated(line, curves_of([circular_arc(CENTER, u, v, 0, math.pi / 4)]))
    assert len(joined(slow, PIXEL)) == 1


def test_lines_apart_stay_apart():
    assert len(joined(lines_between(((0, 0, 0), (0.5, 0, 0)), ((0.6, 0, 0), (1, 0, 0))), PIXEL)) == 2
    assert len(joined(lines_between(((0, 0, 0), (0.5, 0, 0)), ((0.5, 0.03, 0), (1, 0.03, 0))), PIXEL)) == 2


def test_arcs_all_around_become_a_circle():
    curves = joined(curves_of(circle_pieces(0, 110, 250, 358)), PIXEL)
    assert curves.kind.tolist() == [Kind.CIRCLE]
    on = sampled(curves, 128)
    np.testing.assert_allclose(np.linalg.norm(on - CENTER, axis=2), 0.5, rtol=1e-3)
    angle = np.sort(np.arctan2((on - CENTER) @ V, (on - CENTER) @ U).ravel())
    assert np.diff(angle).max() < 0.1


def test_small_circles_stay_and_small_arcs_close():
    # Of 4 pixels radius: four pixels along it turn it by 57 degrees.
    u, v = 0.04 * U, 0.04 * V
    halves = [circular_arc(CENTER, u, v, a, a + math.pi) for a in (0, math.pi)]
    for curves in (curves_of([whole(CENTER, u, v)]), curves_of(halves)):
        kept = joined(curves, PIXEL)
        assert kept.kind.tolist() == [Kind.CIRCLE]
        np.testing.assert_allclose(np.linalg.norm(sampled(kept) - CENTER, axis=2), 0.04, rtol=1e-3)


def test_arcs_of_half_a_circle_become_one_arc():
    curves = joined(curves_of(circle_pieces(0, 60, 110, 170)), PIXEL)
    assert curves.kind.tolist() == [Kind.ARC]
    np.testing.assert_allclose(np.linalg.norm(sampled(curves) - CENTER, axis=2), 0.5, rtol=1e-4)


def test_a_line_that_runs_into_an_arc_stays_a_line():
    bow = circle_pieces(0, 120)[0]
    tangent = bow.control[1] - bow.control[0]
    tangent /= np.linalg.norm(tangent)
    line = lines_between((bow.control[0] - tangent, bow.control[0]))
    assert sorted(joined(concatenated(line, curves_of([bow])), PIXEL).kind.tolist()) == [Kind.LINE, Kind.ARC]


def test_the_simplest_curve_is_taken():
    line = segment((0, 0, 0), (1, 0.2, 0), 50)
    assert [p.kind for p in simplest(line, PIXEL)] == [Kind.LINE]
    assert [p.kind for p in simplest(line[:2], PIXEL)] == [Kind.LINE]
    on = sampled(curves_of(circle_pieces(0, 100)))[0]
    assert [p.kind for p in simplest(on, PIXEL)] == [Kind.ARC]
    t = np.linspace(0, 1, 60)[:, None]
    wave = np.concatenate([t, 0.3 * t * (1 - t) * (2 * t - 1), 0 * t], 1)
    assert [p.kind for p in simplest(wave, PIXEL)] == [Kind.FREE]
    zigzag = np.concatenate([segment((0, 0, 0), (0.5, 0.5, 0), 30), segment((0.5, 0.5, 0), (1, 0, 0.5), 30)])
    assert simplest(zigzag, PIXEL) is None


CAMERAS = around(24, 128)
LINE = ((-0.5, 0.1, 0.0), (0.5, 0.0, 0.2))


def test_doubled_unseen_and_short_curves_go():
    views = views_of(CAMERAS, [segment(*LINE)])
    pixel = views.pixel
    part = [np.array(LINE[0]) + s * (np.array(LINE[1]) - LINE[0]) for s in (0.2, 0.6)]
    beside = np.array([0, 0.4 * pixel, 0])
    unseen = ((0.3, 0.5, 0.5), (-0.3, 0.5, 0.6))
    tiny = (np.array(LINE[0]), np.array(LINE[0]) + 0.05 * (np.array(LINE[1]) - LINE[0]))
    curves = lines_between((part[0] + beside, part[1] + beside), LINE, unseen, tiny)
    kept = pruned(curves, views, 12.0, 5.0)
    np.testing.assert_allclose(ends(kept), np.array([LINE]), rtol=0, atol=1e-5)
    # Each for its own reason.
    assert len(pruned(curves[torch.tensor([0, 2])], views, 12.0, 5.0)) == 1
    assert len(pruned(curves[torch.tensor([2])], views, 0.0, 5.0)) == 1
    assert len(pruned(curves[torch.tensor([3])], views, 0.0, 5.0)) == 0
    assert len(pruned(curves[torch.tensor([3])], views, 0.0, 2.0)) == 1
    assert len(pruned(curves[torch.zeros(4, dtype=torch.bool)], views, 0.0, 2.0)) == 0


def test_three_ends_meet_where_the_lines_do():
    # Three edges of a corner, each a pixel or two too short.
    corner = np.array([0.2, 0.3, 0.1])
    axes = turned(6)
    curves = lines_between(
        *((corner + s * PIXEL * axis, corner + 0.8 * axis) for s, axis in zip((1, 1.5, 2), axes, strict=True))
    )
    found = welded(curves, PIXEL)
    assert len(found.vertex.unique()) == 4
    assert len(found.vertex[:, 0].unique()) == 1
    # Short of the corner by the pull of their own ends.
    np.testing.assert_allclose(ends(found)[:, 0], np.tile(corner, (3, 1)), rtol=0, atol=0.15 * PIXEL)
    np.testing.assert_allclose(ends(found)[:, 1], corner + 0.8 * axes, rtol=0, atol=1e-4)
    assert torch.equal(found.moved(found.points).points[:, 0], found.moved(found.points).points[:1, 0].expand(3, 3))


def test_ends_apart_and_ends_of_one_short_curve_are_not_welded():
    apart = lines_between(((0, 0, 0), (0.5, 0, 0)), ((0.5, 5 * PIXEL, 0), (0.5, 0.5, 0)))
    assert len(welded(apart, PIXEL).vertex.unique()) == 4
    short = lines_between(((0, 0, 0), (2 * PIXEL, 0, 0)))
    assert len(welded(short, PIXEL).vertex.unique()) == 2


def test_a_circle_keeps_its_own_ends():
    touching = lines_between((CENTER + 0.5 * U, CENTER + U))
    both = concatenated(touching, curves_of([whole(CENTER, 0.5 * U, 0.5 * V)]))
    found = welded(both, PIXEL)
    assert found.kind.tolist() == [Kind.LINE, Kind.CIRCLE]
    assert len(found.vertex.unique()) == 4
    np.testing.assert_allclose(np.linalg.norm(sampled(found)[1:] - CENTER, axis=2), 0.5, rtol=1e-5)


def test_concatenated_curves_keep_their_vertices_and_circles_apart():
    circle = curves_of([whole(CENTER, U, V)])
    corner = replace(lines_between(*[LINE] * 2), vertex=torch.tensor([[0, 1], [1, 2]]))
    both = concatenated(concatenated(circle, corner), circle)
    assert both.kind.tolist() == [Kind.CIRCLE, Kind.LINE, Kind.LINE, Kind.CIRCLE]
    assert len(both.vertex[:1].unique()) == 2
    assert len(both.vertex.unique()) == 2 + 3 + 2
    assert both.vertex[1, 1] == both.vertex[2, 0]
    none = curves_of([])
    assert concatenated(none, corner).vertex.tolist() == corner.vertex.tolist()
    assert len(concatenated(corner, none)) == 2


def test_no_curves():
    assert len(joined(curves_of([]), PIXEL)) == 0
