"""The visual hull of balls, whose silhouettes are exact circles."""

import math

import pytest
import torch

import diff3ds as ds
from diff3ds.pictures.content.visual_hull import visual_hull
from diff3ds.pictures.store import Store, as_bytes

DISTANCE, SIZE = 3.5, 100


@pytest.fixture
def cameras():
    turns = [137.508 * i for i in range(40)]
    heights = [math.degrees(math.asin(-0.975 + 0.05 * i)) for i in range(40)]
    return ds.orbit(turns, heights, DISTANCE, fov=45, size=SIZE)


def ball(cameras, radius, color=(0.8, 0.4, 0.2)):
    """Pictures of a ball around the origin: cones around the optical axis that touch it."""
    focal = float(cameras.intrinsics[0, 0, 0])
    reach = focal * radius / math.sqrt(DISTANCE**2 - radius**2)
    across = torch.arange(SIZE) + 0.5 - SIZE / 2
    alpha = (torch.hypot(across[:, None], across) < reach).float()[..., None]
    pixels = torch.cat([alpha * torch.tensor(color), alpha], -1)
    return as_bytes(pixels[None].expand(len(cameras), -1, -1, -1))


def depth_of_layer(cameras, hull):
    """How deep the middles of surface cells lie at most: a cell's diagonal, and a pixel that a middle falls into."""
    return math.sqrt(3) * hull.spacing + DISTANCE / float(cameras.intrinsics[0, 0, 0])


def store(pixels, known=None):
    return Store(pixels, torch.ones(pixels.shape[:3], dtype=torch.bool) if known is None else known)


def test_the_hull_of_a_ball(cameras):
    hull = visual_hull(cameras, store(ball(cameras, 0.8)))
    distance = hull.points.norm(dim=1)
    # Outside it is as far off: gaps between 40 views are narrower than that.
    assert (distance - 0.8).abs().max() < depth_of_layer(cameras, hull)
    assert ((hull.normals * hull.points).sum(1) / distance).min() > 0.85
    assert hull.area == pytest.approx(4 * math.pi * 0.8**2, rel=0.1)
    torch.testing.assert_close(hull.colors, torch.tensor([0.8, 0.4, 0.2]).expand_as(hull.colors), rtol=0, atol=3e-3)


def test_the_hull_of_a_ball_in_orthographic_views(cameras):
    """Whose silhouettes have its own radius."""
    scale = SIZE / 3.0
    lens = torch.tensor([[scale, 0, SIZE / 2], [0, scale, SIZE / 2], [0, 0, 1]]).expand(len(cameras), 3, 3)
    flat = ds.Cameras(cameras.world_to_camera, lens, cameras.size, orthographic=True)
    across = torch.arange(SIZE) + 0.5 - SIZE / 2
    alpha = (torch.hypot(across[:, None], across) < 0.8 * scale).float()[..., None]
    hull = visual_hull(flat, store(as_bytes(alpha.expand(len(flat), -1, -1, 4))))
    assert len(hull.points) > 1000
    assert (hull.points.norm(dim=1) - 0.8).abs().max() < math.sqrt(3) * hull.spacing + 1 / scale


@pytest.mark.slow
def test_one_wrong_picture_carves_nothing(cameras):
    pixels = ball(cameras, 0.8).clone()
    pixels[7] = 0
    hull = visual_hull(cameras, store(pixels))
    assert (hull.points.norm(dim=1) - 0.8).abs().max() < depth_of_layer(cameras, hull)
    # Where nothing is known nothing is carved, by however many views.
    known = torch.ones(pixels.shape[:3], dtype=torch.bool)
    pixels[10:20], known[10:20] = 0, False
    hull = visual_hull(cameras, store(pixels, known))
    assert (hull.points.norm(dim=1) - 0.8).abs().max() < depth_of_layer(cameras, hull)


def test_without_alpha_the_points_fill_the_ball_of_the_scene(cameras):
    pixels = torch.full((40, SIZE, SIZE, 4), 255, dtype=torch.uint8)
    hull = visual_hull(cameras, store(pixels))
    distance = hull.points.norm(dim=1)
    assert distance.max() < 1
    assert float((distance < 0.5).float().mean()) == pytest.approx(1 / 8, abs=0.005)
    assert not hull.normals.any()
