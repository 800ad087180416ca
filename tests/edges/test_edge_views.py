"""Lookup of ridges against the cameras' own projection and brute force."""

import numpy as np
import pytest
import torch
from edge_scenes import around, ridges_along, segment
from scipy.spatial.distance import cdist

import diff3ds as ds
from diff3ds.edges.evidence.edge_views import OUTSIDE, edge_views
from diff3ds.edges.evidence.ridges import Ridges

CAMERAS = around(5, (64, 80))
LINES = [segment((-0.8, -0.5, 0.3), (0.7, 0.6, -0.4)), segment((0.2, -0.8, -0.6), (-0.3, 0.4, 0.8))]
RIDGES = ridges_along(CAMERAS, LINES)
VIEWS = edge_views(CAMERAS, RIDGES)


def test_projection_is_that_of_the_cameras():
    x = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
    homogeneous = torch.cat([torch.from_numpy(x), torch.ones(20, 1)], 1) @ CAMERAS.projection.mT
    pixel, depth = VIEWS.project(x)
    np.testing.assert_allclose(pixel, (homogeneous[..., :2] / homogeneous[..., 2:3]).numpy(), rtol=0, atol=1e-9)
    np.testing.assert_allclose(depth, homogeneous[..., 2].numpy(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(VIEWS.centers, CAMERAS.centers.numpy(), rtol=0, atol=1e-12)


def test_focal_length_and_the_size_of_a_pixel():
    np.testing.assert_allclose(VIEWS.focal, CAMERAS.intrinsics[:, 0, 0].numpy(), rtol=1e-6)
    assert VIEWS.pixel == pytest.approx(3.0 / float(CAMERAS.intrinsics[0, 0, 0]), rel=1e-6)
    assert len(VIEWS) == 5
    assert np.diff(VIEWS.start).tolist() == [len(r) for r in RIDGES]


def test_planes_hold_the_camera_and_the_ridge():
    view = np.repeat(np.arange(5), [len(r) for r in RIDGES])
    planes = VIEWS.planes
    np.testing.assert_allclose(np.linalg.norm(planes[:, :3], axis=1), 1, rtol=0, atol=1e-12)
    centers = (planes[:, :3] * VIEWS.centers[view]).sum(1) + planes[:, 3]
    np.testing.assert_allclose(centers, 0, rtol=0, atol=1e-6)
    # These ridges are images of two lines, so that each plane holds one of them.
    ends = np.stack([line[[0, -1]] for line in LINES])
    away = np.abs(np.einsum("lek,rk->lre", ends, planes[:, :3]) + planes[:, 3, None]).max(2).min(0)
    assert away.max() < 1e-6


def test_matches_are_the_nearest_ridges():
    # The ridge nearest to the centre of the point's pixel: at most a pixel's diagonal farther than the nearest of all.
    x = np.random.default_rng(1).uniform(-0.8, 0.8, (200, 3))
    match = VIEWS.match(x)
    for view, ridges in enumerate(RIDGES):
        own = match.ridge[view] - VIEWS.start[view]
        distance = cdist(match.pixel[view], ridges.points)
        inside = match.distance[view] < OUTSIDE
        assert inside.sum() > 100
        assert (own[inside] >= 0).all()
        assert (own[inside] < len(ridges)).all()
        there = distance[np.arange(len(x)), own.clip(0)]
        np.testing.assert_allclose(match.distance[view][inside], there[inside], rtol=0, atol=1e-12)
        assert (there - distance.min(1))[inside].max() < 1.5
    on = VIEWS.match(np.concatenate(LINES))
    assert on.distance[on.distance < OUTSIDE].max() < 1.5


def test_views_do_not_match_what_they_do_not_contain():
    match = VIEWS.match(np.array([[0.0, 0, 50], 2 * CAMERAS.centers[0].numpy(), [0.0, 0, 0]]))
    assert match.distance[0, 1] == OUTSIDE
    assert (match.distance[:, 2] < OUTSIDE).all()
    pixel, depth = match.pixel[:, 0], match.depth[:, 0]
    inside = (depth > 0) & (pixel > 0).all(1) & (pixel[:, 0] < 80) & (pixel[:, 1] < 64)
    assert ((match.distance[:, 0] < OUTSIDE) == inside).all()


def test_a_view_without_ridges_matches_nothing():
    empty = Ridges.sharp(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    match = edge_views(CAMERAS, [*RIDGES[:4], empty]).match(np.zeros((1, 3)))
    assert (match.distance[:4] < OUTSIDE).all()
    assert match.distance[4, 0] == OUTSIDE
    alone = edge_views(CAMERAS, [empty] * 5).match(np.zeros((1, 3)))
    assert (alone.distance == OUTSIDE).all()


def test_oblong_pixels():
    scale = torch.tensor([2.0, 1.0, 1.0])[:, None]
    wide = ds.Cameras(CAMERAS.world_to_camera, CAMERAS.intrinsics * scale, (64, 160))
    views = edge_views(wide, ridges_along(wide, LINES))
    np.testing.assert_allclose(views.focal, wide.intrinsics[:, 0, 0].numpy(), rtol=1e-6)


def test_orthographic_cameras_are_refused():
    flat = ds.Cameras(CAMERAS.world_to_camera, CAMERAS.intrinsics, CAMERAS.size, orthographic=True)
    with pytest.raises(ValueError, match="edges are reconstructed from views with perspective, and these are ortho"):
        edge_views(flat, RIDGES)
