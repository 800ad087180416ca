"""Coarse meshes made smooth: known radii, corners and flat faces that stay, edges that fit together."""

import numpy as np
import pytest
import torch
from solids import icosphere, torus

import diff3ds as ds
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.page.picture import Picture
from diff3ds.surfaces.hidden.mesh_view import MeshView
from diff3ds.surfaces.lines.feature_curves import feature_curves
from diff3ds.surfaces.shape import smooth_surface as module


def prism(sides: int, height: float = 2.0) -> ds.TriangleMesh:
    """A closed prism around z, its corners on the unit circle."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angle), np.sin(angle)], 1)
    points = np.concatenate([np.c_[rim, np.full(sides, z)] for z in (0, height)] + [[[0, 0, 0], [0, 0, height]]])
    i, j = np.arange(sides), np.roll(np.arange(sides), -1)
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    sides_ = [(i, j, j + sides), (i, j + sides, i + sides), (low, j, i), (high, i + sides, j + sides)]
    return ds.TriangleMesh(points, np.concatenate([np.stack(t, 1) for t in sides_]))


@pytest.mark.parametrize("level", [1, *(pytest.param(level, marks=pytest.mark.slow) for level in (2, 3))])
def test_a_sphere_becomes_rounder(level: int) -> None:
    coarse = ds.TriangleMesh(*icosphere(level))
    smooth = ds.smooth_surface(coarse, 1e-4)

    def off(mesh: ds.TriangleMesh) -> float:
        return float(np.abs(np.linalg.norm(mesh.vertices[mesh.faces].mean(1), axis=1) - 1).max())

    assert off(smooth) < off(coarse) / 4
    assert off(smooth) < 3e-3
    assert smooth.is_closed


def test_a_torus_becomes_rounder() -> None:
    coarse = ds.TriangleMesh(*torus(1.0, 0.4, 16, 10))
    smooth = ds.smooth_surface(coarse, 1e-3)

    def off(mesh: ds.TriangleMesh) -> float:
        x, y, z = mesh.vertices[mesh.faces].mean(1).T
        return float(np.abs(np.hypot(np.hypot(x, y) - 1, z) - 0.4).max())

    assert off(smooth) < off(coarse) / 8
    assert smooth.is_closed
    assert not smooth.is_crease.any()


def test_the_first_middles_lie_on_the_sphere() -> None:
    # An icosahedron's normals are exact, and an arc between tangents of a circle is the circle.
    smooth = ds.smooth_surface(ds.TriangleMesh(*icosphere(0), crease=90.0), 0.1)
    assert len(smooth) == 80
    np.testing.assert_allclose(np.linalg.norm(smooth.vertices, axis=1), 1, atol=1e-12)


@pytest.mark.parametrize("sides", [10, 12, 24])
def test_rims_of_cylinders_become_circles(sides: int) -> None:
    mesh = prism(sides)
    smooth = ds.smooth_surface(mesh, 1e-3)
    crease = np.unique(smooth.edges[smooth.is_crease])
    np.testing.assert_allclose(np.linalg.norm(smooth.vertices[crease, :2], axis=1), 1, atol=1e-12)
    assert len(crease) > 2 * sides
    # Caps stay flat, and the round side is nearer to its cylinder than flat sides are.
    assert set(np.round(smooth.vertices[crease, 2], 12)) == {0.0, 2.0}
    side = smooth.vertices[(smooth.vertices[:, 2] > 1e-9) & (smooth.vertices[:, 2] < 2 - 1e-9)]
    assert len(side)
    assert np.abs(np.linalg.norm(side[:, :2], axis=1) - 1).max() < (1 - np.cos(np.pi / sides)) / 2
    assert smooth.is_closed


@pytest.mark.parametrize("sides", [3, 4, 9])
def test_what_has_flat_faces_stays_as_it_is(sides: int) -> None:
    mesh = prism(sides)
    assert ds.smooth_surface(mesh, 1e-6) is mesh


def bevelled_box(bevel: float) -> ds.TriangleMesh:
    """A cube with bevelled edges, whose corners have become small triangles that lead from one bevel to the next."""
    from itertools import permutations, product

    from scipy.spatial import ConvexHull

    sides = set(permutations((1.0, 1 - bevel, 1 - bevel)))
    points = np.array([np.multiply(side, sign) for side in sorted(sides) for sign in product((1, -1), repeat=3)])
    hull = ConvexHull(points)
    a, b, c = points[hull.simplices].transpose(1, 0, 2)
    inwards = np.einsum("fi,fi->f", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    return ds.TriangleMesh(points, np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices))


def test_bevels_that_meet_at_a_small_corner_stay_flat() -> None:
    # Corner and bevel meet at 35.3 degrees, which is no crease, and bevels at 60.
    box = bevelled_box(0.02)
    smooth = ds.smooth_surface(box, 1e-4)
    np.testing.assert_array_equal(smooth.vertices, box.vertices)
    np.testing.assert_allclose(box.corner_normals, np.repeat(box.face_normals[:, None], 3, 1), atol=1e-9)


def test_corners_as_large_as_what_they_join_are_round() -> None:
    assert len(ds.smooth_surface(bevelled_box(0.5), 1e-4)) > len(bevelled_box(0.5))


def test_the_border_of_an_open_cylinder_becomes_round() -> None:
    mesh = prism(12)
    ends = np.isin(mesh.faces, [24, 25]).any(1)
    smooth = ds.smooth_surface(ds.TriangleMesh(mesh.vertices, mesh.faces[~ends]), 1e-3)
    border = np.unique(smooth.edges[smooth.is_border])
    assert len(border) > 24
    np.testing.assert_allclose(np.linalg.norm(smooth.vertices[border, :2], axis=1), 1, atol=1e-12)


def test_circles_of_a_coarse_cylinder_are_hidden_in_one_piece() -> None:
    mesh = prism(12)
    circles = sketch_of(feature_curves(mesh).curves, 0.02).to(torch.float64)
    assert len(circles) == 2
    cameras = ds.orbit(azimuth=10, elevation=30, distance=8, size=256).to(torch.float64)
    (lines,) = ds.visible_lines(circles, cameras, ds.smooth_surface(mesh, 1e-3))
    # The upper circle is seen, half of the lower one is, and two lines are the contours.
    assert len(lines.strokes(True)) == 4
    assert len(lines.strokes(False)) == 1


def test_no_more_faces_are_made_than_are_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = ds.TriangleMesh(*icosphere(2))
    monkeypatch.setattr(module, "MOST_FACES", 4 * len(mesh))
    assert len(ds.smooth_surface(mesh, 1e-6)) == 4 * len(mesh)
    monkeypatch.setattr(module, "MOST_FACES", 4 * len(mesh) - 1)
    assert ds.smooth_surface(mesh, 1e-6) is mesh


def test_patches_that_meet_at_the_contour_do_not_hide_it_from_each_other():
    """What lies a few degrees behind the outline of a sphere is hidden by the next patches, which do not count."""
    smooth = ds.smooth_surface(ds.TriangleMesh(*icosphere(2)), 1e-4)
    cameras = ds.orbit(30, 20, 3.0, height=2.2, fov=None, size=256).to(torch.float64)
    picture = Picture.of(cameras, 0)
    # Orthographic: behind the outline are the places whose normals point away.
    behind = np.degrees(np.arcsin((-smooth.vertices @ picture.towards(smooth.vertices)[0]).clip(-1, 1)))
    rows = np.arange(len(smooth.vertices))
    own = np.stack([rows] * 3, 1)
    hidden = MeshView(smooth, picture).in_front(smooth.vertices, own, 2)
    near, far = (behind > 4) & (behind < 6), behind > 45
    assert near.sum() > 20
    assert not hidden[near].any()
    assert hidden[far].all()


def test_only_a_mesh_is_made_smooth(unchecked):
    with pytest.raises(TypeError, match="mesh must be a TriangleMesh, got Quadrics"):
        ds.smooth_surface(ds.Quadrics.ellipsoids([[0.0, 0.0, 0.0]], [[1.0, 1.0, 1.0]]), 0.1)
    with pytest.raises(ValueError, match="tolerance must be a positive length, got True"):
        ds.smooth_surface(prism(12), True)


@pytest.mark.parametrize("tolerance", [0, -1.0, float("nan")])
def test_a_tolerance_is_a_length(tolerance: float) -> None:
    with pytest.raises(ValueError, match="tolerance must be a positive length"):
        ds.smooth_surface(prism(12), tolerance)
