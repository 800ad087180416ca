"""Radial distortion that pictures still have: what it does to ridges, and that views tell it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from edge_scenes import lines_between, ridges_along, segment
from test_refined_cameras import moved

import diff3ds as ds
from diff3ds.distortion import Distortion
from diff3ds.edges.cameras.adjust import adjusted
from diff3ds.edges.cameras.coarse_to_fine import LEAST_GAIN, is_bent, refined_cameras
from diff3ds.edges.cameras.lens_effect import Bending, LensEffect, bending
from diff3ds.edges.cameras.posed import Posed
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges

MATRIX = np.array([[300.0, 0, 130], [0, 290, 120], [0, 0, 1]])
SIZE = (240, 260)
POINTS = np.array([[130.0, 120.0], [10.0, 20.0], [250.0, 60.0], [90.0, 230.0]])
CORNERS = 0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
ENDS = [(a, b) for i, a in enumerate(CORNERS) for b in CORNERS[i + 1 :] if (a != b).sum() == 1]
ENDS += [((-0.5, -0.2, 0.5), (0.2, -0.5, 0.5)), ((0.5, 0.1, -0.3), (0.5, -0.4, 0.2))]


def taken(points, matrix, lens):
    """Where a lens shows what a pinhole shows there, pixels: our own formulas."""
    x, y = ((points - matrix[:2, 2]) / matrix[[0, 1], [0, 1]]).T
    seen = np.stack([v.numpy() for v in lens.bent(torch.from_numpy(x), torch.from_numpy(y))], 1)
    return seen * matrix[[0, 1], [0, 1]] + matrix[:2, 2]


@pytest.mark.parametrize("lens", [Distortion(), Distortion((-0.1, 0.02), (0.01, 0.0))])
def test_the_picture_as_taken_stays(lens):
    """What another k1, and another focal length, make of a straight picture shows the same as before to the lens."""
    now = MATRIX * np.array([1.1, 1.1, 1.0])
    found, there = Bending(lens, MATRIX, now).moved(POINTS, -0.05)
    assert there.all()
    np.testing.assert_allclose(taken(found, now, lens.with_more_k1(-0.05)), taken(POINTS, MATRIX, lens), atol=1e-8)
    np.testing.assert_allclose(Bending(lens, MATRIX, MATRIX).moved(POINTS, 0.0)[0], POINTS, atol=1e-8)


def test_bends_are_how_points_move():
    straight = Bending(Distortion((0.05,)), MATRIX, MATRIX)
    here, ahead = (straight.moved(POINTS, k1)[0] for k1 in (-0.03, -0.029))
    np.testing.assert_allclose(0.001 * straight.bends(here, -0.03), ahead - here, atol=1e-3)
    assert np.abs(ahead - here).max() > 0.02


def test_bent_lines_become_straight():
    """And their normals, too, but for what no such lens shows."""
    lens = Distortion((-0.4,))
    line = np.stack([np.full(201, 215.0), np.linspace(0, 240, 201)], 1)
    there = taken(line, MATRIX, lens)
    steps = np.gradient(there, axis=0)
    normals = np.stack([steps[:, 1], -steps[:, 0]], 1) / np.linalg.norm(steps, axis=1, keepdims=True)
    found = Bending(Distortion(), MATRIX, MATRIX).ridges(Ridges.sharp(there, normals, np.ones(201)), -0.4, SIZE)
    assert len(found) > 190
    np.testing.assert_allclose(found.points[:, 0], 215.0, atol=1e-6)
    # Those bent lines are off by up to 7 degrees; the ends of the polyline have normals of one side.
    np.testing.assert_allclose(found.normals[1:-1], [[1.0, 0.0]] * (len(found) - 2), atol=2e-3)
    assert np.abs(normals[:, 1]).max() > 0.1
    # A lens with this k1 shows nothing farther from its middle than 2/3 of sqrt(1/6).
    far = Ridges.sharp(np.array([[130.0, 120.0], [250.0, 120.0]]), np.array([[1.0, 0.0]] * 2), np.ones(2))
    assert len(Bending(Distortion(), MATRIX, MATRIX).ridges(far, -2.0, SIZE)) == 1


def test_corners_move_as_the_formula_says():
    focal = np.diag([300.0, 300.0, 1.0])
    focal[:2, 2] = 120, 160
    corners = Bending(Distortion(), focal, focal).at_corners((320, 240), 0.06)
    r = (200 - corners) / 300
    assert r + 0.06 * r**3 == pytest.approx(200 / 300, abs=1e-6)


@pytest.fixture(scope="module")
def scene():
    """Cameras all around a box that fills their pictures, and its edges as they show them."""
    i = torch.arange(16) + 0.5
    cameras = ds.orbit(137.508 * i, torch.rad2deg(torch.asin(1 - i / 8)), 2.0, fov=60, size=240)
    return cameras, ridges_along(cameras, [segment(*ends) for ends in ENDS])


def through(cameras, ridges, k1):
    """The ridges of a lens."""
    lens = bending(cameras, cameras, Distortion((k1,)))
    return [lens.ridges(r, -k1, cameras.size) for r in ridges]


@pytest.mark.parametrize(
    "k1", [-0.05, pytest.param(0.02, marks=pytest.mark.slow), pytest.param(0.0, marks=pytest.mark.slow)]
)
def test_views_tell_distortion(scene, k1):
    cameras, straight = scene
    ridges = through(cameras, straight, k1)
    views = edge_views(cameras, ridges)
    bends = np.concatenate([bending(cameras, cameras, Distortion()).bends(r.points, 0.0) for r in ridges])
    effect = LensEffect(np.zeros(len(views.points)), bends)
    start = Posed.of(moved(cameras, 0.05, 0.003))
    found, gain = adjusted(start, start, views, effect, lines_between(*ENDS))
    assert found.lens[2] == pytest.approx(k1, abs=0.004)
    assert (gain > LEAST_GAIN) == (k1 != 0)
    # Of a lens that is known nothing is changed.
    fixed, _ = adjusted(start, start, views, LensEffect.fixed(effect.sides), lines_between(*ENDS))
    assert fixed.lens[2] == 0


@pytest.mark.slow
@pytest.mark.parametrize("k1", [-0.05, 0.02, 0.0])
def test_distortion_is_refined_with_poses(scene, k1):
    cameras, straight = scene
    ridges = through(cameras, straight, k1)
    wrong = moved(cameras, 0.2, 0.01)
    found = refined_cameras(wrong, ridges, lens=Distortion())
    assert found.k1 == pytest.approx(k1, abs=0.005)
    assert bool(found.k1) == bool(k1)
    if not k1:
        # Nothing is harmed by having looked for it.
        assert torch.equal(found.world_to_camera, refined_cameras(wrong, ridges).world_to_camera)


def test_distortion_is_there_where_it_is_sure_and_seen(scene):
    cameras, lens = scene[0], Distortion()
    found = Posed.of(cameras)
    for k1, gain, there in ((-0.05, 0.1, True), (-0.05, 0.001, False), (0.002, 0.1, False)):
        assert is_bent(cameras, replace(found, lens=np.array([0.0, 0.0, k1])), lens, gain) == there


@pytest.mark.slow
def test_distortion_of_several_lenses_stays(scene):
    cameras, straight = scene
    found = refined_cameras(cameras, through(cameras, straight, -0.05))
    assert found.k1 == 0
