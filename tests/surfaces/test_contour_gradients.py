"""Gradients of a mesh's contours to its vertices and the camera: closed forms of a sphere, and differences."""

import numpy as np
import pytest
import torch
from solids import box, icosphere, torus

import diff3ds as ds

BALL = icosphere(3)
NOTHING = ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64))


def radius(vertices, cameras):
    """The mean distance of the contour from the middle of the picture, pixels."""
    (sketch,) = ds.contours(ds.TriangleMesh(vertices, BALL[1]), cameras, tolerance=0.01)
    points = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 9, dtype=torch.float64))
    ones = torch.ones_like(points[..., :1])
    seen = cameras.seen(torch.cat([points, ones], -1) @ cameras.projection[0].mT)[0]
    return (seen - 256).norm(dim=-1).mean()


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_growing_sphere_and_a_camera_that_comes_nearer(orthographic):
    """From distance d a sphere of radius R is seen with f R / sqrt(d² - R²), without perspective with f R."""
    ball = torch.from_numpy(BALL[0])
    size = torch.tensor(1.0, dtype=torch.float64, requires_grad=True)
    away = torch.tensor(0.0, dtype=torch.float64, requires_grad=True)
    how = {"height": 3.2} if orthographic else {"fov": 45.0}
    cameras = ds.orbit(25.0, 35.0, 4.0, size=512, **how).to(torch.float64)
    pose = cameras.world_to_camera.clone()
    pose[:, 2, 3] = pose[:, 2, 3] + away
    moved = ds.Cameras(pose, cameras.intrinsics, cameras.size, orthographic=cameras.orthographic)
    f = cameras.intrinsics[0, 0, 0]
    seen = radius(size * ball, moved)
    d_size, d_away = torch.autograd.grad(seen, (size, away), allow_unused=True)
    wanted = (f, 0.0) if orthographic else (16 * f / 15**1.5, -4 * f / 15**1.5)
    assert float(d_size) == pytest.approx(float(wanted[0]), rel=4e-3)
    assert float(d_away) == pytest.approx(float(wanted[1]), rel=4e-3, abs=1e-9)
    # The values are those of strokes without gradients, to rounding.
    with torch.no_grad():
        assert float(seen) == pytest.approx(float(radius(ball, cameras)), abs=1e-9)


def test_what_slides_along_the_surface_moves_nothing():
    """A turned ball looks as before."""
    angle = torch.tensor(0.0, dtype=torch.float64, requires_grad=True)
    x, y, z = torch.from_numpy(BALL[0]).unbind(1)
    turned = torch.stack([x * angle.cos() - z * angle.sin(), y, x * angle.sin() + z * angle.cos()], 1)
    cameras = ds.orbit(25.0, 35.0, 4.0, size=512).to(torch.float64)
    (gradient,) = torch.autograd.grad(radius(turned, cameras), angle)
    # Growing by as much as a turn moves points gives some hundred.
    assert abs(float(gradient)) < 0.1


@pytest.mark.parametrize("orthographic", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_gradients_of_a_picture_agree_with_differences(orthographic):
    """A torus that is bent, hidden parts and cusps too; blurred and fitted closely: differences mean something."""
    vertices, faces = torus(1.0, 0.4, 96, 48)
    x, y, z = torch.from_numpy(vertices).unbind(1)
    how = {"height": 3.2} if orthographic else {"fov": 45.0}
    cameras = ds.orbit(20.0, 50.0, 4.0, size=40, **how).to(torch.float64)
    ramp = torch.linspace(0, 1, 40, dtype=torch.float64)

    def loss(bend):
        moved = torch.stack([x + bend[0] * x**2, y + bend[1] * x * y, z + bend[2] * z], 1)
        mesh = ds.TriangleMesh(moved, faces)
        (sketch,) = ds.contours(mesh, cameras, tolerance=0.005)
        drawn = ds.render(sketch, cameras, antialiasing=ds.Analytic(blur=3.0))
        return (drawn.alpha[0] * (ramp[:, None] + 2 * ramp**2)).sum()

    bend = torch.tensor([0.1, -0.1, 0.2], dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(loss(bend), bend)
    with torch.no_grad():
        found = [float(loss(bend + step) - loss(bend - step)) / 0.04 for step in 0.02 * torch.eye(3).double()]
    assert gradient.tolist() == pytest.approx(found, rel=0.03, abs=0.03 * max(map(abs, found)))


def test_creases_have_gradients_and_soup_gives_them_to_the_first_of_its_corners():
    corners, faces = box()
    soup = torch.from_numpy(corners[faces].reshape(-1, 3)).requires_grad_()
    mesh = ds.TriangleMesh(soup, np.arange(len(soup)).reshape(-1, 3))
    cameras = ds.orbit(25.0, 35.0, 4.0).to(torch.float64)
    (sketch,) = ds.contours(mesh, cameras)
    length = ds.bezier.length(sketch.points, sketch.weights).sum()
    (gradient,) = torch.autograd.grad(length, soup)
    used = gradient.abs().sum(1) > 1e-9
    # And through the renderer.
    (drawn,) = torch.autograd.grad(ds.render(NOTHING, cameras, surface=mesh).alpha.sum(), soup)
    assert ((drawn.abs().sum(1) > 1e-9) == used).all()
    # Six of the eight corners are on the outline.
    assert int(used.sum()) == 6
    first = [min(np.flatnonzero((soup.detach().numpy() == corner).all(1))) for corner in corners]
    assert set(np.flatnonzero(used.numpy())) <= set(first)
    assert ds.TriangleMesh(corners, faces).points.requires_grad is False
    assert not ds.contours(ds.TriangleMesh(corners, faces), cameras)[0].points.requires_grad
