"""A stool of lines and exact circles, the embedded scene of `diff3ds views --demo`."""

import math

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import circle
from diff3ds.camera import Cameras, orbit
from diff3ds.sketch import Sketch

LEGS = 4
# Of the pictures, pixels.
DEMO_SIZE = 256
# World units: the stool is two high and stands in the unit ball.
SEAT_RADIUS, SEAT_TOP, SEAT_BOTTOM = 0.5, 0.7, 0.56
FOOT_RADIUS, FOOT = 0.62, -0.75
RING = -0.3


def demo_sketch() -> Sketch:
    """The stool: a round seat, four splayed legs, and a ring that joins them."""
    share = (SEAT_BOTTOM - RING) / (SEAT_BOTTOM - FOOT)
    top, foot = 0.8 * SEAT_RADIUS, FOOT_RADIUS
    ring = top + share * (foot - top)
    circles = [(SEAT_RADIUS, SEAT_TOP), (SEAT_RADIUS, SEAT_BOTTOM), (ring, RING)]
    legs = torch.stack([torch.stack([_at(i, top, SEAT_BOTTOM), _at(i, foot, FOOT)]) for i in range(LEGS)])
    sides = torch.stack(
        [torch.stack([_at(i, SEAT_RADIUS, SEAT_BOTTOM), _at(i, SEAT_RADIUS, SEAT_TOP)]) for i in range(LEGS)]
    )
    return Sketch.concatenate([*(_ring(radius, height) for radius, height in circles), Sketch(legs), Sketch(sides)])


def demo_cameras(views: int = 24, size: int = DEMO_SIZE) -> Cameras:
    """Views from all around, at five elevations in turn."""
    azimuth = [360 * i / views for i in range(views)]
    return orbit(azimuth, [(-10.0, 35.0, 5.0, 50.0, 20.0)[i % 5] for i in range(views)], 2.6, fov=45, size=size)


def _at(leg: int, radius: float, height: float) -> Float[Tensor, " 3"]:
    angle = 2 * math.pi * (leg + 0.5) / LEGS
    return torch.tensor([radius * math.cos(angle), radius * math.sin(angle), height])


def _ring(radius: float, height: float) -> Sketch:
    return Sketch(*circle((0.0, 0.0, height), radius, dtype=torch.float32))
