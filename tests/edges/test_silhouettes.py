"""Edges told from outlines of smooth surfaces, whose place depends on the view."""

import math

import numpy as np
import pytest
import torch
from edge_scenes import arc, around, lines_between, ridges_along, segment, whole

from diff3ds.curves.shapes.curve_set import curves_of
from diff3ds.edges.clean.silhouettes import smooth_outlines
from diff3ds.edges.evidence.edge_views import edge_views

# A sector of directions, as a corner of an object that hides what is behind it leaves them.
CAMERAS = around(60, 128)
AXIS = np.array([0.0, 0.0, 1.0])


def outlines(radius, cameras, height=0.5):
    """The two outlines of an upright cylinder in every view: lines where the line of sight touches it."""
    found = []
    for x, y, _ in cameras.centers.double().numpy():
        away, direction = math.hypot(x, y), math.atan2(y, x)
        turn = math.acos(radius / away)
        feet = [radius * np.array([math.cos(direction + s * turn), math.sin(direction + s * turn), 0]) for s in (1, -1)]
        found.append([segment(foot - height * AXIS, foot + height * AXIS) for foot in feet])
    return found


def facing(direction, most):
    """The cameras within an angle, degrees, of a direction around the axis."""
    x, y, _ = CAMERAS.centers.double().numpy().T
    angle = (np.degrees(np.arctan2(y, x)) - direction + 180) % 360 - 180
    return CAMERAS[torch.from_numpy(np.nonzero(np.abs(angle) < most)[0])]


def side(radius):
    """The line of the cylinder that is its left outline seen from the direction 0, far away."""
    return (np.array([0, radius, -0.4]), np.array([0, radius, 0.4]))


@pytest.mark.parametrize("radius", [0.15, 0.25, 0.4])
def test_the_outline_of_a_cylinder_is_none_of_its_edges(radius):
    # Over this range the outline wanders by more than a pixel, and less than what still passes for one curve.
    cameras = facing(0, 35)
    assert len(cameras) >= 10
    views = edge_views(cameras, ridges_along(cameras, outlines(radius, cameras)))
    assert smooth_outlines(views, lines_between(side(radius))).tolist() == [True]
    assert smooth_outlines(views, lines_between(side(radius)), doubt=True).tolist() == [True]


@pytest.mark.parametrize("most", [181, 80, 20])
def test_an_edge_in_the_same_place_is_an_edge(most):
    ends = side(0.25)
    cameras = facing(0, most)
    views = edge_views(cameras, ridges_along(cameras, [segment(*ends)]))
    assert smooth_outlines(views, lines_between(ends)).tolist() == [False]
    assert smooth_outlines(views, lines_between(ends), doubt=True).tolist() == [False]


def test_rims_of_a_cylinder_are_edges_and_its_outline_is_not():
    radius, height = 0.3, 0.5
    cameras = facing(0, 40)
    rims = [arc((0, 0, z), (radius, 0, 0), (0, radius, 0)) for z in (-height, height)]
    lines = [[*own, *rims] for own in outlines(radius, cameras, height)]
    views = edge_views(cameras, ridges_along(cameras, lines))
    straight = lines_between(side(radius))
    rim = curves_of([whole((0, 0, height), (radius, 0, 0), (0, radius, 0))])
    assert smooth_outlines(views, rim).tolist() == [False]
    assert smooth_outlines(views, straight).tolist() == [True]


def test_in_doubt_what_no_view_shows_is_an_outline():
    views = edge_views(CAMERAS, ridges_along(CAMERAS, [segment((0.5, 0.5, 0), (0.5, 0.6, 0))]))
    unseen = lines_between(((-0.5, -0.5, 0), (-0.5, 0.5, 0.3)))
    assert smooth_outlines(views, unseen).tolist() == [False]
    assert smooth_outlines(views, unseen, doubt=True).tolist() == [True]


def test_no_curves():
    views = edge_views(CAMERAS, ridges_along(CAMERAS, [segment((0.5, 0.5, 0), (0.5, 0.6, 0))]))
    assert smooth_outlines(views, lines_between(((0, 0, 0), (0, 0, 1)))[torch.tensor([False])]).tolist() == []
