"""Two scenes in which nearly everything hides something: coloured tubes with known shapes, and pictures of them."""

import math

import torch

import diff3ds as ds
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.store import store_of

COLORS = torch.tensor(
    [[0.86, 0.24, 0.2], [0.96, 0.66, 0.15], [0.25, 0.6, 0.35], [0.16, 0.45, 0.75], [0.5, 0.27, 0.6], [0.2, 0.2, 0.2]]
)
SIZE = 256


def linked_rings() -> ds.Sketch:
    """Six tubes, each a circle that passes through its neighbours, in a closed chain."""
    rings = []
    for i, color in enumerate(COLORS):
        angle = 2 * math.pi * i / len(COLORS)
        center = torch.tensor([0.6 * math.cos(angle), 0.6 * math.sin(angle), 0.0])
        along = torch.tensor([-math.sin(angle), math.cos(angle), 0.0])
        out = center / 0.6
        tilt = math.radians(45 if i % 2 else -45)
        across = math.cos(tilt) * out + torch.tensor([0.0, 0.0, math.sin(tilt)])
        rings.append(_ring(center, 0.4, along, across, width=0.16, color=color))
    return ds.Sketch.concatenate(rings)


def caged_ball() -> ds.Sketch:
    """A ball of closely wound tubes in four colours inside a cage of twelve meridians and three parallels."""
    east, north, up = torch.eye(3)
    parts = []
    for i in range(15):
        latitude = math.radians(-84 + 12 * i)
        center = 0.5 * math.sin(latitude) * up
        parts.append(_ring(center, 0.5 * math.cos(latitude), east, north, width=0.16, color=COLORS[i // 2 % 4]))
    for i in range(6):
        angle = math.pi * i / 6
        side = math.cos(angle) * east + math.sin(angle) * north
        parts.append(_ring(0 * up, 0.95, side, up, width=0.1, color=COLORS[5]))
    for height in (-0.5, 0.0, 0.5):
        parts.append(_ring(height * up, math.sqrt(0.95**2 - height**2), east, north, width=0.1, color=COLORS[4]))
    return ds.Sketch.concatenate(parts)


def pictures_of(sketch: ds.Sketch, views: int, phase: float) -> PosedPictures:
    """Pictures with alpha from all around, along a spiral from below to above that begins at `phase` degrees."""
    turns = [phase + 137.508 * i for i in range(views)]
    height = [math.degrees(math.asin(-0.7 + 1.6 * (i + 0.5) / views)) for i in range(views)]
    cameras = ds.orbit(turns, height, 3.2, fov=45, size=SIZE)
    pixels = []
    for view in range(views):
        drawn = ds.render(sketch, cameras[view], background=0.0)
        pixels.append(torch.cat([drawn.color, drawn.alpha[..., None]], -1))
    names = tuple(f"view {i}" for i in range(views))
    return PosedPictures(cameras, "color", store_of(torch.cat(pixels)), names)


def _ring(center, radius, x, y, *, width, color) -> ds.Sketch:
    """A tube along the circle in the plane of two unit vectors."""
    points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 1.0, dtype=torch.float32)
    place = center + radius * (points[..., :1] * x + points[..., 1:2] * y)
    return ds.Sketch(place, weights, width=width, color=color.expand(len(points), 3), width_space="world")
