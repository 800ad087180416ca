"""Cameras that see a whole sketch, whatever its size and place."""

import math
from dataclasses import replace

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Angle, Cameras, Size, check_size, orbit
from diff3ds.sketch import Sketch

# Of the shorter side of the picture that the sketch's ball takes.
FILLED = 0.9
# Degrees, vertical.
FOV = 40.0


def ball_of(*sketches: Sketch) -> tuple[Float[Tensor, " 3"], float]:
    """Middle and radius, float64, of a ball that holds all control points, and so the strokes; of nothing, 1."""
    points = torch.cat([sketch.points.detach().to("cpu").flatten(0, 1).double() for sketch in sketches])
    if not len(points):
        return torch.zeros(3, dtype=torch.float64), 1.0
    middle = (points.amin(0) + points.amax(0)) / 2
    return middle, float((points - middle).norm(dim=1).max()) or 1.0


def framed(
    sketch: Sketch,
    azimuth: Angle,
    elevation: Angle,
    *,
    size: Size = 256,
    distance: float | None = None,
    fov: float = FOV,
    height: float | None = None,
) -> Cameras:
    """Cameras all round a sketch, float64, that look at its middle.

    Args:
        azimuth: degrees, as the next: `orbit` has them.
        size: pixels, or (height, width).
        distance: from the middle, world units; None takes one from which the sketch fills the picture.
        fov: vertical field of view, degrees.
        height: of what orthographic cameras show, world units, instead of a field of view.

    Raises:
        ValueError: as `orbit`.
    """
    middle, radius = ball_of(sketch)
    rows, columns = check_size(size)
    if distance is None:
        # The cone of the narrower side touches the ball.
        side = math.tan(math.radians(fov / 2)) * min(1.0, columns / rows)
        distance = radius / (FILLED * math.sin(math.atan(side)))
    lens = fov if height is None else None
    # Placed around the origin and moved: in map coordinates the float32 of `orbit` would move them.
    cameras = orbit(azimuth, elevation, distance, fov=lens, height=height, size=(rows, columns), near=distance / 100)
    cameras = cameras.to(torch.float64)
    pose = cameras.world_to_camera.clone()
    pose[:, :3, 3] -= pose[:, :3, :3] @ middle
    return replace(cameras, world_to_camera=pose)
