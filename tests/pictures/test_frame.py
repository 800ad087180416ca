"""The frame of a fit: found from what the views show, and exact both ways."""

import pytest
import torch

import diff3ds as ds
from diff3ds.pictures.frame import Frame, frame_of
from diff3ds.pictures.store import Store, store_of


def ball(center, radius):
    """Strokes over a ball: circles around its three axes."""
    axes = torch.eye(3).tolist()
    return ds.Sketch.concatenate(
        [ds.Sketch(*ds.bezier.circle(center, radius, axis, dtype=torch.float32)) for axis in axes]
    )


@pytest.mark.parametrize(
    ("center", "radius"), [((0.0, 0.0, 0.0), 1.0), ((5.0, -2.0, 3.0), 0.2), ((0.0, 90.0, 0.0), 40.0)]
)
@pytest.mark.parametrize("height", [None, 3.5])
def test_finds_the_ball_that_is_seen(center, radius, height):
    lens = {} if height is None else {"height": height * radius}
    # Not in the middle of the pictures: of the orthographic ones it is the rays that move aside.
    aside = [c + 0.3 * radius for c in center]
    cameras = ds.orbit([0, 70, 140, 210, 280], [-20, 10, 40, 60, 0], 4 * radius, size=200, target=aside, **lens)
    frame = frame_of(cameras, store_of(ds.render(ball(center, radius), cameras).alpha[..., None]))
    torch.testing.assert_close(frame.center, torch.tensor(center, dtype=torch.float64), rtol=0, atol=0.03 * radius)
    assert frame.radius == pytest.approx(1.1 * radius, rel=0.1)


@pytest.mark.parametrize("lens", [{}, {"height": 0.8}])
def test_drawing_in_the_frame_is_drawing_in_the_world(generator, lens):
    frame = Frame(torch.tensor([5.0, -2.0, 3.0], dtype=torch.float64), 0.25)
    sketch = ds.Sketch.random(8, generator=generator, radius=0.8, width=0.02)
    cameras = ds.orbit([0, 100, 220], 20, 1.0, size=64, target=(5.0, -2.0, 3.0), **lens)
    world = ds.render(frame.to_world(sketch), cameras)
    inside = ds.render(sketch, frame.cameras(cameras))
    torch.testing.assert_close(inside.color, world.color, rtol=0, atol=1e-3)
    torch.testing.assert_close(inside.depth * 0.25, world.depth, rtol=0, atol=1e-3)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("center", [(0.0, 0.0, 0.0), (5e5, -4.6e6, 100.0)])
def test_the_frame_keeps_what_float32_would_not(center, scale):
    """A ball far from the origin, in metres or in units much smaller or larger: as a ball of radius 1 at the origin."""
    eyes = ds.orbit([0, 70, 140, 210, 280], [-20, 10, 40, 60, 0], 4.0).centers.double()
    cameras = ds.look_at(eyes, size=200)
    inside = ball((0.0, 0.0, 0.0), 1.0)
    store = store_of(ds.render(inside, cameras).alpha[..., None])
    at_origin = frame_of(cameras, store)
    shift = torch.tensor(center, dtype=torch.float64)
    moved = cameras.world_to_camera.clone()
    moved[:, :3, 3] = scale * (moved[:, :3, 3] - moved[:, :3, :3] @ shift)
    there = ds.Cameras(moved, cameras.intrinsics, cameras.size, 0.01 * scale)
    frame = frame_of(there, store)
    torch.testing.assert_close(frame.center / scale - shift, at_origin.center, rtol=0, atol=1e-6)
    torch.testing.assert_close(
        frame.cameras(there).world_to_camera, at_origin.cameras(cameras).world_to_camera, rtol=0, atol=1e-6
    )
    world = frame.to_world(inside)
    assert world.points.dtype == (torch.float64 if any(center) else torch.float32)
    back = (world.points.double() - frame.center) / frame.radius
    torch.testing.assert_close(back, inside.points.double(), rtol=0, atol=1e-6)


def test_views_must_show_something_from_two_sides():
    cameras = ds.orbit([0, 0.5], 0, 3.0, size=32)
    with pytest.raises(ValueError, match="the pictures show nothing"):
        frame_of(cameras, store_of(torch.zeros(2, 32, 32, 1)))
    with pytest.raises(ValueError, match="views all look the same way"):
        frame_of(cameras, store_of(torch.ones(2, 32, 32, 1)))


def test_cameras_that_look_away():
    """OpenCV axes in a file that should hold OpenGL's: everything lies behind."""
    cameras = ds.orbit([0, 90, 180], 10, 3.0, size=32)
    flipped = ds.Cameras(
        torch.diag(torch.tensor([1.0, -1, -1, 1])) @ cameras.world_to_camera, cameras.intrinsics, (32, 32)
    )
    with pytest.raises(ValueError, match=r"look away.*OpenGL"):
        frame_of(flipped, store_of(torch.ones(3, 32, 32, 1)))


def test_only_what_is_known_is_content():
    """Ink where nothing is known, and views without any, change nothing."""
    cameras = ds.orbit([0, 70, 140, 210, 280], [-20, 10, 40, 60, 0], 4.0, size=200)
    pixels = store_of(ds.render(ball((0.0, 0.0, 0.0), 1.0), cameras).alpha[..., None]).pixels
    expected = frame_of(cameras[:4], Store(pixels[:4], torch.ones(4, 200, 200, dtype=torch.bool)))
    known = torch.ones(5, 200, 200, dtype=torch.bool)
    pixels[:, 10:30, 10:30], known[:, 10:30, 10:30] = 255, False
    pixels[4] = 0
    found = frame_of(cameras, Store(pixels, known))
    torch.testing.assert_close(found.center, expected.center)
    assert found.radius == pytest.approx(expected.radius)
