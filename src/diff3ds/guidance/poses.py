"""Where cameras stand, in the angles that priors were trained with."""

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras


def spherical(
    cameras: Cameras,
) -> tuple[Float[Tensor, " B"], Float[Tensor, " B"], Float[Tensor, " B"]]:
    """Azimuth and elevation in degrees and distance of cameras from the origin, as `orbit` takes them, float64.

    Azimuth in (-180, 180], 0 on +x, counter-clockwise seen from +z; elevation above the horizon.
    """
    centers = cameras.centers.detach().cpu().double()
    distance = centers.norm(dim=1)
    azimuth = torch.rad2deg(torch.atan2(centers[:, 1], centers[:, 0]))
    elevation = torch.rad2deg(torch.asin((centers[:, 2] / distance).clamp(-1, 1)))
    return azimuth, elevation, distance
