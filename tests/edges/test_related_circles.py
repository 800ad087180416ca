"""Circles on the axes and in the planes of known ones."""

import numpy as np
import pytest
import torch
from edge_scenes import arc, around, circular_arc, ridges_along, turned, whole

from diff3ds.curves.shapes.curve_set import concatenated, curves_of
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.edges.complete.hypothesis import NARROW
from diff3ds.edges.complete.related_circles import _best, _may_be_one, with_related_circles
from diff3ds.edges.evidence.chance import Chance
from diff3ds.edges.evidence.edge_views import edge_views

CAMERAS = around(30, 128)
U, V, UP = turned(3).T
# A disk, a hole through its middle, two small holes in its top, and its other side.
DISK, HOLE = 0.5, 0.2
SMALL = {(0.36, 0.05): 0.1, (-0.2, -0.28): 0.1}
DEPTH = 0.3
KNOWN = curves_of([whole(0 * U, DISK * U, DISK * V)])


def chance_of(*circles):
    """Of views that show these circles: centre by its components along U, V and UP, and radius."""
    lines = [arc(c @ np.stack([U, V, UP]), r * U, r * V) for c, r in circles]
    return Chance.of(edge_views(CAMERAS, ridges_along(CAMERAS, lines)), NARROW)


TOP = np.zeros(3), DISK
STEP = np.array([0, 0, -0.2]), HOLE
BOTTOM = np.array([0, 0, -DEPTH]), DISK
HOLES = [(np.array([*place, 0.0]), radius) for place, radius in SMALL.items()]


@pytest.mark.parametrize("there", [[BOTTOM], pytest.param([STEP, *HOLES], marks=pytest.mark.slow)])
def test_circles_on_the_axis_and_in_the_plane_of_a_known_one_are_found(there):
    found = list(with_related_circles(KNOWN, chance_of(TOP, *there), 0.0).circles.values())
    assert len(found) == 1 + len(there)
    for center, radius in there:
        off = [np.linalg.norm(c.center - center @ np.stack([U, V, UP])) + abs(c.radius - radius) for c in found]
        assert min(off) < 0.006


@pytest.mark.slow
def test_the_other_side_has_the_radius_of_the_known_one():
    found = list(with_related_circles(KNOWN, chance_of(TOP, (BOTTOM[0], 0.998 * DISK)), 0.0).circles.values())
    assert found[1].radius == pytest.approx(found[0].radius, abs=1e-6)
    found = list(with_related_circles(KNOWN, chance_of(TOP, (BOTTOM[0], 0.9 * DISK)), 0.0).circles.values())
    assert found[1].radius == pytest.approx(0.9 * DISK, abs=0.005)


def test_what_may_be_a_better_circle_is_left_out_as_pair_by_pair():
    generator, pixel = np.random.default_rng(0), 0.004
    score, center, radius = generator.random(300), generator.random((300, 3)) / 10, 0.1 + generator.random(300) / 20
    start = next(iter(KNOWN.circles.values()))
    kept = []
    for row in np.argsort(-score):
        one = start._replace(center=center[row], radius=float(radius[row]))
        if not any(_may_be_one(one, other, pixel) for other in kept):
            kept.append(one)
    found = _best([(score[:100], center[:100], radius[:100]), (score[100:], center[100:], radius[100:])], start, pixel)
    assert 20 < len(found) < 280
    assert [c.radius for c in found] == [c.radius for c in kept]


def test_of_a_circle_outside_of_what_is_looked_at_nothing_is_asked():
    off = curves_of([whole(1.05 * U, 0.1 * U, 0.1 * V)])
    assert with_related_circles(off, chance_of(TOP), 0.0) is off


@pytest.mark.slow
def test_where_views_show_nothing_else_curves_stay():
    assert with_related_circles(KNOWN, chance_of(TOP), 0.0) is KNOWN
    # Half a circle is none, and what stands on another axis is not looked for.
    half = arc(0 * U - DEPTH * UP, HOLE * U, HOLE * V, 0, np.pi)
    tilted = arc(0.2 * U - 0.3 * UP, 0.1 * U, 0.1 * UP)
    views = edge_views(CAMERAS, ridges_along(CAMERAS, [arc(0 * U, DISK * U, DISK * V), half, tilted]))
    assert with_related_circles(KNOWN, Chance.of(views, NARROW), 0.0) is KNOWN
    none = KNOWN[torch.tensor([False])]
    assert with_related_circles(none, Chance.of(views, NARROW), 0.0) is none


@pytest.mark.slow
def test_pieces_along_a_circle_that_is_found_go():
    piece = curves_of([circular_arc(-0.2 * UP, HOLE * U, HOLE * V, 0, 1.0)])
    found = with_related_circles(concatenated(KNOWN, piece), chance_of(TOP, STEP), 0.0)
    assert found.kind.tolist() == [Kind.CIRCLE, Kind.CIRCLE]
