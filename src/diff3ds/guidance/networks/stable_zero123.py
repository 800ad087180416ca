"""Stable-Zero123: as Zero-1-to-3, but told the reference's elevation and not the distance of cameras."""

import math

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance.networks.zero123 import ReferencePose, Zero123, assemble, relative_pose
from diff3ds.guidance.poses import spherical
from diff3ds.guidance.recipe import USUAL, Precision, Work
from diff3ds.weights.locate import find
from diff3ds.weights.weight_options import Source

# Cameras this fraction nearer or farther than the reference's are at its distance: rounding of float32 matrices.
SAME_DISTANCE = 1e-3


def stable_pose(cameras: Cameras, reference: ReferencePose) -> Float[Tensor, "B 4"]:
    """(Δ polar angle, sin Δ azimuth, cos Δ azimuth, polar angle of the reference), radians, on the CPU.

    Raises:
        ValueError: a camera at another distance than the reference's, which this prior knows nothing of.
    """
    distance = spherical(cameras)[2]
    if bool(((distance / reference.distance - 1).abs() > SAME_DISTANCE).any()):
        raise ValueError(
            f"stable-zero123 needs all cameras at the distance of the reference, {reference.distance:g}, got "
            f"{float(distance.min()):g} to {float(distance.max()):g}: set both ends of the cameras' radius to it"
        )
    poses = relative_pose(cameras, reference)
    poses[:, 3] = math.radians(90 - reference.elevation)
    return poses


def load_stable_zero123(
    picture: Float[Tensor, "S S 3"],
    reference: ReferencePose | None = None,
    source: Source | None = None,
    *,
    device: str = "auto",
    precision: Precision = "auto",
    work: Work = USUAL,
) -> Zero123:
    """Stable-Zero123 with a reference picture. For arguments and errors see `load_zero123`.

    Its weights are for non-commercial research only; `KNOWN["stable-zero123"].warning` says so, to be shown.
    """
    checkpoint, pose = find("stable-zero123", source), reference or ReferencePose()
    return assemble(checkpoint, picture, pose, device, precision, work, stable_pose)
