"""Curves that are there stay, and those that chance has made of others' ridges go."""

import numpy as np
import pytest
import torch
from edge_scenes import around, box_edges, box_shown, lines_between, ridges_along, segment, turned, views_of

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import concatenated, curves_of
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.edges.clean.spurious import without_spurious
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import map_ridges
from diff3ds.edges.reconstruct import reconstruct
from diff3ds.library import member

CAMERAS = around(24, 128)
HALF, ROTATION = np.array([0.5, 0.4, 0.6]), turned()
BOX = box_edges(HALF, ROTATION)
CURVES = lines_between(*((line[0], line[-1]) for line in BOX))


def test_all_edges_of_a_box_stay_where_each_hides_others():
    shown, _ = box_shown(CAMERAS, HALF, ROTATION)
    views = views_of(CAMERAS, BOX, shown)
    assert torch.equal(without_spurious(CURVES, views).points, CURVES.points)


def test_of_a_curve_found_twice_one_stays():
    """Shown by half of the views, each lies on the ridges of the other."""
    first, second = BOX[0], BOX[5]
    chord = segment(first[60], second[140])
    shown = np.arange(len(CAMERAS)) % 2 == 0
    ridges = [[*BOX, chord, chord] if s else BOX for s in shown]
    views = edge_views(CAMERAS, ridges_along(CAMERAS, ridges))
    spurious = lines_between((chord[0], chord[-1]))
    # As long as nothing else is there, these ridges are its own.
    assert len(without_spurious(concatenated(CURVES, spurious), views)) == 13
    double = lines_between((chord[0], chord[-1] + 0.004))
    assert len(without_spurious(concatenated(concatenated(CURVES, spurious), double), views)) == 13


def test_sides_that_the_cameras_see_in_one_line_stay():
    """All ridges of a square in the plane of the cameras belong to two of its sides."""
    corners = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]
    ends = [(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    eye = torch.tensor([[3.0, 0.2 * k, 0.002 * k] for k in range(-8, 9)] + [[0.3, 0.2, 3.0], [0.0, -0.2, 3.0]])
    cameras = ds.look_at(eye, fov=45, size=128)
    sides = lines_between(*ends)
    views = edge_views(cameras, ridges_along(cameras, [segment(*pair) for pair in ends]))
    assert torch.equal(without_spurious(sides, views).points, sides.points)


@pytest.mark.slow
def test_cameras_in_rings_bring_no_curves_about():
    """Two rings, as of a turntable, around a lamp: chance draws chords across its shade, which is open at the top."""
    truth = member("lamp", torch.Generator().manual_seed(0)).sketch
    cameras = ds.orbit(
        [15.0 * i for i in range(24)], [15.0 if i % 2 else 35.0 for i in range(24)], 3.0, fov=40, size=200
    )
    drawing = ds.render(ds.Sketch(truth.points, truth.weights, width=0.008), cameras).alpha
    found = sketch_of(reconstruct(cameras, [map_ridges(ink.numpy()) for ink in drawing]).curves, 0.01)
    points = ds.bezier.evaluate(found.points, found.weights, torch.linspace(0, 1, 21)).reshape(1, -1, 3)
    points = points.expand(len(truth), -1, 3)
    off = ds.bezier.closest_point(truth.points, truth.weights, points).distance.amin(0).reshape(-1, 21)
    # Without, there are 16 curves too many, 14 of them beside the truth.
    assert ((off < 0.02).float().mean(1) < 0.7).sum() <= 2
    assert len(found.points) <= len(truth) + 4


def test_no_curves_are_none():
    views = views_of(CAMERAS, BOX)
    assert len(without_spurious(curves_of([]), views)) == 0
